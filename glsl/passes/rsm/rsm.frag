// Reflective shadow map (Dachsbacher, Stamminger 2005): distance, normal, flux and roughness of what a light sees first.
#include "common/light_view.glsl"
#include "interface/light.glsl"
#include "interface/objects.glsl"

in vec3 v_position_ws;
in vec3 v_normal_ws;
#if HAS_UV
in vec2 v_uv;
uniform sampler2D t_base_color;
#endif
uniform float u_object;
uniform float u_rsm_texel_measure;
uniform vec3 u_rsm_forward_ws;

#if HAS_DEPTH_M
layout(location = LOCATION_DEPTH_M) out float o_depth_m;       // along the light's rays, metres; 0 = nothing (directional: from the near plane)
#endif
#if HAS_NORMAL_WS
layout(location = LOCATION_NORMAL_WS) out vec4 o_normal_ws;    // towards the light; w: object index + 1
#endif
#if HAS_FLUX
layout(location = LOCATION_FLUX) out vec4 o_flux;              // incident flux of the texel x base colour (opaque) or x 1 (specular), W or lm
#endif
#if HAS_MATERIAL
layout(location = LOCATION_MATERIAL) out vec4 o_material;      // x: roughness; y: optical kind (objects.glsl)
#endif

uniform float u_near_m;

void main() {
    GlcObject object = glc_object(int(u_object));
    GlcView view = GlcView(mat4(1.0), u_light, vec2(1.0), u_rsm_texel_measure, u_rsm_forward_ws, 1);
    vec3 d = glc_light_direction(view, v_position_ws);
#if HAS_DEPTH_M
    o_depth_m = glc_light_distance(view, v_position_ws) - (u_light.w == 0.0 ? u_near_m : 0.0);
#endif
#if HAS_NORMAL_WS
    vec3 n = glc_safe_normalize(v_normal_ws, -d);
    o_normal_ws = vec4(dot(n, d) > 0.0 ? -n : n, u_object + 1.0);
#endif
#if HAS_FLUX
    vec3 flux = u_light_intensity;
    if (u_light.w != 0.0) {
        float cos_axis = max(dot(d, u_rsm_forward_ws), 1e-3);
        flux *= glc_light_cone(d) * u_rsm_texel_measure * cos_axis * cos_axis * cos_axis;
    } else {
        flux *= u_rsm_texel_measure;
    }
    vec3 albedo = object.kind == GLC_DIFFUSE ? object.base_color : vec3(1.0);
#if HAS_UV
    if (object.kind == GLC_DIFFUSE) albedo *= texture(t_base_color, v_uv).rgb;
#endif
    o_flux = vec4(flux * albedo, 1.0);
#endif
#if HAS_MATERIAL
    o_material = vec4(object.roughness, float(object.kind), 0.0, 0.0);
#endif
}
