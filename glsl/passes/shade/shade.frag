// Outgoing radiance of an opaque layer: albedo / pi x (direct + caustic + sky irradiance) + highlights + emission. Elsewhere the sky,
// or for the second layer (HAS_FIRST) what the first one shows, so that a surface goes on without a seam.
#include "common/optics.glsl"
#include "interface/camera.glsl"
#include "interface/sky.glsl"

uniform sampler2D t_depth_m;
uniform sampler2D t_normal_ws;
uniform sampler2D t_albedo;
uniform sampler2D t_irradiance;
#if HAS_HIGHLIGHT
uniform sampler2D t_highlight;
#endif
#if HAS_EMISSIVE
uniform sampler2D t_emissive;
#endif
#if HAS_CAUSTICS
uniform sampler2D t_caustics;
#endif
#if HAS_FIRST
uniform sampler2D t_first;
#endif
#if HAS_CAUSTICS_OUT && HAS_FIRST_CAUSTICS
uniform sampler2D t_first_caustics;
#endif

in vec2 v_uv;
layout(location = 0) out vec4 o_radiance;   // alpha: depth in metres, 0 = sky; refraction tells surfaces apart by it
#if HAS_CAUSTICS_OUT
layout(location = 1) out vec4 o_caustics;   // E_c of the same surfaces
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float depth_m = texelFetch(t_depth_m, pixel, 0).r;
#if HAS_CAUSTICS_OUT
    o_caustics = vec4(0.0);
#if HAS_CAUSTICS
    o_caustics = texelFetch(t_caustics, pixel, 0);
#endif
#if HAS_FIRST_CAUSTICS
    if (depth_m <= 0.0) o_caustics = texelFetch(t_first_caustics, pixel, 0);
#endif
#endif
    if (depth_m <= 0.0) {
#if HAS_FIRST
        o_radiance = texelFetch(t_first, pixel, 0);
        return;
#endif
        o_radiance = vec4(glc_sky_radiance(glc_camera_ray_ws(v_uv)), 0.0);
        return;
    }
    vec3 n = texelFetch(t_normal_ws, pixel, 0).xyz;
    vec4 albedo = texelFetch(t_albedo, pixel, 0);
    vec3 ambient = glc_sky_irradiance(n);
    vec3 irradiance = texelFetch(t_irradiance, pixel, 0).rgb + ambient;
#if HAS_CAUSTICS
    irradiance += texelFetch(t_caustics, pixel, 0).rgb;
#endif
    vec3 radiance = albedo.rgb * (1.0 - albedo.w) * irradiance / GLC_PI;
    // A rough metal has no diffuse part; its share of the sky comes with the base colour.
    radiance += albedo.rgb * albedo.w * ambient / GLC_PI;
#if HAS_HIGHLIGHT
    radiance += texelFetch(t_highlight, pixel, 0).rgb;
#endif
#if HAS_EMISSIVE
    radiance += texelFetch(t_emissive, pixel, 0).rgb;
#endif
    o_radiance = vec4(radiance, depth_m);
}
