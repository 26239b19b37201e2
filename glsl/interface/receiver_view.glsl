// The view of one light over the receivers.
#include "common/light_view.glsl"

uniform mat4 u_receiver_clip_from_world;
uniform vec2 u_receiver_size;
uniform float u_receiver_texel_measure;
uniform vec3 u_receiver_forward_ws;
uniform vec4 u_receiver_light;

GlcView glc_receiver_view() {
    return GlcView(u_receiver_clip_from_world, u_receiver_light, u_receiver_size, u_receiver_texel_measure, u_receiver_forward_ws, RECEIVER_FACES);
}
