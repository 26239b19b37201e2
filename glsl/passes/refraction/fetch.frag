// The unit of cost that the bench counts in (glcaustics/bench/eye_cost.py): one rgba32f fetch and write a pixel.
uniform sampler2D t_source;
layout(location = 0) out vec4 o_color;

void main() {
    o_color = texelFetch(t_source, ivec2(gl_FragCoord.xy), 0);
}
