// Light's way through solids, from the first interface until it is in the open for good. LAYERS 1: one pair of front and back faces, and
// one solid. LAYERS 2: two pairs, and on through other parts and other solids. RECEIVERS_INSIDE 1: opaque surfaces may lie in solids.
// ROUGH 1: surfaces may scatter the light (GGX).
#include "common/solid_path.glsl"
#if LAYERS == 2
#include "caustics/shared/solid_layers.glsl"
#endif
#if ROUGH
#include "common/sampling.glsl"
#endif

uniform vec3 u_caster_min_ws;      // box around the solids
uniform vec3 u_caster_max_ws;
uniform int u_internal_bounces;    // total reflections that are followed in one solid

#define GLC_LANDED 1

#if LAYERS == 2
const int MORE_SOLIDS = 4;         // that are entered after the first; light goes on through what comes after them
#else
const int MORE_SOLIDS = 0;
#endif

struct SolidWay {
    vec3 p_ws;
    vec3 ray;
    vec3 flux;
    float object;      // number + 1 of the solid that it is in
    vec3 sigma_a;      // of that solid, 1/m
    float ior;
    float alpha;       // of its surface (brdf.glsl); 0: smooth
    vec2 xi;           // in [0, 1), for the facet that is met next; drawn afresh there
    int reflections;   // total reflections so far
    int solids;        // entered after the first
    float iterations;
    GlcHit landed;     // on a receiver between or in solids
};

// Where light inside meets the surface next. `first`: it has just come in through the first front face.
GlcHit solid_exit(GlcView view, SolidWay way, bool first, float t_max) {
    GlcHit exit = GlcHit(0.0, way.p_ws, -way.ray, 0, GLC_LEFT);
    if (first) {
        exit = glc_intersect(t_back_position, t_back_normal, view, way.p_ws, way.ray, t_max, ESTIMATE, u_max_iterations, 0);
        float object = texelFetch(t_back_position, ivec2(glc_view_project(view, exit.position_ws).xy), 0).w;
        if (object != 0.0 && object != way.object) exit.status = GLC_LEFT;  // another solid's
        if (exit.status > 0) exit.normal_ws = -glc_back_normal(t_back_normal, view, exit);
    }
    if (exit.status > 0) return exit;
    int iterations = exit.iterations;
#if LAYERS == 2
    exit = leave_layers(view, way.object, way.p_ws, way.ray, t_max, u_march_steps);
#else
    exit = glc_leave_inside(t_caster_position, t_caster_normal, t_back_position, t_back_normal, view, way.p_ws, way.ray, t_max, u_march_steps);
#endif
    exit.iterations += iterations;
    return exit;
}

#if ROUGH
// Two numbers in [0, 1) for the facet that is met now. The next ones are hashed: shifted copies would tie each lobe to the one before.
vec2 next_facet(inout SolidWay way) {
    vec2 xi = way.xi;
    way.xi = glc_unit_floats(glc_pcg3d(uvec3(floatBitsToUint(xi), 1u))).xy;
    return xi;
}
#endif

// Light inside meets the surface of unit normal n, against the ray. Returns as glc_meet_from_inside.
int meet_from_inside(vec3 n, inout SolidWay way) {
#if ROUGH
    return glc_meet_from_inside(n, way.ior, way.alpha, next_facet(way), way.ray, way.flux);
#else
    return glc_meet_from_inside(n, way.ior, 0.0, vec2(0.0), way.ray, way.flux);
#endif
}

