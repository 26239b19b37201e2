// Microfacets: highlights of receivers, and light scattered by rough specular surfaces.
// Sources: Trowbridge & Reitz 1975 (GGX), Heitz 2014 (eq. 99, height-correlated Smith), glTF 2.0 appendix B; Walter et al. 2007
// (refraction, separable masking); Heitz 2018 (visible normals), drawn by spherical caps (Dupuy & Benyoub 2023); Duff et al. 2017.
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

// Two tangents of a unit normal, right-handed: t x b = n.
void glc_tangents(vec3 n, out vec3 t, out vec3 b) {
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z), c = n.x * n.y * a;
    t = vec3(1.0 + s * n.x * n.x * a, s * c, -s * n.x);
    b = vec3(c, s + n.y * n.y * a, -n.y);
}

// Share of the microfacets facing a direction that it sees (Smith), cos_n: its cosine with the normal, in (0, 1].
float glc_ggx_visible_share(float cos_n, float alpha) {
    float c2 = cos_n * cos_n;
    return 2.0 * cos_n / (cos_n + sqrt(c2 + alpha * alpha * (1.0 - c2)));
}

// A microfacet's normal as often as v sees it. n, v: unit, dot(n, v) > 0; xi in [0, 1)^2. Light from v about it has then to be weighted
// with Fresnel's share at the microfacet and glc_ggx_visible_share of the way out: D, G(v) and the cosines cancel.
vec3 glc_ggx_visible_normal(vec3 n, vec3 v, float alpha, vec2 xi) {
    vec3 t, b;
    glc_tangents(n, t, b);
    vec3 w = normalize(vec3(alpha * dot(v, t), alpha * dot(v, b), dot(v, n)));   // v as the hemisphere sees it that alpha stretches
    float phi = 2.0 * GLC_PI * xi.x;
    float z = (1.0 - xi.y) * (1.0 + w.z) - w.z;
    float r = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    vec3 h = vec3(r * cos(phi), r * sin(phi), z) + w;
    return normalize(t * (alpha * h.x) + b * (alpha * h.y) + n * max(h.z, 1e-6));
}
