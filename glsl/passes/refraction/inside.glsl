// Opaque things within a closed solid, and walls and floors that its faces lie in: where a ray inside meets one before its way out, it
// ends there.

#define ENDS_INSIDE -2.0   // for `under` of a refracted ray

// Where a ray within a solid ends.
struct Ending {
    bool ends;         // on something opaque
    bool solved;       // false: a march must tell
    GlcSolve solve;    // where, along the ray that the solid's exit was looked for on
    float status;      // GLC_VIEW_*, of a hit
    float u;           // along that ray
};

const Ending NO_ENDING = Ending(false, true, GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_NOTHING, 0), GLC_VIEW_FALLBACK, 0.0);

#if OPAQUE_INSIDE
// A face that lies on a floor or a wall differs from it by rounding; then the opaque one counts. Of the depth, and of what the depth
// changes from pixel to pixel: as peeling takes them apart (gbuffer.frag).
const float TOUCHES_RELATIVE = 2e-5, TOUCHES_PIXELS = 0.25;
const float BEYOND_PX = 2.0;   // of way beyond the exit, to meet what lies on it

// Whether a point u of the ray lies within the solid, as far as the back faces tell that are stored where it is seen (beyond the
// picture: at its border, as planes). touches: on that face.
bool before_far(sampler2D t_far, GlcRasterRay ray, float u, out bool touches) {
    vec3 at = ray.start + u * ray.step;
    vec4 far = texelFetch(t_far, ivec2(clamp(at.xy, vec2(0.0), u_raster_size - 0.001)), 0);
    float gap = at.z - far.z - dot(far.xy, at.xy), room = TOUCHES_RELATIVE * abs(at.z) + TOUCHES_PIXELS * length(far.xy);
    touches = far.w > 0.0 && abs(gap) <= room;
    return far.w > 0.0 && gap >= -room;
}

// ray: from within; t_far: the solid's back faces; u_exit: where it would leave; found: that is known, not an estimate.
Ending ending_of(GlcRasterRay ray, sampler2D t_far, float u_exit, bool found) {
    Ending ending = NO_ENDING;
    ending.status = USE_MARCH + BEHIND > 0 ? GLC_VIEW_MARCHED : GLC_VIEW_NEWTON;
    float way = found ? min(u_exit + BEYOND_PX / max(max(abs(ray.step.x), abs(ray.step.y)), 1e-6), ray.u_screen) : ray.u_screen;
#if USE_MARCH || BEHIND
    GlcRasterRay part = ray;
    part.step *= max(way, 1e-6);
    part.u_screen = min(ray.u_screen / max(way, 1e-6), 1.0);
    bool in_view;
#if BEHIND
    ending.solve = glc_march_hierarchical(t_opaque_bounds, t_opaque_plane, part, u_refraction_steps, in_view);
#else
    ending.solve = MARCH(part, u_refraction_steps, in_view);
#if HAS_SECOND
    if (!in_view) look_behind(part, u_refraction_steps, ending.solve, ending.status);
#endif
#endif
    ending.solve.u *= way;
    ending.solve.u_front *= way;
    bool ended = ending.solve.status == GLC_SOLVE_NOTHING || ending.solve.status == GLC_SOLVE_HIDDEN;
    if (ended && way >= ray.u_screen && ray.u_screen < 1.0) ending.solve.status = GLC_SOLVE_OFFSCREEN;
#else
#if FINAL
    const float above = 0.0;
#else
    float above = glc_way_above(t_near, u_raster_size, ray);
#endif
    ending.solve = glc_newton_from(t_plane, ray, 1.0, min(above, way), RESTARTS == 1, u_refraction_iterations);
#if HAS_SECOND
    if (ending.solve.status != GLC_SOLVE_HIT) look_behind(ray, u_refraction_steps, ending.solve, ending.status);
#endif
#endif
    bool touches, hit = ending.solve.status == GLC_SOLVE_HIT, meets = hit;
    ending.u = ending.solve.u;
#if FINAL && !BEHIND
    // The last surface before the picture's border, or before the ray went behind something, goes on as a plane.
    Last last = last_surface(ray, ending.solve);
    if (!hit) ending.u = last.met;
    meets = hit || (last.meets && ending.solve.status != GLC_SOLVE_NOTHING);
#endif
    bool before = before_far(t_far, ray, ending.u, touches);
    ending.ends = meets && (found ? ending.u <= u_exit || touches : before);
#if !FINAL && !BEHIND
    float to = ending.ends ? ending.u : way;
    ending.solved = (found || ending.ends) && glc_way_clear(t_bounds, u_raster_size, ray, min(above, way), to, CLEAR_POINTS) >= to;
#endif
    return ending;
}
#endif
