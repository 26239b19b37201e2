// Pixels without any specular surface: the shaded opaque layer as it is. Masked by the specular layer's depth buffer.
#include "passes/refraction/outputs.glsl"
#if HAS_EYE_MEDIUM
#include "passes/refraction/eye_medium.glsl"

uniform sampler2D t_opaque_depth_m;
uniform vec3 u_bounds_min_ws;
uniform vec3 u_bounds_max_ws;
#endif

uniform sampler2D t_radiance;
#if HAS_CAUSTICS_VIEW
uniform sampler2D t_caustics;
#endif

in vec2 v_uv;

void main() {
    Seen seen = Seen(vec3(0.0), vec3(0.0), 0.0, v_uv, 0.0, 0.0, GLC_VIEW_OPAQUE);
#if HAS_RADIANCE
    seen.radiance = texelFetch(t_radiance, ivec2(gl_FragCoord.xy), 0).rgb;
#if HAS_EYE_MEDIUM
    seen.radiance *= glc_eye_transmittance(v_uv, texelFetch(t_opaque_depth_m, ivec2(gl_FragCoord.xy), 0).r, u_bounds_min_ws, u_bounds_max_ws);
#endif
#endif
#if HAS_CAUSTICS_VIEW
    seen.caustics = texelFetch(t_caustics, ivec2(gl_FragCoord.xy), 0).rgb;
#endif
    write_view(seen, GLC_TODO_NOTHING, 1.0, 0.0);
}
