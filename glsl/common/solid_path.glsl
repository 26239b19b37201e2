#include "common/intersect.glsl"
#include "common/intersect_box.glsl"
#include "common/brdf.glsl"

// A ray's way through a solid that is known as front and back faces in a light's view (Wyman 2005; here refined by intersection,
// and followed through total reflections). Pure functions: the maps and the box around the solids are arguments.
// Points and directions: world space, metres; t_front, t_back: positions (rgba32f, w = 0: nothing) and t_..._normal: normals of the
// first front and back faces that `view` sees; lengths t_max in metres.

#define GLC_TIR -1
#define GLC_NO_EXIT -4
#define GLC_BETWEEN_FACETS -11   // scattered into the rough surface that it came from
#define GLC_LEAVES 0
#define GLC_STAYS 1

// Where a ray inside the solid leaves it: the stretch behind its front and before its back faces ends. Needed where the back faces
// alone give no answer, and after a total reflection, when the way out may be through the front.
GlcHit glc_leave_inside(sampler2D t_front, sampler2D t_front_normal, sampler2D t_back, sampler2D t_back_normal,
                        GlcView view, vec3 o, vec3 d, float t_max, int march_steps) {
    GlcHit hit = GlcHit(0.0, o, -d, 0, GLC_LEFT);
    t_max += 4.0 * glc_texel_width(view, o);   // where the solid fills its box, a texel still counts as inside at the box's face
    float t_in = 0.0;
    bool ends = false;
    float t = 0.0;
    GlcProbe front, back;
    for (int i = 1; i <= march_steps && !ends; ++i) {
        t = t_max * float(i) / float(march_steps);
        front = glc_probe(t_front, view, o + t * d, -t_max);
        back = glc_probe(t_back, view, o + t * d, -t_max);
        hit.iterations += 2;
        bool inside = front.valid && back.valid && front.gap <= 0.0 && back.gap >= 0.0;
        ends = !inside && (t_in > 0.0 || i > 1);  // the first step may still graze the surface that the ray comes from
        t_in = inside ? t : t_in;
    }
    if (!ends) return hit;
    float lo = t_in, hi = t;
    bool through_front = false;
    GlcProbe last = back;
    for (int k = 0; k < 10; ++k) {
        float mid = 0.5 * (lo + hi);
        front = glc_probe(t_front, view, o + mid * d, -t_max);
        back = glc_probe(t_back, view, o + mid * d, -t_max);
        if (!front.valid || !back.valid) { hi = mid; continue; }
        through_front = -front.gap < back.gap;
        last = through_front ? front : back;
        if (front.gap <= 0.0 && back.gap >= 0.0) lo = mid; else hi = mid;
    }
    hit.iterations += 20;
    hit.t = hi;
    bool settled = false;
    if (last.valid) {
        if (through_front) settled = glc_settle(glc_probe_normal(t_front_normal, last, d), view, last, o, d, 2.0 * GLC_REACH, hit);
        else settled = glc_settle(glc_probe_normal(t_back_normal, last, d), view, last, o, d, 2.0 * GLC_REACH, hit);
    }
    if (settled) hit.status = GLC_BRACKETED;
    return hit;
}

// What light inside does where it meets the surface: it leaves (GLC_LEAVES) or is thrown back (GLC_STAYS), and `ray` is turned, `flux`
// scaled; or GLC_BETWEEN_FACETS. n: unit normal of the surface against the ray; alpha > 0: rough, a microfacet's normal (brdf.glsl) for xi.
int glc_meet_from_inside(vec3 n, float ior, float alpha, vec2 xi, inout vec3 ray, inout vec3 flux) {
    vec3 facet = alpha > 0.0 ? glc_ggx_visible_normal(n, -ray, alpha, xi) : n;
    vec3 outside;
    float reflected_share = glc_fresnel_dielectric(-dot(facet, ray), 1.0 / ior);
    bool leaves = glc_refract(ray, facet, 1.0 / ior, outside);  // else the mirror direction
    ray = outside;
    if (alpha > 0.0) {
        float cos_out = dot(ray, n) * (leaves ? -1.0 : 1.0);
        if (cos_out <= 0.0) return GLC_BETWEEN_FACETS;
        flux *= glc_ggx_visible_share(cos_out, alpha);
    }
    if (!leaves) return GLC_STAYS;
    flux *= 1.0 - reflected_share;
    return GLC_LEAVES;
}

// Sub-texel normal of a back face, against the ray: bilinear over the stored ones; empty texels are zero and drop out of the sum.
vec3 glc_back_normal(sampler2D t_back_normal, GlcView view, GlcHit exit) {
    return -glc_safe_normalize(textureLod(t_back_normal, glc_view_project(view, exit.position_ws).xy / view.size, 0.0).xyz, exit.normal_ws);
}
