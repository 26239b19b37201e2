// The first layer's planes, where the second layer is drawn over them.
uniform sampler2D t_plane;
layout(location = 0) out vec4 o_plane;

void main() {
    o_plane = texelFetch(t_plane, ivec2(gl_FragCoord.xy), 0);
}
