// Mean over frames: a plain mean while the history is shorter than its limit, exponential from there on. Where the light has changed
// the history is worth fewer frames.
#include "denoise/svgf/common.glsl"

uniform sampler2D t_noisy;
uniform sampler2D t_reprojected;
uniform sampler2D t_moments;
#if ADAPTIVE
uniform sampler2D t_change;
#endif
uniform float u_max_frames;

in vec2 v_uv;
layout(location = 0) out vec4 o_color;     // rgb: mean; w: frames in it
layout(location = 1) out vec2 o_moments;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 noisy = texelFetch(t_noisy, pixel, 0);
    vec4 before = texelFetch(t_reprojected, pixel, 0);
    vec2 moments = texelFetch(t_moments, pixel, 0).rg;
    o_color = before;
    o_moments = moments;
    if (!svgf_is_finite(noisy)) return;
#if ADAPTIVE
    // The best mix of two estimates: the history is off by 1 / frames of a pixel's variance by noise, and by the change.
    float change = texture(t_change, v_uv * vec2(textureSize(t_noisy, 0)) / vec2(BLOCK * textureSize(t_change, 0))).r;
    float frames = before.w > 0.0 ? min(1.0 + before.w / (1.0 + before.w * change), u_max_frames) : 1.0;
#else
    float frames = min(before.w + 1.0, u_max_frames);
#endif
    float luminance = svgf_luminance(noisy.rgb);
    o_color = vec4(mix(before.rgb, noisy.rgb, 1.0 / frames), frames);
    o_moments = mix(moments, vec2(luminance, luminance * luminance), 1.0 / frames);
}
