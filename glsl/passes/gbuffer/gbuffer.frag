// The camera's G-buffer: opaque layer, (PEEL) the opaque layer behind it, specular layer or (BACK) the specular layer's back
// faces. Only attachments that some pass reads exist (HAS_...). LAYER_SPECULAR keeps what lies in front of the opaque layer.
// Source of peeling: Everitt 2001; here with a tolerance that follows the first surface's slope. OTHER peels specular layers by object:
// of the other objects, what is nearest behind the first surface.
#include "common/optics.glsl"
#if HAS_ALBEDO || HAS_MATERIAL || HAS_EMISSIVE
#include "interface/objects.glsl"
#endif

in float v_depth_m;
in vec3 v_position_ws;
#if HAS_NORMAL
in vec3 v_normal_ws;
#endif
#if HAS_UV
in vec2 v_uv;
#endif
#if HAS_MOTION
in vec4 v_clip;
in vec4 v_previous_clip;
#endif

uniform float u_object;
uniform vec3 u_eye_ws;
uniform vec4 u_eye_direction;   // w = 1: orthographic, xyz = view direction
#if LAYER_SPECULAR
uniform sampler2D t_opaque_depth_m;
#endif
#if PEEL
uniform sampler2D t_first_plane;
#endif
#if BACK
uniform sampler2D t_front_depth_m;
#endif
#if BACK || OTHER
uniform sampler2D t_front_normal;
#endif
#if HAS_BASE_COLOR_MAP
uniform sampler2D t_base_color;   // sRGB images are decoded by the texture unit, before filtering
#endif
#if HAS_METALLIC_ROUGHNESS_MAP
uniform sampler2D t_metallic_roughness;
#endif
#if HAS_EMISSIVE_MAP
uniform sampler2D t_emissive;
#endif

#if HAS_DEPTH_M
layout(location = LOCATION_DEPTH_M) out float o_depth_m;       // along the view axis, metres; 0 = nothing
#endif
#if HAS_NORMAL_WS
layout(location = LOCATION_NORMAL_WS) out vec4 o_normal_ws;    // towards the eye; w: object index + 1, negative: seen from its back
#endif
#if HAS_ALBEDO
layout(location = LOCATION_ALBEDO) out vec4 o_albedo;          // base colour, linear; w: metallic
#endif
#if HAS_MATERIAL
layout(location = LOCATION_MATERIAL) out vec4 o_material;      // x: roughness
#endif
#if HAS_EMISSIVE
layout(location = LOCATION_EMISSIVE) out vec4 o_emissive;      // radiance, cd/m^2 or W/(m^2 sr)
#endif
#if HAS_MOTION
layout(location = LOCATION_MOTION) out vec2 o_motion;          // uv now - uv in the last frame
#endif
#if HAS_PLANE
layout(location = LOCATION_PLANE) out vec4 o_plane;            // tangent plane in raster space (common/raster_ray.glsl): g, c; w: depth
#endif

#if PEEL
const float PEEL_RELATIVE = 2e-5, PEEL_PIXELS = 0.25;
#endif

void main() {
#if HAS_PLANE
    // Derivatives before any discard. The triangle's own plane: smooth normals would not agree with the depths beside it.
    float s = u_eye_direction.w == 1.0 ? -v_depth_m : gl_FragCoord.w;
    vec2 g = vec2(dFdx(s), dFdy(s));
    o_plane = vec4(g, s - dot(g, gl_FragCoord.xy), v_depth_m);
#endif
#if LAYER_SPECULAR
    float opaque_m = texelFetch(t_opaque_depth_m, ivec2(gl_FragCoord.xy), 0).r;
    if (opaque_m > 0.0 && v_depth_m >= opaque_m) discard;
#endif
#if PEEL
    // Behind the first surface by more than rounding and a quarter of what its depth changes from pixel to pixel.
    vec4 first = texelFetch(t_first_plane, ivec2(gl_FragCoord.xy), 0);
    float slope_m = length(first.xy) * (u_eye_direction.w == 1.0 ? 1.0 : first.w * first.w);
    if (first.w <= 0.0 || v_depth_m <= first.w * (1.0 + PEEL_RELATIVE) + PEEL_PIXELS * slope_m) discard;
#endif
#if OTHER
    if (abs(texelFetch(t_front_normal, ivec2(gl_FragCoord.xy), 0).w) == u_object + 1.0) discard;
#endif
#if BACK
    if (v_depth_m <= texelFetch(t_front_depth_m, ivec2(gl_FragCoord.xy), 0).r) discard;
    if (abs(texelFetch(t_front_normal, ivec2(gl_FragCoord.xy), 0).w) != u_object + 1.0) discard;
#endif
#if HAS_DEPTH_M
    o_depth_m = v_depth_m;
#endif
#if HAS_NORMAL_WS
    vec3 view = u_eye_direction.w == 1.0 ? u_eye_direction.xyz : normalize(v_position_ws - u_eye_ws);
    vec3 n = glc_safe_normalize(v_normal_ws, -view) * (gl_FrontFacing ? 1.0 : -1.0);
    o_normal_ws = vec4(n, (u_object + 1.0) * (gl_FrontFacing ? 1.0 : -1.0));
#endif
#if HAS_ALBEDO || HAS_MATERIAL
    vec4 t0 = texelFetch(t_objects, ivec2(0, int(u_object)), 0);
    float roughness = texelFetch(t_objects, ivec2(1, int(u_object)), 0).w;
    float metallic = texelFetch(t_objects, ivec2(3, int(u_object)), 0).w;
    vec3 albedo = t0.rgb;
#if HAS_BASE_COLOR_MAP
    albedo *= texture(t_base_color, v_uv).rgb;
#endif
#if HAS_METALLIC_ROUGHNESS_MAP
    vec4 mr = texture(t_metallic_roughness, v_uv);
    roughness *= mr.g;
    metallic *= mr.b;
#endif
#if HAS_ALBEDO
    o_albedo = vec4(albedo, metallic);
#endif
#if HAS_MATERIAL
    o_material = vec4(roughness, 0.0, 0.0, 0.0);
#endif
#endif
#if HAS_EMISSIVE
    vec3 emissive = texelFetch(t_objects, ivec2(3, int(u_object)), 0).rgb;
#if HAS_EMISSIVE_MAP
    emissive *= texture(t_emissive, v_uv).rgb;
#endif
    o_emissive = vec4(emissive, 0.0);
#endif
#if HAS_MOTION
    // What stood behind the eye in the last frame has no place in its picture.
    vec2 before = v_previous_clip.w > 0.0 ? v_previous_clip.xy / v_previous_clip.w : vec2(0.0);
    o_motion = clamp(0.5 * (v_clip.xy / v_clip.w - before), -8.0, 8.0);
#endif
}
