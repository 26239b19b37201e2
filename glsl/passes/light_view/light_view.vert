// Geometry seen from a light: world position and normal.
in vec3 in_position;
in vec3 in_normal;

uniform mat4 u_world_from_object;
uniform mat3 u_normal_from_object;
uniform mat4 u_clip_from_world;

out vec3 v_position_ws;
out vec3 v_normal_ws;

void main() {
    vec4 position_ws = u_world_from_object * vec4(in_position, 1.0);
    v_position_ws = position_ws.xyz;
    v_normal_ws = u_normal_from_object * in_normal;
    gl_Position = u_clip_from_world * position_ws;
}
