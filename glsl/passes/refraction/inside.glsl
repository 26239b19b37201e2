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
    vec2 px;           // of what it was in front of last; -1: nobody asks
};

const Ending NO_ENDING = Ending(false, true, GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_NOTHING, 0), GLC_VIEW_FALLBACK, 0.0, vec2(-1.0));

#if OPAQUE_INSIDE
// A face that lies on a floor or a wall differs from it by rounding, and where floor and wall meet by the pixel of slack that the
// solver grants each of them; then the opaque one counts. Of the depth, and of what that changes from pixel to pixel.
const float TOUCHES_RELATIVE = 2e-5, TOUCHES_PIXELS = 1.0;
const float BEYOND_PX = 2.0;   // of way beyond the exit, to meet what lies on it

// Whether a point u of the ray lies within the solid, as far as the back faces of a texel tell, as planes; unseen: what to say where
// something hides the solid. plane: of what is met; touches: it lies on that face.
bool before_far(sampler2D t_far, vec2 texel, vec4 plane, GlcRasterRay ray, float u, bool unseen, out bool touches) {
    vec3 at = ray.start + u * ray.step;
    vec4 far = texelFetch(t_far, ivec2(texel), 0);
    float gap = at.z - far.z - dot(far.xy, at.xy), room = TOUCHES_RELATIVE * abs(at.z) + TOUCHES_PIXELS * max(length(far.xy), length(plane.xy));
    touches = far.w > 0.0 && abs(gap) <= room;
    return far.w > 0.0 ? gap >= -room : unseen;
}

// ray: from within; t_far: the solid's back faces; u_exit: where it would leave; found: that is known, not an estimate.
Ending ending_of(GlcRasterRay ray, sampler2D t_far, float u_exit, bool found) {
    Ending ending = NO_ENDING;
    ending.status = USE_MARCH + BEHIND > 0 ? GLC_VIEW_MARCHED : GLC_VIEW_NEWTON;
    float way = found ? min(max(u_exit, 1e-6) + BEYOND_PX / max(max(abs(ray.step.x), abs(ray.step.y)), 1e-6), 1.0) : 1.0;
    GlcRasterRay part = ray;
    part.step *= way;
    part.u_screen = min(ray.u_screen / way, 1.0);
#if BEHIND
    ending.solve = glc_march_hierarchical(t_opaque_bounds, t_opaque_plane, part, u_refraction_steps);
#elif USE_MARCH
    bool in_view;
    ending.solve = MARCH(part, u_refraction_steps, in_view);
#if HAS_SECOND
    if (!in_view) look_behind(part, u_refraction_steps, ending.solve, ending.status);
#endif
#else
#if FINAL
    const float above = 0.0;
#else
    float above = min(glc_way_above(t_near, u_raster_size, ray), way);
#endif
    ending.solve = glc_newton_from(t_plane, part, 1.0, above / way, RESTARTS == 1, u_refraction_iterations);
#if HAS_SECOND
    if (ending.solve.status != GLC_SOLVE_HIT) look_behind(part, u_refraction_steps, ending.solve, ending.status);
#endif
#endif
    ending.solve.u *= way;
    ending.solve.u_front *= way;
    bool touches, hit = ending.solve.status == GLC_SOLVE_HIT, meets = hit;
    ending.u = ending.solve.u;
#if BEHIND
    vec4 plane = texelFetch(t_opaque_plane, ivec2(ending.solve.texel), 0);
#else
    vec4 plane = texelFetch(t_plane, ivec2(ending.solve.texel), 0);
#endif
#if FINAL && !BEHIND
    // The last surface before the picture's border, or before the ray went behind something, goes on as a plane.
    Last last = last_surface(ray, ending.solve, vec2(-1.0));
    if (!hit) {
        ending.u = last.met;
        plane = last.plane;
    }
    if (ending.solve.status == GLC_SOLVE_HIDDEN) ending.px = last.px;
    meets = hit || (last.meets && ending.solve.status != GLC_SOLVE_NOTHING);
#endif
    vec2 texel = hit ? ending.solve.texel : clamp(ray.start.xy + ending.u * ray.step.xy, vec2(0.0), u_raster_size - 0.001);
    bool before = before_far(t_far, texel, plane, ray, ending.u, !hit || ending.status == GLC_VIEW_SECOND, touches);
    ending.ends = meets && (found ? ending.u <= u_exit || touches : before);
#if !FINAL && !BEHIND
    float to = ending.ends ? ending.u : way;
    ending.solved = (found || ending.ends) && glc_way_clear(t_bounds, u_raster_size, ray, above, to, CLEAR_POINTS) >= to;
#endif
    return ending;
}
#endif
