// One triangle that covers the viewport, without any vertex buffer: draw 3 vertices.
// out: v_uv in [0, 1]^2 over the viewport, (0, 0) at the lower left, as texture coordinates of a texture drawn this way.

out vec2 v_uv;

void main() {
    v_uv = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(v_uv * 2.0 - 1.0, 0.0, 1.0);
}
