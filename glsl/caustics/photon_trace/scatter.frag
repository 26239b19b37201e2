// W/m^2 or lux; w: photons.
flat in vec4 v_irradiance;
layout(location = 0) out vec4 o_irradiance;

void main() {
    o_irradiance = v_irradiance;
}
