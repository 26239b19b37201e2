// Flux per texel of the map: flux of the vertex's texel / landed area, by the interpolated signed determinant.
in vec4 v_flux_det;
flat in vec2 v_density;

layout(location = 0) out vec4 o_flux;  // W or lm; additive

void main() {
    o_flux = vec4(v_flux_det.rgb * (min(1.0 / max(abs(v_flux_det.w), 1e-12), v_density.x) * v_density.y), 0.0);
}
