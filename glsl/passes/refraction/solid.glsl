// The way through a solid: exits on its back faces and, after total internal reflection, on its front faces too (Wyman 2005,
// with both solved by Newton's method).
uniform sampler2D t_front_plane;
uniform sampler2D t_back_plane;
uniform sampler2D t_back_normal;
#if CONTINUED
uniform sampler2D t_first_back_plane;    // of the first layer, where the others are the second one's
uniform sampler2D t_first_back_normal;
#endif
#if EXITS_UNDER
uniform sampler2D t_behind_plane;
uniform sampler2D t_behind_normal;
#endif

const int SOLID_ITERATIONS = 5;
#define CONTAINED -1.0   // for `under`: within another solid
// How far off its own surface a reflected ray starts, of the way to there: rounding must not put it behind.
const float REFLECTED_START = 2e-3;
const int REFLECTED_STEPS = 4;

// After a reflection the surface that the ray leaves says nothing of where it goes. Steps that treble, from a fifth of the way
// before the reflection (leg_m), bracket the exit: the ray between the last point inside and the first one outside. span: (first,
// last) of `ray`, in [0, 1].
GlcRasterRay solid_bracket(sampler2D t_layer, GlcRasterRay ray, float facing, float leg_m, out vec2 span) {
    span = vec2(0.0, 1.0);
    float distance_m = 0.2 * leg_m;
    for (int i = 0; i < REFLECTED_STEPS; ++i) {
        // The inverse of glc_raster_distance.
        float u = min(distance_m * ray.w.y / max(ray.length_m * ray.w.x - distance_m * (ray.w.x - ray.w.y), 1e-30), ray.u_screen);
        vec2 px = clamp(ray.start.xy + u * ray.step.xy, vec2(0.0), u_raster_size - 1.0);
        vec4 plane = texelFetch(t_layer, ivec2(px), 0);
        vec2 f = facing * glc_raster_plane(ray, plane);
        bool inside = plane.w > 0.0 && u * f.y >= f.x;
        span = inside ? vec2(u, span.y) : vec2(span.x, u);
        if (!inside || u >= ray.u_screen) break;
        distance_m *= 3.0;
    }
    GlcRasterRay part = ray;
    part.start = ray.start + span.x * ray.step;
    part.step = (span.y - span.x) * ray.step;
    part.u_screen = 1.0;
    return part;
}

// Where the ray leaves the solid, on the layer that it runs towards. leg_m: the way inside before a reflection, 0 on entry. n: unit,
// against the ray. False: an estimate.
bool solid_exit(vec3 p, vec3 d, float leg_m, out vec3 exit_ws, out vec3 n, out float t) {
    GlcRasterRay ray = eye_ray(p, d);
    bool away = ray.step.z < 0.0;   // s falls: the ray goes away from the eye
    GlcSolve solve;
    vec2 span = vec2(0.0, 1.0);
    GlcRasterRay part = ray;
    if (away) {
        if (leg_m > 0.0) part = solid_bracket(t_back_plane, ray, 1.0, leg_m, span);
        solve = glc_newton(t_back_plane, part, 1.0, SOLID_ITERATIONS);
    } else {
        if (leg_m > 0.0) part = solid_bracket(t_front_plane, ray, -1.0, leg_m, span);
        solve = glc_newton(t_front_plane, part, -1.0, SOLID_ITERATIONS);
    }
    // An unsolved exit (outlines, mostly) ends at the last point inside.
    float u = mix(span.x, span.y, solve.status == GLC_SOLVE_HIT ? solve.u : min(solve.u, solve.u_front));
    vec2 uv = clamp((ray.start.xy + u * ray.step.xy) / u_raster_size, vec2(0.0), vec2(1.0));
    vec3 stored = away ? textureLod(t_back_normal, uv, 0.0).xyz : texelFetch(t_specular_normal, ivec2(uv * u_raster_size * 0.99999), 0).xyz;
    n = glc_safe_normalize(stored, -d);
    if (dot(n, d) > 0.0) n = -n;
    t = glc_raster_distance(ray, u);
    exit_ws = p + t * d;
    return solve.status == GLC_SOLVE_HIT;
}

#if EXITS_UNDER
// A solid that floats: the interface behind the solid's front (behind.glsl) that a point lies below; 0 for none.
float interface_over(vec3 p) {
    vec4 q = u_raster_from_world * vec4(p, 1.0);
    vec2 px = clamp(q.xy / q.w, vec2(0.0), u_raster_size - 0.001);
    vec4 plane = texelFetch(t_behind_plane, ivec2(px), 0);
    float met = texelFetch(t_behind_normal, ivec2(px), 0).w;
    if (met <= 0.0 || q.z / q.w >= plane.z + dot(plane.xy, px)) return 0.0;
    return glc_object(int(met + 0.5) - 1).kind == GLC_INTERFACE ? met : 0.0;
}
#endif

