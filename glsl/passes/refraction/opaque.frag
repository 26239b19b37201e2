// Pixels without any specular surface: the shaded opaque layer as it is. Masked by the specular layer's depth buffer.
#include "passes/refraction/outputs.glsl"

uniform sampler2D t_radiance;
#if HAS_CAUSTICS_VIEW
uniform sampler2D t_caustics;
#endif

in vec2 v_uv;

void main() {
    Seen seen = Seen(vec3(0.0), vec3(0.0), 0.0, v_uv, 0.0, 0.0, GLC_VIEW_OPAQUE);
#if HAS_RADIANCE
    seen.radiance = texelFetch(t_radiance, ivec2(gl_FragCoord.xy), 0).rgb;
#endif
#if HAS_CAUSTICS_VIEW
    seen.caustics = texelFetch(t_caustics, ivec2(gl_FragCoord.xy), 0).rgb;
#endif
    write_view(seen, GLC_TODO_NOTHING);
}
