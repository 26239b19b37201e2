// What the filter's passes share (Schied et al. 2017, "Spatiotemporal Variance-Guided Filtering", sec. 4).
#include "common/optics.glsl"

float svgf_luminance(vec3 c) {
    return dot(c, vec3(0.2126, 0.7152, 0.0722));
}

// False for NaN and Inf too: comparisons with NaN are false.
bool svgf_is_finite(vec4 v) {
    return all(lessThan(abs(v), vec4(1e30)));
}
