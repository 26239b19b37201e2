// What the last frame held at the surface of this pixel: by a polynomial where all around shows it, else bilinear over those of four texels
// that do (Schied et al. 2017, sec. 4.1).
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
layout(location = 1) out vec4 o_moments;   // xy: of the luminance of single frames; z: doubt of the resampling, a luminance

vec3 previous_position(vec2 uv, float depth_m) {
    vec2 xy = ((uv - u_previous_jitter) * 2.0 - 1.0) * u_previous_lens.xy * (u_previous_lens.z == 0.0 ? depth_m : 1.0);
    return (u_previous_world_from_camera * vec4(xy, -depth_m, 1.0)).xyz;
}

// Weights of TAPS texels in a row (an even number; 2: bilinear) for a point f beyond the first of the middle two: Lagrange's polynomial
// through them. A history takes along its resampling's errors from frame to frame: bilinear it blurs, by Catmull and Rom's cubic it rings.
void weights(float f, out float w[TAPS]) {
    for (int i = 0; i < TAPS; ++i) {
        w[i] = 1.0;
        for (int j = 0; j < TAPS; ++j) if (j != i) w[i] *= (f + float(TAPS / 2 - 1 - j)) / float(i - j);
    }
}

// The history at a texel, with w = 0 where it is not that of this surface.
vec4 history_at(ivec2 texel, SvgfSurface here, float width) {
    ivec2 size = textureSize(t_color, 0);
    if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, size))) return vec4(0.0);
    float depth_m = texelFetch(t_previous_depth_m, texel, 0).r;
    if (depth_m <= 0.0) return vec4(0.0);
    vec3 normal = texelFetch(t_previous_normal_ws, texel, 0).xyz;
    vec3 off = previous_position((vec2(texel) + 0.5) / vec2(size), depth_m) - here.position_ws;
    if (dot(normal, here.normal_ws) < 0.9 || abs(dot(off, here.normal_ws)) > 2.0 * width) return vec4(0.0);
    vec4 color = texelFetch(t_color, texel, 0);
    // A history that is not finite is none: whatever put it there is gone with this frame.
    return color.w > 0.0 && svgf_is_finite(color) ? color : vec4(0.0);
}

void main() {
    o_color = vec4(0.0);
    o_moments = vec4(0.0);
    ivec2 pixel = ivec2(gl_FragCoord.xy), size = textureSize(t_depth_m, 0);
    SvgfSurface here = svgf_surface(pixel);
    if (here.depth_m <= 0.0) return;
    vec2 motion = texelFetch(t_motion, pixel, 0).xy;
    if (!svgf_is_finite(vec4(motion, 0.0, 0.0))) return;
    vec2 at = gl_FragCoord.xy + (u_history_shift - motion) * vec2(size) - 0.5;
    vec2 base = floor(at + 1e-3), f = max(at - base, vec2(0.0));
    float wx[TAPS], wy[TAPS];
    weights(f.x, wx);
    weights(f.y, wy);
    float width = svgf_pixel_width(here.depth_m), total = 0.0, total_inner = 0.0;
    vec4 inner = vec4(0.0);
    vec3 least = vec3(1e30);    // of the 4 x 4 around
    vec2 nearest = vec2(0.0);   // its luminance, its weight
    // A view that stands still needs one texel; llvmpipe leaves a loop when all pixels are done with it.
    ivec2 moves = ivec2(greaterThan(f, vec2(1e-3))), columns = 1 + (TAPS - 1) * moves;
    for (int i = 0; i < columns.x * columns.y; ++i) {
        ivec2 k = ivec2(i % columns.x, i / columns.x) + (TAPS / 2 - 1) * (1 - moves);
        float w = wx[k.x] * wy[k.y];
        if (abs(w) < 1e-4) continue;
        ivec2 texel = ivec2(base) + k - (TAPS / 2 - 1);
        vec4 color = history_at(texel, here, width);
        if (color.w <= 0.0) continue;
        o_color += w * color;
        total += w;
        ivec2 q = k - (TAPS / 2 - 1);
        if (any(lessThan(q, ivec2(-1))) || any(greaterThan(q, ivec2(2)))) continue;
        least = min(least, color.rgb);
        if (any(lessThan(q, ivec2(0))) || any(greaterThan(q, ivec2(1)))) continue;
        vec2 moments = texelFetch(t_moments, texel, 0).rg;
        if (!svgf_is_finite(moments.xyxy)) continue;
        vec2 near = mix(1.0 - f, f, vec2(q));
        inner += near.x * near.y * color;
        if (near.x * near.y > nearest.y) nearest = vec2(svgf_luminance(color.rgb), near.x * near.y);
        o_moments.xy += near.x * near.y * moments;
        total_inner += near.x * near.y;
    }
    if (total_inner < 0.01) { o_color = vec4(0.0); o_moments = vec4(0.0); return; }
    inner /= total_inner;
    o_moments.xy /= total_inner;
    // Where some of the four are missing, the others are all that is known. Beside a line a polynomial undershoots, frame by frame more: no
    // darker than half of what is around. (Keeping it within that, from above as well, would wear the lines away.)
    bool whole = total_inner > 0.999 && total > 0.5;
    o_color = vec4(whole ? max(o_color.rgb / total, 0.5 * least) : inner.rgb, inner.w);
    // An edge between texels could as well be anywhere between them: the history is off by about what shifting the nearest one by makes.
    o_moments.z = nearest.x - svgf_luminance(o_color.rgb);
}
