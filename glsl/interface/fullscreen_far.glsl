// Vertex shader of a pass over the picture at the far plane, so that the test against a layer's depth buffer can pass over its empty
// pixels. One triangle; out: v_uv as in fullscreen.vert.
out vec2 v_uv;

void main() {
    v_uv = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(v_uv * 2.0 - 1.0, 1.0, 1.0);
}
