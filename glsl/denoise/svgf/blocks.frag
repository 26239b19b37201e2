// How the new frame differs from the history, and what its noise alone would do, over blocks of pixels.
#include "denoise/svgf/common.glsl"

uniform sampler2D t_noisy;
uniform sampler2D t_reprojected;
uniform sampler2D t_moments;

layout(location = 0) out vec4 o_difference;  // over pixels with a history: sum of new - old, of its square, of 1 / frames, pixels
layout(location = 1) out vec4 o_noise;       // variance of pixels over space; root of the sum of (new - old)^4; variance over time, its pixels
layout(location = 2) out vec2 o_doubt;       // sums of the resampling's doubt, and of its square

// The mixed difference of a quad of pixels knows nothing of what is constant or runs along one axis, but all of the noise.
float rough(vec4 quad) {
    float mixed = quad.x - quad.y - quad.z + quad.w;
    return 0.25 * mixed * mixed;
}

void main() {
    o_difference = vec4(0.0);
    o_noise = vec4(0.0);
    o_doubt = vec2(0.0);
    ivec2 first = ivec2(gl_FragCoord.xy) * BLOCK, last = textureSize(t_noisy, 0) - 1;
    vec2 seen = vec2(0.0);
    for (int i = 0; i < BLOCK * BLOCK / 4; ++i) {
        ivec2 corner = first + 2 * ivec2(i % (BLOCK / 2), i / (BLOCK / 2));
        vec4 now = vec4(0.0), then = vec4(0.0);
        float frames = 1e30;
        bool whole = true;
        for (int k = 0; k < 4; ++k) {
            ivec2 pixel = corner + ivec2(k & 1, k >> 1);
            vec4 before = texelFetch(t_reprojected, min(pixel, last), 0);
            vec4 noisy = texelFetch(t_noisy, min(pixel, last), 0);
            if (any(greaterThan(pixel, last)) || before.w <= 0.0 || !svgf_is_finite(noisy)) { whole = false; continue; }
            now[k] = svgf_luminance(noisy.rgb);
            then[k] = svgf_luminance(before.rgb);
            frames = min(frames, before.w);
            float difference = now[k] - then[k];
            o_difference += vec4(difference, difference * difference, 1.0 / before.w, 1.0);
            o_noise.y = svgf_hypotenuse(o_noise.y, difference * difference);
            vec4 moments = texelFetch(t_moments, min(pixel, last), 0);
            o_doubt += vec2(moments.z, moments.z * moments.z);
            if (before.w < 3.5) continue;   // no variance over time to speak of yet
            o_noise.zw += vec2(max(moments.y - moments.x * moments.x, 0.0) * before.w / (before.w - 1.0), 1.0);
        }
        if (!whole) continue;
        seen += vec2(rough(now), rough(then) * frames);
    }
    o_noise.x = 4.0 * max(seen.x, seen.y);   // a quad for its four pixels
}
