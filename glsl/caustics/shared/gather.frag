// Caustic irradiance at the camera's opaque pixels: look-up in one light's caustic map by projection, as in shadow mapping
// (Shah et al. 2007, sec. III B). E = flux of the texel x cos / cross-section: the receiver's own area, not the light's.
#include "interface/receiver_view.glsl"
#include "interface/camera.glsl"
#if WARP
#include "interface/map_warp.glsl"
#endif

uniform sampler2D t_depth_m;
uniform sampler2D t_normal_ws;
uniform sampler2D t_receiver_position;
uniform sampler2D t_flux;
uniform int u_max_taps;     // per axis

#if WARP
const float WARP_TAPS = 32.0;
#endif

in vec2 v_uv;
layout(location = 0) out vec4 o_irradiance;  // W/m^2 or lux

// 1 where the texel of the map holds the surface that p lies on.
float same_surface(GlcView view, vec3 p_ws, vec3 n_ws, vec3 l, float width, ivec2 texel) {
    vec4 stored = texelFetch(t_receiver_position, texel, 0);
    if (stored.w == 0.0) return 0.0;
    vec3 off = stored.xyz - p_ws;
    // Off the tangent plane, in texel widths; along a surface that the light grazes a texel reaches further.
    float cos_l = max(abs(dot(n_ws, l)), 0.1);
    return abs(dot(off, n_ws)) < 2.0 * width && length(off) < 4.0 * width / cos_l ? 1.0 : 0.0;
}

// Where a place of the view lies in the map, texels of it; `rate`: those in a texel of the view.
#if WARP
vec2 map_place(GlcView view, vec2 projected, out vec2 rate) {
    return warp(projected - 0.5 * view.size, view.size, rate) + 0.5 * vec2(textureSize(t_flux, 0));
}
#endif

// Irradiance at p, bilinear over the texels that hold its surface; w = 1 where there is one.
vec4 irradiance_at(GlcView view, vec3 p, vec3 n) {
    vec3 l = glc_light_direction(view, p);
    // A two-sided sheet is lit on the side that the eye sees; the map holds the side that the light sees.
    float cos_l = dot(n, -l);
    vec3 projected = glc_view_project(view, p);
    if (cos_l <= 0.0 || !glc_view_inside(view, projected)) return vec4(0.0);
    float width = glc_texel_width(view, p);
    vec2 rate = vec2(1.0);
#if WARP
    vec2 at = map_place(view, projected.xy, rate) - 0.5;
#else
    vec2 at = projected.xy - 0.5;
#endif
    width /= min(1.0, min(rate.x, rate.y));
    ivec2 base = ivec2(floor(at));
    vec2 f = at - vec2(base);
    ivec2 lower = ivec2(0), upper = textureSize(t_flux, 0) - 1;
#if RECEIVER_FACES == 6
    ivec2 tile = ivec2(view.size / vec2(3.0, 2.0));
    lower = ivec2(projected.xy) / tile * tile;
    upper = lower + tile - 1;
#endif
    vec4 weights = vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
    vec3 flux = vec3(0.0);
    float total = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 texel = clamp(base + ivec2(i & 1, i >> 1), lower, upper);
#if WARP
        vec2 there = projected.xy + (vec2(texel) - at) / rate;
        ivec2 seen = clamp(ivec2(floor(there)), ivec2(0), ivec2(view.size) - 1);
#else
        ivec2 seen = texel;
#endif
        float w = weights[i] * same_surface(view, p, n, l, width, seen);
        if (w <= 0.0) continue;
        flux += w * texelFetch(t_flux, texel, 0).rgb;
        total += w;
    }
    if (total < 0.05) return vec4(0.0);
    return vec4(flux / total * cos_l / glc_texel_cross_section(view, p), 1.0);
}

// The point of the tangent plane at p that another place of the pixel sees.
vec3 on_plane(vec2 uv, vec3 p, vec3 n, float depth_m) {
    vec3 q = glc_camera_position_ws(uv, depth_m);
    vec3 ray = glc_camera_ray_ws(uv);
    float d_n = dot(ray, n);
    return abs(d_n) > 0.05 ? q + ray * (dot(p - q, n) / d_n) : q;
}

void main() {
    o_irradiance = vec4(0.0);
    float depth_m = texelFetch(t_depth_m, ivec2(gl_FragCoord.xy), 0).r;
    if (depth_m <= 0.0) return;
    vec3 p = glc_camera_position_ws(v_uv, depth_m);
    vec3 n = texelFetch(t_normal_ws, ivec2(gl_FragCoord.xy), 0).xyz;
    GlcView view = glc_receiver_view();
    vec3 centre = glc_view_project(view, p);
    if (!glc_view_inside(view, centre)) return;
    // A pixel that covers several texels takes their mean, or fold lines one texel wide would flicker and lose energy.
    vec2 pixel = 1.0 / vec2(textureSize(t_depth_m, 0));
    int face = glc_view_face(view, p);
    vec2 across = glc_view_project_on(view, on_plane(v_uv + vec2(pixel.x, 0.0), p, n, depth_m), face).xy - centre.xy;
    vec2 along = glc_view_project_on(view, on_plane(v_uv + vec2(0.0, pixel.y), p, n, depth_m), face).xy - centre.xy;
    int most = u_max_taps;
#if WARP
    // Half the pixel to either side: what crowds there is met at least on one.
    vec2 rate;
    map_place(view, centre.xy, rate);
    most = int(min(float(most) * max(rate.x, rate.y), WARP_TAPS));  // where texels crowd, a pixel covers many
    across = map_place(view, centre.xy + 0.5 * across, rate) - map_place(view, centre.xy - 0.5 * across, rate);
    along = map_place(view, centre.xy + 0.5 * along, rate) - map_place(view, centre.xy - 0.5 * along, rate);
#endif
    ivec2 taps = clamp(ivec2(ceil(vec2(length(across), length(along)) - 0.25)), ivec2(1), ivec2(most));
    vec4 sum = vec4(0.0);
    for (int j = 0; j < taps.y; ++j)
        for (int i = 0; i < taps.x; ++i) {
            vec2 offset = (vec2(i, j) + 0.5) / vec2(taps) - 0.5;
            vec3 q = taps == ivec2(1) ? p : on_plane(v_uv + offset * pixel, p, n, depth_m);
            sum += irradiance_at(view, q, n);
        }
    o_irradiance = sum.w > 0.0 ? vec4(sum.rgb / float(taps.x * taps.y), 1.0) : vec4(0.0);
}
