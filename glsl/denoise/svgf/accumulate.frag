// Mean over frames: a plain mean while the history is shorter than its limit, exponential from there on. Where the new frame differs by
// more than its noise, in the mean over a neighbourhood or in the pattern within it, the history is shortened.
#include "denoise/svgf/common.glsl"

uniform sampler2D t_noisy;
uniform sampler2D t_reprojected;
uniform sampler2D t_moments;
uniform sampler2D t_blocks;
uniform float u_max_frames;

layout(location = 0) out vec4 o_color;     // rgb: mean; w: frames in it
layout(location = 1) out vec2 o_moments;

// 0: the frame agrees with the history; 1: the history is about something else.
float contradiction(ivec2 pixel) {
    ivec2 block = pixel / BLOCK, last = textureSize(t_blocks, 0) - 1;
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 9; ++i) sum += texelFetch(t_blocks, clamp(block + ivec2(i % 3, i / 3) - 1, ivec2(0), last), 0);
    if (sum.w < 8.0 || sum.y <= 0.0) return 0.0;
    float mean = sum.x / sum.w;
    float spread = max(sum.y / sum.w - mean * mean, 1e-6 * sum.y / sum.w);
    float by_mean = mean * mean * sum.w / spread;                 // squared t statistic
    float by_pattern = sum.y / max(sum.z, 1e-3 * sum.y);          // 1 if the noise explains it
    return max(smoothstep(12.0, 36.0, by_mean), smoothstep(2.5, 6.0, by_pattern));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 noisy = texelFetch(t_noisy, pixel, 0);
    vec4 before = texelFetch(t_reprojected, pixel, 0);
    vec2 moments = texelFetch(t_moments, pixel, 0).rg;
    o_color = before;
    o_moments = moments;
    if (!svgf_is_finite(noisy)) return;
    float frames = min(before.w * (1.0 - contradiction(pixel)) + 1.0, u_max_frames);
    float luminance = svgf_luminance(noisy.rgb);
    o_color = vec4(mix(before.rgb, noisy.rgb, 1.0 / frames), frames);
    o_moments = mix(moments, vec2(luminance, luminance * luminance), 1.0 / frames);
}
