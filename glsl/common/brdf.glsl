// Microfacet reflection for the highlights of receivers.
// Sources: Trowbridge & Reitz 1975 (GGX), Heitz 2014 (eq. 99, height-correlated Smith), glTF 2.0 appendix B.
#include "common/optics.glsl"

// Specular BRDF x cos(theta_l), 1/sr. n, v, l: unit, away from the surface; alpha = roughness^2.
vec3 glc_ggx_cos(vec3 n, vec3 v, vec3 l, vec3 f0, float alpha) {
    float n_dot_l = dot(n, l), n_dot_v = max(dot(n, v), 1e-4);
    if (n_dot_l <= 0.0) return vec3(0.0);
    vec3 h = glc_safe_normalize(v + l, n);
    float n_dot_h = clamp(dot(n, h), 0.0, 1.0);
    float a2 = max(alpha * alpha, 1e-4);
    float s = n_dot_h * n_dot_h * (a2 - 1.0) + 1.0;
    float distribution = a2 / (GLC_PI * s * s);
    float visibility = 0.5 / (n_dot_l * sqrt(n_dot_v * n_dot_v * (1.0 - a2) + a2) + n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - a2) + a2));
    return glc_fresnel_metal(f0, dot(h, v)) * (distribution * visibility * n_dot_l);
}
