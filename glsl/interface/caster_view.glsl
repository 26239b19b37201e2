// The view of one light over the casters.
#include "common/light_view.glsl"

uniform mat4 u_caster_clip_from_world;
uniform vec2 u_caster_size;
uniform float u_caster_texel_measure;
uniform vec3 u_caster_forward_ws;
uniform vec4 u_caster_light;

GlcView glc_caster_view() {
    return GlcView(u_caster_clip_from_world, u_caster_light, u_caster_size, u_caster_texel_measure, u_caster_forward_ws, CASTER_FACES);
}
