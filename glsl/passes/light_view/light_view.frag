// Position and normal of the first surface seen from a light. position.w = object index + 1 (0: nothing there);
// normal.w: positive on the front of the triangle, negative on its back; |w| - 1 = change of the normal over one texel. The normal is the mesh's own, not turned to the light.
// OCCLUDER 1: opaque geometry in the way, stored as nothing. CLIP 1: a half-space is cut away. BACK 1: the first back face of the same object behind its front; BACK 2: of any object.
#include "common/optics.glsl"

in vec3 v_position_ws;
in vec3 v_normal_ws;

#if !OCCLUDER
uniform float u_object;
#endif
#if BACK
uniform sampler2D t_front_position;
uniform vec4 u_light;
#endif

#if CLIP
uniform vec4 u_clip_plane;   // world space; what lies on its negative side is not drawn
#endif

#if HAS_PLANE
uniform mat4 u_raster_from_world;   // of this face: see common/raster_ray.glsl
#endif

#if HAS_POSITION
layout(location = LOCATION_POSITION) out vec4 o_position_ws;
#endif
#if HAS_NORMAL
layout(location = LOCATION_NORMAL) out vec4 o_normal_ws;
#endif
#if HAS_PLANE
layout(location = LOCATION_PLANE) out vec4 o_plane;   // tangent plane in raster space (common/raster_ray.glsl): g, c; w: depth
#endif

void main() {
#if HAS_PLANE
    // Derivatives before any discard. The triangle's own plane: smooth normals would not agree with the depths beside it.
    vec4 raster = u_raster_from_world * vec4(v_position_ws, 1.0);
    float s = raster.z / raster.w;
    vec2 g = vec2(dFdx(s), dFdy(s));
    o_plane = vec4(g, s - dot(g, gl_FragCoord.xy), s > 0.0 ? raster.w : -s);
#endif
#if CLIP
    if (dot(u_clip_plane, vec4(v_position_ws, 1.0)) < 0.0) discard;
#endif
#if OCCLUDER
    vec4 position = vec4(0.0), normal = vec4(0.0);
#else
    vec4 position = vec4(v_position_ws, u_object + 1.0);
    vec3 n = glc_safe_normalize(v_normal_ws, vec3(0.0));
    float bend = min(max(length(dFdx(n)), length(dFdy(n))), 1.0);
    vec4 normal = vec4(n, gl_FrontFacing ? 1.0 + bend : -1.0 - bend);
#endif
#if BACK
    vec4 front = texelFetch(t_front_position, ivec2(gl_FragCoord.xy), 0);
#if BACK == 2
    if (front.w == 0.0) discard;
#else
    if (front.w != position.w) discard;
#endif
    vec3 d = v_position_ws - front.xyz;
    vec3 l = u_light.w == 0.0 ? u_light.xyz : v_position_ws - u_light.xyz;
    if (dot(d, l) <= 0.0) discard;
#endif
#if HAS_POSITION
    o_position_ws = position;
#endif
#if HAS_NORMAL
    o_normal_ws = normal;
#endif
}
