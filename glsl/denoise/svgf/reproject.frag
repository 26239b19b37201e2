// What the last frame held at the surface of this pixel: bilinear over those of four texels that show it (Schied et al. 2017, sec. 4.1).
#include "denoise/svgf/geometry.glsl"

uniform sampler2D t_motion;
uniform sampler2D t_color;
uniform sampler2D t_moments;
uniform sampler2D t_previous_depth_m;
uniform sampler2D t_previous_normal_ws;
uniform mat4 u_previous_world_from_camera;
uniform vec4 u_previous_lens;
uniform vec2 u_previous_jitter;
uniform vec2 u_history_shift;    // uv: of the picture that the history is, against the frame that motion is counted from

in vec2 v_uv;
layout(location = 0) out vec4 o_color;     // rgb: mean; w: frames in it, 0 = none
layout(location = 1) out vec2 o_moments;   // of the luminance of single frames

vec3 previous_position(vec2 uv, float depth_m) {
    vec2 xy = ((uv - u_previous_jitter) * 2.0 - 1.0) * u_previous_lens.xy * (u_previous_lens.z == 0.0 ? depth_m : 1.0);
    return (u_previous_world_from_camera * vec4(xy, -depth_m, 1.0)).xyz;
}

void main() {
    o_color = vec4(0.0);
    o_moments = vec2(0.0);
    ivec2 pixel = ivec2(gl_FragCoord.xy), size = textureSize(t_depth_m, 0);
    SvgfSurface here = svgf_surface(pixel);
    if (here.depth_m <= 0.0) return;
    vec2 motion = texelFetch(t_motion, pixel, 0).xy;
    if (!svgf_is_finite(vec4(motion, 0.0, 0.0))) return;
    vec2 at = gl_FragCoord.xy + (u_history_shift - motion) * vec2(size) - 0.5;
    vec2 base = floor(at + 1e-4), f = max(at - base, vec2(0.0));
    vec4 weights = vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
    float width = svgf_pixel_width(here.depth_m), total = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 texel = ivec2(base) + ivec2(i & 1, i >> 1);
        if (weights[i] < 1e-3 || any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, size))) continue;
        float depth_m = texelFetch(t_previous_depth_m, texel, 0).r;
        if (depth_m <= 0.0) continue;
        vec3 normal = texelFetch(t_previous_normal_ws, texel, 0).xyz;
        vec3 off = previous_position((vec2(texel) + 0.5) / vec2(size), depth_m) - here.position_ws;
        if (dot(normal, here.normal_ws) < 0.9 || abs(dot(off, here.normal_ws)) > 2.0 * width) continue;
        vec4 color = texelFetch(t_color, texel, 0);
        vec2 moments = texelFetch(t_moments, texel, 0).rg;
        // A history that is not finite is none: whatever put it there is gone with this frame.
        if (color.w <= 0.0 || !svgf_is_finite(color) || !svgf_is_finite(moments.xyxy)) continue;
        o_color += weights[i] * color;
        o_moments += weights[i] * moments;
        total += weights[i];
    }
    if (total < 0.01) { o_color = vec4(0.0); o_moments = vec2(0.0); return; }
    o_color /= total;
    o_moments /= total;
}
