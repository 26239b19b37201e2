// One triangle over the picture at a depth that the test against a mask takes: the specular layer's depth buffer (empty pixels hold
// 1), or what is left to do (todo.frag).
uniform float u_mask_depth;
#include "interface/camera.glsl"

out vec2 v_uv;
out vec3 v_ray_ws;   // from the eye, one metre along the view axis: affine over the picture

void main() {
    v_uv = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    v_ray_ws = mat3(u_world_from_camera) * vec3(((v_uv - u_camera_jitter) * 2.0 - 1.0) * u_camera_lens.xy, -1.0);
    gl_Position = vec4(v_uv * 2.0 - 1.0, u_mask_depth * 2.0 - 1.0, 1.0);
}
