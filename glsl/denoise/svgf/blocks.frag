// How the new frame differs from the history, over blocks of pixels: what the reaction to moving light is decided by.
#include "denoise/svgf/common.glsl"

uniform sampler2D t_noisy;
uniform sampler2D t_reprojected;
uniform sampler2D t_moments;

layout(location = 0) out vec4 o_block;  // sums over pixels with a history: difference, its square, expected square by noise alone, pixels

void main() {
    o_block = vec4(0.0);
    ivec2 first = ivec2(gl_FragCoord.xy) * BLOCK, size = textureSize(t_noisy, 0);
    for (int i = 0; i < BLOCK * BLOCK; ++i) {
        ivec2 pixel = first + ivec2(i % BLOCK, i / BLOCK);
        if (any(greaterThanEqual(pixel, size))) continue;
        vec4 before = texelFetch(t_reprojected, pixel, 0);
        vec4 noisy = texelFetch(t_noisy, pixel, 0);
        if (before.w < 3.5 || !svgf_is_finite(noisy)) continue;   // no variance to speak of yet
        vec2 moments = texelFetch(t_moments, pixel, 0).rg;
        float difference = svgf_luminance(noisy.rgb) - svgf_luminance(before.rgb);
        float variance = max(moments.y - moments.x * moments.x, 0.0) * before.w / (before.w - 1.0);
        o_block += vec4(difference, difference * difference, variance * (1.0 + 1.0 / before.w), 1.0);
    }
}
