// Percentage-closer filtering over 5x5 texels in nine hardware-filtered taps (Reeves, Salesin, Cook 1987; weights of Castano 2013).
// Pure, no uniforms. t_shadow: depth with compare and linear filter; texel: coordinates in texels of the map; depth: in [0, 1], as the
// map stores it; lower, upper: bounds in texels that no tap may leave (a face of an atlas). Returns the lit share, in [0, 1].
float glc_shadow_pcf(sampler2DShadow t_shadow, vec2 texel, float depth, vec2 lower, vec2 upper) {
    vec2 inverse_size = 1.0 / vec2(textureSize(t_shadow, 0));
    vec2 base = floor(texel + 0.5);
    vec2 st = texel + 0.5 - base;
    base -= 0.5;
    vec3 uw = vec3(4.0 - 3.0 * st.x, 7.0, 1.0 + 3.0 * st.x);
    vec3 u = vec3((3.0 - 2.0 * st.x) / uw.x - 2.0, (3.0 + st.x) / uw.y, st.x / uw.z + 2.0);
    vec3 vw = vec3(4.0 - 3.0 * st.y, 7.0, 1.0 + 3.0 * st.y);
    vec3 v = vec3((3.0 - 2.0 * st.y) / vw.x - 2.0, (3.0 + st.y) / vw.y, st.y / vw.z + 2.0);
    float sum = 0.0;
    for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) {
            vec2 at = clamp(base + vec2(u[i], v[j]), lower, upper);
            sum += uw[i] * vw[j] * texture(t_shadow, vec3(at * inverse_size, depth));
        }
    return sum / 144.0;
}
