#include "common/raster_ray.glsl"

// Where a ray meets the surfaces of a G-buffer, by Newton's method (Mayer, Assarsson, Sintorn 2026, sec. 2): intersect the ray
// with the tangent plane of the sample, project, resample. One fetch an iteration: the buffer stores the tangent planes of its
// texels in raster space, so that a plane passes exactly through its texel's centre (snapped reconstruction).
// Beyond the paper: an iterate that leaves the bracket of points known in front of and behind the surfaces is replaced by
// bisection; a bracket of less than a pixel without a surface in it is a discontinuity; one that runs off the picture is told
// apart; and a sample counts only where the ray really crosses its plane from the front within a pixel of the texel's centre,
// so that objects beside or before the ray never leave ghosts.

#define GLC_SOLVE_HIT 1
#define GLC_SOLVE_OFFSCREEN 2       // the picture ends before a surface is met
#define GLC_SOLVE_DISCONTINUITY 3   // no surface within the bracket: an edge
#define GLC_SOLVE_DIVERGED 4        // out of iterations
#define GLC_SOLVE_NOTHING 5         // the ray's end is reached in front of every surface
#define GLC_SOLVE_HIDDEN 6          // the ray's end is reached behind a surface

struct GlcSolve {
    float u;           // along the ray; of the hit, or the best estimate
    float u_front;     // last known point in front of a surface
    vec2 texel;        // whose tangent plane was met
    float error_px;    // distance of the ray's point on the plane from the plane's texel, max norm
    int status;
    int iterations;    // texel look-ups
};

const float GLC_SOLVE_TOLERANCE_PX = 1.0;

// t_plane: rgba32f planes. facing: 1 for surfaces that the ray enters from the eye's side, -1 for those it leaves towards it.
// The loop holds one break, at its end, and no other branch: what failed is told apart after it. (A software renderer leaves a loop
// where its end is reached with no pixel left: a condition at its head costs one more turn, in which nothing happens.)
// u: where to look first. restarts: where the bracket closes without a surface, or the ray is behind one that it does not meet, the
// search goes on beyond that, where the last surface before it led to; pays from some six look-ups on, among thin things. Constants,
// facing and restarts cost nothing where they are not used.
GlcSolve glc_newton_from(sampler2D t_plane, GlcRasterRay ray, float facing, float u, bool restarts, int max_iterations) {
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_DIVERGED, 0);
    vec2 last = vec2(textureSize(t_plane, 0)) - 1.0;
    float front = 0.0, behind = 1.0, ahead = 0.0;
    float extent = max(abs(ray.step.x), abs(ray.step.y)), pixel = 1.0 / max(extent, 1e-6);
    bool hit = false;
    float first = u;
    for (;;) {
        vec2 texel = clamp(floor(ray.start.xy + u * ray.step.xy), vec2(0.0), last);
        vec2 f = facing * glc_raster_plane(ray, texelFetch(t_plane, ivec2(texel), 0));
        float met = f.y < 0.0 ? f.x / f.y : -1.0;
        vec2 off = abs(ray.start.xy + met * ray.step.xy - texel - 0.5);
        // A ray that does not meet the plane has no distance there.
        solve.error_px = met >= 0.0 && met <= 1.0 ? max(off.x, off.y) : 1e6;
        solve.iterations += 1;
        solve.texel = texel;
        hit = solve.error_px <= GLC_SOLVE_TOLERANCE_PX;
        bool before = u * f.y >= f.x;
        front = before ? u : front;
        solve.u_front = before ? u : solve.u_front;
        behind = before ? behind : u;
        bool inside = met > front - 1e-6 && met < behind + 1e-6;
        u = hit || inside ? met : 0.5 * (front + behind);
        if (restarts && !hit) {
            bool passed = !before && !inside && ahead > behind + pixel;
            ahead = before && !inside && met < 1.0 ? met : ahead;
            if (passed || behind - front < pixel) {
                front = behind;
                behind = 1.0;
                u = ahead > front ? ahead : min(front + 2.0 * pixel, 1.0);
            }
        }
        u = hit ? u : min(u, ray.u_screen);
        if (hit || solve.iterations >= max_iterations) break;
    }
    solve.u = u;
    if (hit) solve.status = GLC_SOLVE_HIT;
    else if (u >= ray.u_screen && ray.u_screen < 1.0) solve.status = GLC_SOLVE_OFFSCREEN;
    else if ((behind - front) * extent < 1.0) solve.status = GLC_SOLVE_DISCONTINUITY;
    if (max_iterations < 1) solve = GlcSolve(first, 0.0, vec2(0.0), 1e6, GLC_SOLVE_DIVERGED, 0);   // the start alone
    return solve;
}

// The same, from the ray's own pixel: the start of Mayer et al.
GlcSolve glc_newton(sampler2D t_plane, GlcRasterRay ray, float facing, int max_iterations) {
    return glc_newton_from(t_plane, ray, facing, 0.0, false, max_iterations);
}
