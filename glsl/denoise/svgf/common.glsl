// What the filter's passes share (Schied et al. 2017, "Spatiotemporal Variance-Guided Filtering", sec. 4).
#include "common/optics.glsl"

float svgf_luminance(vec3 c) {
    return dot(c, vec3(0.2126, 0.7152, 0.0722));
}

// Root of a^2 + b^2 for what is not negative, without squares, which 32 bits might not hold.
float svgf_hypotenuse(float a, float b) {
    float larger = max(a, b), ratio = min(a, b) / max(larger, 1e-30);
    return larger * sqrt(1.0 + ratio * ratio);
}

// False for NaN and Inf too: comparisons with NaN are false.
bool svgf_is_finite(vec4 v) {
    return all(lessThan(abs(v), vec4(1e30)));
}
