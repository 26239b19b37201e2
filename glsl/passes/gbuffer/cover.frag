// Keeps an object off the pixels where it is itself what stands in front (the second specular layer).
uniform sampler2D t_normal;
uniform float u_widest;   // object index + 1

void main() {
    if (abs(texelFetch(t_normal, ivec2(gl_FragCoord.xy), 0).w) != u_widest) discard;
    gl_FragDepth = 0.0;
}
