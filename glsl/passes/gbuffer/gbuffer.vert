// Geometry seen from the camera.
in vec3 in_position;
#if HAS_NORMAL
in vec3 in_normal;
#endif
#if HAS_UV
in vec2 in_uv;
#endif

uniform mat4 u_world_from_object;
uniform mat4 u_clip_from_world;
uniform mat4 u_camera_from_world;
#if HAS_NORMAL
uniform mat3 u_normal_from_object;
out vec3 v_normal_ws;
#endif
#if HAS_UV
out vec2 v_uv;
#endif
#if HAS_MOTION
uniform mat4 u_previous_clip_from_object;
#if HAS_PREVIOUS_POSITION
in vec3 in_previous_position;   // of a mesh that changed since the last frame
#endif
out vec4 v_clip;
out vec4 v_previous_clip;
#endif
out float v_depth_m;
out vec3 v_position_ws;

void main() {
    vec4 position_ws = u_world_from_object * vec4(in_position, 1.0);
    v_position_ws = position_ws.xyz;
    v_depth_m = -(u_camera_from_world * position_ws).z;
    gl_Position = u_clip_from_world * position_ws;
#if HAS_NORMAL
    v_normal_ws = u_normal_from_object * in_normal;
#endif
#if HAS_UV
    v_uv = in_uv;
#endif
#if HAS_MOTION
    v_clip = gl_Position;
#if HAS_PREVIOUS_POSITION
    v_previous_clip = u_previous_clip_from_object * vec4(in_previous_position, 1.0);
#else
    v_previous_clip = u_previous_clip_from_object * vec4(in_position, 1.0);
#endif
#endif
}
