// A depth mask of what the first stage has left to do: GLC_TODO_* of outputs.glsl.
uniform sampler2D t_todo;

void main() {
    gl_FragDepth = texelFetch(t_todo, ivec2(gl_FragCoord.xy), 0).r;
}
