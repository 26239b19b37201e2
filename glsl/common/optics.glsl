// Geometric optics at one interface. Pure functions, no uniforms.
// Sources: Born & Wolf 1999, sec. 1.5 (Fresnel); Pharr, Jakob, Humphreys 2023 (pbrt-v4), ch. 9.3-9.5; Schlick 1994.

const float GLC_PI = 3.14159265358979;

// Cosine of refraction by Snell's law, 0 under total internal reflection. cos_i: of incidence, on the side the light comes from, in
// [0, 1]; eta = n_to / n_from.
float glc_cos_transmitted(float cos_i, float eta) {
    return sqrt(max(1.0 - (1.0 - cos_i * cos_i) / (eta * eta), 0.0));
}

// Unpolarised reflectance of a dielectric, 1 under total internal reflection. cos_t: as above.
float glc_fresnel_dielectric(float cos_i, float cos_t, float eta) {
    float r_parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    float r_perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    return cos_t > 0.0 ? 0.5 * (r_parallel * r_parallel + r_perpendicular * r_perpendicular) : 1.0;
}

// The same, where the cosine behind the surface is not at hand.
float glc_fresnel_dielectric(float cos_i, float eta) {
    cos_i = clamp(cos_i, 0.0, 1.0);
    return glc_fresnel_dielectric(cos_i, glc_cos_transmitted(cos_i, eta), eta);
}

// Reflectance of a metal as glTF 2.0 defines it (Schlick 1994): f0 is the base colour.
vec3 glc_fresnel_metal(vec3 f0, float cos_i) {
    float m = 1.0 - clamp(cos_i, 0.0, 1.0);
    float m2 = m * m;
    return f0 + (1.0 - f0) * (m2 * m2 * m);
}

// Snell refraction. d: unit direction of travel; n: unit normal against d (dot(n, d) <= 0); eta = n_to / n_from.
// Returns false under total internal reflection; then `transmitted` is the mirror direction.
bool glc_refract(vec3 d, vec3 n, float eta, out vec3 transmitted) {
    float cos_i = -dot(n, d);
    float k = 1.0 - (1.0 - cos_i * cos_i) / (eta * eta);
    if (k <= 0.0) {
        transmitted = reflect(d, n);
        return false;
    }
    transmitted = normalize(d / eta + n * (cos_i / eta - sqrt(k)));
    return true;
}

// Beer-Lambert transmittance (pbrt-v4, sec. 11.2) over distance_m metres; sigma_a in 1/m; 1 for distances below 0.
vec3 glc_transmittance(vec3 sigma_a, float distance_m) {
    return exp(-sigma_a * max(distance_m, 0.0));
}

// A vector of unit length, or `fallback` where v has none (normalize(0) is NaN).
vec3 glc_safe_normalize(vec3 v, vec3 fallback) {
    float l2 = dot(v, v);
    return l2 > 0.0 ? v * inversesqrt(l2) : fallback;
}

// A surface's normal as light meets it: unit, against d. At a silhouette an interpolated normal can turn away from the light that its
// triangle sees: there the light grazes it. n: unit normal; d: unit direction of travel.
vec3 glc_met_normal(vec3 n, vec3 d) {
    const float grazing = 0.02;   // least cosine between normal and light
    return glc_safe_normalize(n - d * max(grazing + dot(n, d), 0.0), -d);
}