#if CONTINUED && NESTED
// Whether a point within the first surface's solid, or behind that, lies within: a liquid leaves its glass where it ends.
bool within_first(vec3 p) {
    vec4 q = u_raster_from_world * vec4(p, 1.0);
    vec2 px = clamp(q.xy / q.w, vec2(0.0), u_raster_size - 0.001);
    vec4 plane = texelFetch(t_first_back_plane, ivec2(px), 0);
    return plane.w > 0.0 && q.z / q.w > plane.z + dot(plane.xy, px);
}
#endif

#if OPAQUE_INSIDE
// Whether the ray from p, within a solid that it would leave after exit_m, ends on something opaque. tint: to there.
bool ends_within(vec3 p, vec3 d, sampler2D t_far, float exit_m, bool found, vec3 sigma_a, inout vec3 tint, out Ending ending) {
    GlcRasterRay ray = eye_ray(p, d);
    ending = ending_of(ray, t_far, glc_raster_at(ray, exit_m), found);
    if (ending.ends) tint *= glc_transmittance(sigma_a, glc_raster_distance(ray, ending.u));
    return ending.ends;
}
#endif

#if CONTINUED && NESTED
// Out of the first surface's solid through its far side. ior: of what is around that, relative to it. False: it is held inside.
bool leave_first(inout vec3 p, inout vec3 d, float ior, vec3 sigma_a, inout vec3 tint, inout float under, inout Ending ending) {
    GlcRasterRay ray = eye_ray(p, d);
    GlcSolve solve = glc_newton(t_first_back_plane, ray, 1.0, SOLID_ITERATIONS);
    float u = solve.status == GLC_SOLVE_HIT ? solve.u : min(solve.u, solve.u_front), t = glc_raster_distance(ray, u);
#if OPAQUE_INSIDE
    if (ends_within(p, d, t_first_back_plane, t, solve.status == GLC_SOLVE_HIT, sigma_a, tint, ending)) {
        under = ENDS_INSIDE;
        return true;
    }
#endif
    vec2 uv = clamp((ray.start.xy + u * ray.step.xy) / u_raster_size, vec2(0.0), vec2(1.0));
    vec3 n = glc_safe_normalize(textureLod(t_first_back_normal, uv, 0.0).xyz, -d), bent;
    if (dot(n, d) > 0.0) n = -n;
    p += t * d;
    bool leaves = glc_refract(d, n, ior, bent);
    tint *= glc_transmittance(sigma_a, t) * (leaves ? (1.0 - glc_fresnel_dielectric(-dot(n, d), ior)) / (ior * ior) : 1.0);
    d = bent;
    return leaves;
}
#endif

// On entry d is the direction inside. tint takes Fresnel and absorption. Returns false where the light is still held inside after
// one total internal reflection; d is then the direction that it would go on in. leg_m: 0, or a length to bracket the exit from.
// ior: solid_ior relative to what the ray came from; so is outside, of what the solid stands in. under: object index + 1 of the
// interface that the exit lies below, 0 for none; before and after, CONTAINED within another solid; ENDS_INSIDE: where ending says, p and d
// are those of the ray within.
bool solid_through(
    inout vec3 p, inout vec3 d, float leg_m, float solid_ior, float ior, vec3 sigma_a, inout vec3 tint, inout float outside, inout float under,
    out Ending ending
) {
    ending = NO_ENDING;
    bool contained = under == CONTAINED;
    under = 0.0;
    for (int bounce = 0; bounce < 2; ++bounce) {
        vec3 exit_ws, n, bent;
        float t;
        bool found = solid_exit(p, d, leg_m, exit_ws, n, t);
#if OPAQUE_INSIDE
        bool solved = ending.solved;
        if (ends_within(p, d, t_back_plane, t, found, sigma_a, tint, ending)) {
            outside = ior;
            under = ENDS_INSIDE;
            return true;
        }
        ending.solved = ending.solved && solved;
#endif
        // The other side of the solid is often hidden after a reflection inside: then the mirrored direction alone goes on.
        if (!found && bounce > 0) return false;
        tint *= glc_transmittance(sigma_a, t);
#if CONTINUED && NESTED
        under = contained && within_first(exit_ws) ? CONTAINED : 0.0;
        if (under == CONTAINED) outside = 1.0;
#endif
#if EXITS_UNDER
        under = interface_over(exit_ws);
        if (under > 0.0) outside = ior * glc_object(int(under + 0.5) - 1).ior.g / solid_ior;
#endif
        bool leaves = glc_refract(d, n, outside / ior, bent);
        if (leaves) tint *= 1.0 - glc_fresnel_dielectric(-dot(n, d), outside / ior);
        p = leaves ? exit_ws : exit_ws + REFLECTED_START * t * bent;
        leg_m = t;
        d = bent;
        if (leaves) return true;
    }
    return false;
}
