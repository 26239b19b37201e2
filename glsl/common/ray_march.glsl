#include "common/newton.glsl"

// Marching a ray over a G-buffer, pixel by pixel (McGuire & Mara 2014) and over a chain of depth bounds (Uludag 2014). Both find
// the first texel whose tangent plane the ray crosses from the front within the texel (1 px of slack), so they and Newton's method
// answer one question. Differences from the published marchers: affine depth instead of a quotient a step, `floor` to texels, a
// stop as soon as the ray ends or leaves, no thickness in metres: planes tell a surface from an edge.

// Tries the surface near u: two Newton steps, accepted within reach_px of where the march saw it.
bool glc_march_settle(sampler2D t_plane, GlcRasterRay ray, float reach, inout GlcSolve solve) {
    float u = solve.u;
    vec2 last = vec2(textureSize(t_plane, 0)) - 1.0;
    for (int i = 0; i < 2; ++i) {
        vec2 texel = clamp(floor(ray.start.xy + u * ray.step.xy), vec2(0.0), last);
        vec2 f = glc_raster_plane(ray, texelFetch(t_plane, ivec2(texel), 0));
        float met = f.x / (f.y < 0.0 ? f.y : -1e-30);
        vec2 off = abs(ray.start.xy + met * ray.step.xy - texel - 0.5);
        bool crosses = f.y < 0.0 && met >= 0.0 && met <= 1.0;
        solve.error_px = crosses ? max(off.x, off.y) : 1e6;
        if (!crosses || abs(met - solve.u) > reach) return false;
        if (solve.error_px <= GLC_SOLVE_TOLERANCE_PX) {
            solve.u = met;
            solve.texel = texel;
            solve.status = GLC_SOLVE_HIT;
            return true;
        }
        u = met;
    }
    return false;
}

// One step a pixel of the longer axis. t_depth: r32f depth in metres, 0 = nothing.
GlcSolve glc_march_dda(sampler2D t_depth, sampler2D t_plane, bool orthographic, GlcRasterRay ray, int max_steps) {
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_NOTHING, 0);
    float pixels = max(max(abs(ray.step.x), abs(ray.step.y)) * ray.u_screen, 1.0);
    float du = ray.u_screen / pixels;
    vec2 last = vec2(textureSize(t_depth, 0)) - 1.0;
    int count = min(int(ceil(pixels)), max_steps);
    bool front = true;
    vec3 p = ray.start;
    int i = 0;
    for (int candidate = 0; candidate < 8 && i <= count; ++candidate) {
        bool was_front = front;
        for (; i <= count; ++i) {
            was_front = front;
            solve.u = min(float(i) * du, ray.u_screen);
            p = ray.start + solve.u * ray.step;
            float depth_m = texelFetch(t_depth, ivec2(clamp(floor(p.xy), vec2(0.0), last)), 0).r;
            front = depth_m <= 0.0 || (orthographic ? -p.z < depth_m : p.z * depth_m > 1.0);
            if (front) solve.u_front = solve.u;
            if (was_front && !front) break;
        }
        solve.iterations = i;
        if (i > count) break;
        if (glc_march_settle(t_plane, ray, 2.5 * du, solve)) return solve;
        i += 1;
    }
    if (ray.u_screen < 1.0) solve.status = GLC_SOLVE_OFFSCREEN;
    else if (!front) solve.status = GLC_SOLVE_HIDDEN;
    return solve;
}

// Over bounds of s: t_bounds_4, t_bounds_16: rg32f, largest and smallest s of 4 x 4 and 16 x 16 texels.
GlcSolve glc_march_hierarchical(sampler2D t_bounds_4, sampler2D t_bounds_16, sampler2D t_plane, GlcRasterRay ray, int max_steps) {
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_NOTHING, 0);
    vec2 last = vec2(textureSize(t_plane, 0)) - 1.0;
    vec2 inverse = 1.0 / mix(ray.step.xy, vec2(1e-6), lessThan(abs(ray.step.xy), vec2(1e-6)));
    vec2 ahead = vec2(greaterThan(inverse, vec2(0.0)));
    float extent = max(max(abs(ray.step.x), abs(ray.step.y)), 1e-6);
    float nudge = 0.02 / extent, slack = 0.5 / extent;
    float cell = 4.0, u = 0.0;
    bool behind = false;
    solve.status = GLC_SOLVE_DIVERGED;
    for (int i = 0; i < max_steps; ++i) {
        vec2 px = clamp(ray.start.xy + u * ray.step.xy, vec2(0.0), last + 0.999);
        vec2 index = floor(px / cell);
        vec2 leaves = ((index + ahead) * cell - ray.start.xy) * inverse;
        float u_exit = min(max(min(leaves.x, leaves.y), u) + nudge, 1.0);
        vec2 s = vec2(ray.start.z + u * ray.step.z, ray.start.z + u_exit * ray.step.z);
        bool over = false, under = false;   // in front of all of the cell; behind all of it
        solve.iterations = i + 1;
        if (cell > 1.0) {
            vec2 bounds = cell > 4.0 ? texelFetch(t_bounds_16, ivec2(index), 0).rg : texelFetch(t_bounds_4, ivec2(index), 0).rg;
            over = min(s.x, s.y) > bounds.x;
            under = max(s.x, s.y) < bounds.y;
        } else {
            vec2 f = glc_raster_plane(ray, texelFetch(t_plane, ivec2(index), 0));
            float met = f.x / (f.y < 0.0 ? f.y : -1e-30);
            if (f.y < 0.0 && met >= max(u - slack, 0.0) && met <= min(u_exit + slack, 1.0)) {
                vec2 off = abs(ray.start.xy + met * ray.step.xy - index - 0.5);
                solve.u = met;
                solve.texel = index;
                solve.error_px = max(off.x, off.y);
                solve.status = GLC_SOLVE_HIT;
                break;
            }
            over = u_exit * f.y - f.x > 0.0;
            under = !over;
        }
        if (over || under) {
            if (over) solve.u_front = max(u_exit - 2.0 * nudge, u);   // still inside the cell
            behind = under;
            u = u_exit;
            // Up again only where a new coarser cell begins, so that the march does not flutter between levels.
            vec2 next = floor((ray.start.xy + u * ray.step.xy) / (4.0 * cell));
            if (cell < 16.0 && next != floor(px / (4.0 * cell))) cell *= 4.0;
        } else {
            cell *= 0.25;
        }
        if (u >= ray.u_screen) {
            solve.status = ray.u_screen < 1.0 ? GLC_SOLVE_OFFSCREEN : (behind ? GLC_SOLVE_HIDDEN : GLC_SOLVE_NOTHING);
            break;
        }
    }
    if (solve.status != GLC_SOLVE_HIT) solve.u = u;
    return solve;
}
