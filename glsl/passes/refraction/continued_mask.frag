// A depth mask of the rays that go on behind a second specular surface (behind.glsl).
uniform sampler2D t_way;

void main() {
    gl_FragDepth = texelFetch(t_way, ivec2(gl_FragCoord.xy), 0).w != 0.0 ? 1.0 : 0.0;
}
