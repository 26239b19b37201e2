// A depth mask of what the first stage has left to do, from the radiance's alpha: GLC_TODO_* of outputs.glsl.
uniform sampler2D t_radiance;

void main() {
    gl_FragDepth = texelFetch(t_radiance, ivec2(gl_FragCoord.xy), 0).a;
}
