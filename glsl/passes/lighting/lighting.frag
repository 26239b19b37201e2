// Direct light of one punctual light at the camera's opaque pixels, with its shadow; added up over the lights.
#include "common/brdf.glsl"
#include "interface/camera.glsl"
#include "interface/light.glsl"
#if HAS_SHADOW
#include "common/shadow.glsl"
#include "interface/shadow_view.glsl"
uniform sampler2DShadow t_shadow;
#endif

uniform sampler2D t_depth_m;
uniform sampler2D t_normal_ws;
#if HAS_HIGHLIGHT
uniform sampler2D t_albedo;
uniform sampler2D t_material;
#endif

in vec2 v_uv;
layout(location = 0) out vec4 o_irradiance;      // W/m^2 or lux
#if HAS_HIGHLIGHT
layout(location = 1) out vec4 o_highlight;       // specular radiance
#endif

#if HAS_SHADOW
// Depth in [0, 1] as the shadow map's face stored it.
float stored_depth(GlcView view, vec3 p_ws) {
#if SHADOW_FACES == 1
    vec4 clip = view.clip_from_world * vec4(p_ws, 1.0);
    return clip.z / clip.w * 0.5 + 0.5;
#else
    float z = dot(p_ws - view.light.xyz, glc_view_forward(view, p_ws));
    float near = u_shadow_depth_range.x, far = u_shadow_depth_range.y;
    return far * (z - near) / (max(z, 1e-20) * (far - near));
#endif
}

float shadow(vec3 p_ws, vec3 n_ws, vec3 d) {
    GlcView view = glc_shadow_view();
    // Bias in texel widths (scale-free), along the normal: enough for the filter's reach on a slope, none where the light is frontal.
    float width = glc_texel_width(view, p_ws);
    float cos_l = clamp(-dot(n_ws, d), 0.0, 1.0);
    float sin_l = sqrt(1.0 - cos_l * cos_l);
    vec3 biased = p_ws + n_ws * (width * (0.6 + 2.6 * sin_l));
    vec3 projected = glc_view_project(view, biased);
    if (!glc_view_inside(view, projected)) return 1.0;
    vec2 lower = vec2(0.5), upper = view.size - 0.5;
#if SHADOW_FACES == 6
    vec2 tile = view.size / vec2(3.0, 2.0);
    lower = floor(projected.xy / tile) * tile + 0.5;
    upper = lower + tile - 1.0;
#endif
    return glc_shadow_pcf(t_shadow, projected.xy, stored_depth(view, biased), lower, upper);
}
#endif

void main() {
    o_irradiance = vec4(0.0);
#if HAS_HIGHLIGHT
    o_highlight = vec4(0.0);
#endif
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float depth_m = texelFetch(t_depth_m, pixel, 0).r;
    if (depth_m <= 0.0) return;
    vec3 p = glc_camera_position_ws(v_uv, depth_m);
    vec3 n = texelFetch(t_normal_ws, pixel, 0).xyz;
    vec3 d;
    vec3 perpendicular = glc_light_perpendicular_irradiance(p, d);
    float cos_l = dot(n, -d);
    if (cos_l <= 0.0) return;
    float visible = 1.0;
#if HAS_SHADOW
    visible = shadow(p, n, d);
#endif
    o_irradiance = vec4(perpendicular * (cos_l * visible), 1.0);
#if HAS_HIGHLIGHT
    vec4 albedo = texelFetch(t_albedo, pixel, 0);
    float roughness = texelFetch(t_material, pixel, 0).r;
    vec3 f0 = mix(vec3(0.04), albedo.rgb, albedo.w);
    o_highlight = vec4(perpendicular * visible * glc_ggx_cos(n, -glc_camera_ray_ws(v_uv), -d, f0, roughness * roughness), 0.0);
#endif
}
