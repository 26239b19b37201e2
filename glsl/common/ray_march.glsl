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
    for (int candidate = 0; candidate < 256 && i <= count; ++candidate) {
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

// The same samples over bounds of s, t_bounds_4 and t_bounds_16 (rg32f, largest and smallest s of 4 x 4 and 16 x 16 texels): whole
// cells that the ray is in front of, or stays behind, are skipped, so it finds what the pixel-exact march finds. Where that finds
// nothing, it takes the first texel whose plane the ray crosses although no centre's depth told (blades seen edge-on).
GlcSolve glc_march_hierarchical(sampler2D t_bounds_4, sampler2D t_bounds_16, sampler2D t_plane, GlcRasterRay ray, int max_steps) {
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_DIVERGED, 0);
    GlcSolve crossed = solve;
    vec2 last = vec2(textureSize(t_plane, 0)) - 1.0;
    vec2 inverse = 1.0 / mix(ray.step.xy, vec2(1e-6), lessThan(abs(ray.step.xy), vec2(1e-6)));
    vec2 ahead = vec2(greaterThan(inverse, vec2(0.0)));
    float pixels = max(max(abs(ray.step.x), abs(ray.step.y)) * ray.u_screen, 1.0);
    float du = ray.u_screen / pixels, count = ceil(pixels), at = 0.0, cell = 4.0;
    bool front = true, entered = false, ended = false;
    int i = 0;
    // The inner loop only walks: what a software renderer runs for every pixel of a group, taken or not, stays small.
    for (int candidate = 0; candidate < 8 && i < max_steps && !ended; ++candidate) {
        for (; i < max_steps; ++i) {
            float u = min(at * du, ray.u_screen);
            vec3 p = ray.start + u * ray.step;
            vec2 px = clamp(p.xy, vec2(0.0), last + 0.999);
            vec2 index = floor(px / cell);
            float next = at + 1.0;
            bool over, under;   // in front of all of the cell; behind all of it as before
            if (cell > 1.0) {
                vec2 leaves = ((index + ahead) * cell - ray.start.xy) * inverse;
                float u_exit = clamp(min(leaves.x, leaves.y), u, ray.u_screen);
                float s_exit = ray.start.z + u_exit * ray.step.z;
                vec2 bounds = cell > 4.0 ? texelFetch(t_bounds_16, ivec2(index), 0).rg : texelFetch(t_bounds_4, ivec2(index), 0).rg;
                over = min(p.z, s_exit) > bounds.x;
                under = !front && max(p.z, s_exit) < bounds.y;
                next = max(next, ceil(u_exit / du));
            } else {
                vec4 plane = texelFetch(t_plane, ivec2(index), 0);
                over = plane.w <= 0.0 || p.z > plane.z + dot(plane.xy, index + 0.5);
                under = !over;
                entered = under && front;
                solve.u = u;
                vec2 f = glc_raster_plane(ray, plane);
                float met = f.x / (f.y < 0.0 ? f.y : -1e-30);
                vec2 off = abs(ray.start.xy + met * ray.step.xy - index - 0.5);
                if (crossed.status != GLC_SOLVE_HIT && f.y < 0.0 && met >= 0.0 && met <= 1.0 && max(off.x, off.y) <= GLC_SOLVE_TOLERANCE_PX)
                    crossed = GlcSolve(met, met, index, max(off.x, off.y), GLC_SOLVE_HIT, i + 1);
            }
            solve.iterations = i + 1;
            if (over || under) {
                front = over;
                at = next;
                if (at > count) {
                    ended = true;
                }
                if (over) solve.u_front = min((at - 1.0) * du, ray.u_screen);
                // Up again only where a new coarser cell begins, so that the march does not flutter between levels.
                vec2 coarser = floor((ray.start.xy + at * du * ray.step.xy) / (4.0 * cell));
                if (cell < 16.0 && coarser != floor(px / (4.0 * cell))) cell *= 4.0;
            } else {
                cell *= 0.25;
            }
            if (entered || ended) break;
        }
        i += 1;
        if (entered && glc_march_settle(t_plane, ray, 2.5 * du, solve)) return solve;
        entered = false;
    }
    if (ended) solve.status = ray.u_screen < 1.0 ? GLC_SOLVE_OFFSCREEN : (front ? GLC_SOLVE_NOTHING : GLC_SOLVE_HIDDEN);
    solve.u = ray.u_screen;
    crossed.iterations = solve.iterations;
    if (crossed.status == GLC_SOLVE_HIT) return crossed;
    return solve;
}

// Whether the way to a hit of Newton's method is clear: ray points on it against the nearest s of 4 x 4 texels around them. False:
// something may stand before one of them, the ray may have met it first. Points one to `count`, a cell apart where the ray is short.
bool glc_way_is_clear(sampler2D t_bounds_4, GlcRasterRay ray, GlcSolve solve, int count) {
    vec2 last = vec2(textureSize(t_bounds_4, 0)) - 1.0;
    vec2 way = abs(solve.u * ray.step.xy);
    int points = min(int(max(way.x, way.y) / 4.0), count);
    float stride = solve.u / float(points + 1);
    float clear = 1.0;
    for (int i = 1; i <= points; ++i) {
        vec3 p = ray.start + float(i) * stride * ray.step;
        clear = min(clear, p.z - texelFetch(t_bounds_4, ivec2(clamp(p.xy / 4.0, vec2(0.0), last)), 0).r);
    }
    return clear > 0.0;
}