#if LAYERS == 2
// Light in the open goes into another solid, its number + 1, through a surface of unit normal n, against the ray. False: it is lost
// between facets.
bool go_into(float object, vec3 n, inout SolidWay way) {
    GlcObject next = glc_object(int(object + 0.5) - 1);
    vec3 facet = n;
    way.object = object;
    way.sigma_a = next.sigma_a;
    way.ior = next.ior[u_channel];
    ++way.solids;
#if ROUGH
    way.alpha = next.roughness * next.roughness;
    vec2 xi = next_facet(way);
    if (way.alpha > 0.0) facet = glc_ggx_visible_normal(n, -way.ray, way.alpha, xi);
#endif
    way.flux *= (1.0 - glc_fresnel_dielectric(-dot(facet, way.ray), way.ior)) * next.transmission;
    glc_refract(way.ray, facet, way.ior, way.ray);
#if ROUGH
    if (way.alpha > 0.0) {
        float cos_in = -dot(way.ray, n);
        if (cos_in <= 0.0) return false;
        way.flux *= glc_ggx_visible_share(cos_in, way.alpha);
    }
#endif
    return true;
}
#endif

// Whether the light lands on an opaque surface before it has gone t metres, the end of its way in or between solids. `touches`: that
// surface lies just behind the end, within a texel; then the light leaves the solid first.
bool lands_within(GlcView view, GlcView receiver_view, float t, inout SolidWay way, out bool touches) {
    float air = glc_texel_width(view, way.p_ws);
    way.landed = glc_intersect(t_receiver_position, t_receiver_normal, receiver_view, way.p_ws, way.ray, t + air, ESTIMATE, u_max_iterations, u_march_steps);
    way.iterations += float(way.landed.iterations);
    touches = way.landed.status > 0 && way.landed.t >= t;
    return way.landed.status > 0 && way.landed.t < t;
}

// Where the solid touches a receiver, rounding may have put the exit behind it.
int in_the_open(GlcView view, inout SolidWay way) {
    way.p_ws -= way.ray * glc_texel_width(view, way.p_ws);
    return 0;
}

// Returns 0: in the open, to where nothing but receivers is met; GLC_LANDED; or why the light is lost.
int pass_solids(GlcView view, GlcView receiver_view, inout SolidWay way) {
    bool inside = true;
    int left_reflections = u_internal_bounces;
    int segments = (2 + u_internal_bounces) * (1 + MORE_SOLIDS);
    for (int i = 0; i < segments; ++i) {
        float t_max = glc_box_exit(way.p_ws, way.ray, u_caster_min_ws, u_caster_max_ws);
        GlcHit end;
        float object = 0.0;
        if (inside) end = solid_exit(view, way, i == 0, t_max);
#if LAYERS == 2
        else end = enter_layers(view, way.p_ws, way.ray, t_max, ESTIMATE, u_max_iterations, u_march_steps, object);
#endif
        way.iterations += float(end.iterations);
        bool found = end.status > 0;
        if (!inside && !found) return in_the_open(view, way);
        bool touches = false;
#if LAYERS == 2 || RECEIVERS_INSIDE
        if ((RECEIVERS_INSIDE == 1 || !inside) && lands_within(view, receiver_view, found ? end.t : t_max, way, touches)) {
            if (inside) way.flux *= glc_transmittance(way.sigma_a, way.landed.t);
            return GLC_LANDED;
        }
#endif
        if (!found) return GLC_NO_EXIT;
        vec3 n = end.normal_ws;
        if (dot(n, way.ray) > 0.0) n = -n;
        way.p_ws = end.position_ws;
        if (inside) {
            way.flux *= glc_transmittance(way.sigma_a, end.t);
            int met = meet_from_inside(n, way);
#if ROUGH
            if (met == GLC_BETWEEN_FACETS) return met;
#endif
            inside = met == GLC_STAYS;
            if (inside && left_reflections-- == 0) return GLC_TIR;
            if (inside) ++way.reflections;
            else if (touches) return GLC_LANDED;
            else if (way.solids == MORE_SOLIDS) return in_the_open(view, way);
        }
#if LAYERS == 2
        else {
            if (!go_into(object, n, way)) return GLC_BETWEEN_FACETS;
            left_reflections = u_internal_bounces;
            inside = true;
        }
#endif
    }
    return GLC_TIR;
}
