// The shadow map's view of one light.
#include "common/light_view.glsl"

uniform mat4 u_shadow_clip_from_world;
uniform vec2 u_shadow_size;
uniform float u_shadow_texel_measure;
uniform vec3 u_shadow_forward_ws;
uniform vec4 u_shadow_light;
uniform vec2 u_shadow_depth_range;   // near, far of a cube face, metres

GlcView glc_shadow_view() {
    return GlcView(u_shadow_clip_from_world, u_shadow_light, u_shadow_size, u_shadow_texel_measure, u_shadow_forward_ws, SHADOW_FACES);
}
