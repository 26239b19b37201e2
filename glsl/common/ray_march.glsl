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

// One step a pixel of the longer axis. t_depth: r32f depth in metres, 0 = nothing. in_view: the ray was in front of all surfaces up to
// its end: whoever looks sees all of it, so that nothing else can be in its way. u_clear: up to where that is so.
GlcSolve glc_march_dda(sampler2D t_depth, sampler2D t_plane, bool orthographic, GlcRasterRay ray, int max_steps, out bool in_view,
                       out float u_clear) {
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_NOTHING, 0);
    float pixels = max(max(abs(ray.step.x), abs(ray.step.y)) * ray.u_screen, 1.0);
    float du = ray.u_screen / pixels;
    vec2 last = vec2(textureSize(t_depth, 0)) - 1.0;
    int count = min(int(ceil(pixels)), max_steps);
    bool front = true;
    in_view = true;
    u_clear = 0.0;
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
        if (in_view) u_clear = solve.u_front;
        if (i > count) break;
        if (glc_march_settle(t_plane, ray, 2.5 * du, solve)) return solve;
        in_view = false;
        i += 1;
    }
    if (ray.u_screen < 1.0) solve.status = GLC_SOLVE_OFFSCREEN;
    else if (!front) solve.status = GLC_SOLVE_HIDDEN;
    return solve;
}

// The same, where nobody asks how far it is clear.
GlcSolve glc_march_dda(sampler2D t_depth, sampler2D t_plane, bool orthographic, GlcRasterRay ray, int max_steps, out bool in_view) {
    float u_clear;
    return glc_march_dda(t_depth, t_plane, orthographic, ray, max_steps, in_view, u_clear);
}

// The same, where nobody asks whether all of it is in view either.
GlcSolve glc_march_dda(sampler2D t_depth, sampler2D t_plane, bool orthographic, GlcRasterRay ray, int max_steps) {
    bool in_view;
    return glc_march_dda(t_depth, t_plane, orthographic, ray, max_steps, in_view);
}

// Where the bounds of a cell of 4 x 4, 16 x 16 or 64 x 64 texels lie in their texture: the finest level at the left, beside it the
// others, one over the other. size: of the picture, in texels.
ivec2 glc_bounds_texel(vec2 index, float cell, vec2 size) {
    vec2 coarse = vec2(ceil(size.x / 4.0), cell < 32.0 ? 0.0 : ceil(size.y / 16.0));
    return ivec2(index + (cell < 8.0 ? vec2(0.0) : coarse));
}

const float GLC_MARCH_STAY = 8.0; // texels tried in a row by the hierarchical march

// The same samples over bounds of s in cells of 4 x 4, 16 x 16 and 64 x 64 texels, one texture (rg32f, largest and smallest s; see
// glc_bounds_texel): whole cells that the ray is in front of, or stays behind, are skipped, so it finds what the pixel-exact march
// finds. Where that finds nothing, it takes the first texel whose plane the ray crosses although no centre's depth told (blades seen
// edge-on). Two loops take turns, since a software renderer runs all of a loop's body for every pixel: over cells, one fetch a step,
// and over the texels of the one cell that could not be skipped, GLC_MARCH_STAY of them at least: the fewer turns, the less rays side
// by side wait for one another.
GlcSolve glc_march_hierarchical(sampler2D t_bounds, sampler2D t_plane, GlcRasterRay ray, int max_steps, out bool in_view,
                                out float u_clear) {
    in_view = true;
    u_clear = 0.0;
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_DIVERGED, 0);
    vec3 crossed = vec3(-1.0);   // u and texel
    vec2 size = vec2(textureSize(t_plane, 0));
    // Along the ray all is counted in samples: one a pixel of the longer axis.
    float pixels = max(max(abs(ray.step.x), abs(ray.step.y)) * ray.u_screen, 1.0);
    float du = ray.u_screen / pixels, count = ceil(pixels), at = 0.0, cell = pixels > 32.0 ? 64.0 : 16.0;
    vec3 stride = du * ray.step;
    vec3 inverse = 1.0 / mix(stride, vec3(1e-12), lessThan(abs(stride), vec3(1e-12)));
    vec2 ahead = vec2(greaterThan(inverse.xy, vec2(0.0)));
    bool front = true, ended = false, hit = false;
    int i = 0;
    for (int candidate = 0; candidate < 64 && i < max_steps && !ended; ++candidate) {
        float leave = at, range = 0.0;   // of the cell that cannot be skipped: first sample beyond it, extent of s
        for (; i < max_steps; ++i) {
            vec3 p = ray.start + at * stride;
            vec2 index = floor(clamp(p.xy, vec2(0.0), size - 0.001) / cell);
            vec2 edge = index + ahead;
            vec2 leaves = (edge * cell - ray.start.xy) * inverse.xy;
            float exit = clamp(min(leaves.x, leaves.y), at, count);
            float s_exit = ray.start.z + exit * stride.z;
            vec2 bounds = texelFetch(t_bounds, glc_bounds_texel(index, cell, size), 0).rg;
            bool over = min(p.z, s_exit) > bounds.x;
            bool under = !front && max(p.z, s_exit) < bounds.y;
            leave = max(at + 1.0, ceil(exit));
            range = bounds.x - bounds.y;
            bool skips = over || under;
            if (!skips && cell < 8.0) break;
            // Where the ray comes down to the nearest of the cell: nothing is met before.
            float down = p.z > bounds.x ? min(floor((bounds.x - ray.start.z) * inverse.z), leave - 1.0) : at;
            at = skips ? leave : max(at, down);
            front = skips ? over : (p.z > bounds.x || front);
            ended = at > count;
            // Up again only where a new coarser cell begins, so that the march does not flutter between levels.
            vec2 begins = abs(fract(0.25 * edge));
            bool up = cell < 64.0 && (leaves.x < leaves.y ? begins.x : begins.y) == 0.0;
            cell *= skips ? (up ? 4.0 : 1.0) : 0.25;
            if (ended) break;
        }
        // To the sample, not the cell: what lies behind a rim is continued from there.
        if (front) solve.u_front = clamp((at - 1.0) * du, 0.0, ray.u_screen);
        bool again = false;
        float stay = max(leave, at + GLC_MARCH_STAY);
        for (; i < max_steps && !ended; ++i) {
            float u = again ? solve.u : min(at * du, ray.u_screen);
            vec3 p = ray.start + u * ray.step;
            vec2 texel = floor(clamp(p.xy, vec2(0.0), size - 0.001));
            vec4 plane = texelFetch(t_plane, ivec2(texel), 0);
            vec2 f = glc_raster_plane(ray, plane);
            float met = f.x / (f.y < 0.0 ? f.y : -1e-30);
            vec2 off = abs(ray.start.xy + met * ray.step.xy - texel - 0.5);
            float error_px = max(off.x, off.y);
            bool over = plane.w <= 0.0 || p.z > plane.z + dot(plane.xy, texel + 0.5);
            bool meets = f.y < 0.0 && met >= 0.0 && met <= 1.0;
            bool within = meets && error_px <= GLC_SOLVE_TOLERANCE_PX;
            crossed = within && crossed.x < 0.0 ? vec3(met, texel) : crossed;
            // The first texel that the ray is behind: its plane is met there or, looked at again, in a texel nearby.
            bool close = meets && abs(met - at * du) <= 2.5 * du && (again || (front && !over));
            hit = within && close;
            solve = GlcSolve(close ? met : u, solve.u_front, texel, error_px, GLC_SOLVE_HIT, i + 1);
            front = again ? front : over;
            solve.u_front = front ? max(solve.u_front, u) : solve.u_front;
            again = close && !hit && !again;
            // In a cell that is one plane, on to where that is met.
            bool flat_cell = range < 5.0 * (abs(plane.x) + abs(plane.y));
            float next = over && meets && flat_cell ? clamp(ceil(met / du), at + 1.0, max(at + 1.0, leave)) : at + 1.0;
            at = again ? at : next;
            ended = at > count;
            u_clear = in_view ? solve.u_front : u_clear;
            in_view = in_view && (front || again || hit);
            if (hit || (!again && (at >= stay || ended))) break;
        }
        if (hit) break;
    }
    if (in_view) u_clear = solve.u_front;
    if (hit) return solve;
    if (crossed.x >= 0.0) return GlcSolve(crossed.x, crossed.x, crossed.yz, 0.0, GLC_SOLVE_HIT, i);
    solve.u = ray.u_screen;
    solve.iterations = i;
    solve.status = GLC_SOLVE_DIVERGED;
    if (ended) solve.status = ray.u_screen < 1.0 ? GLC_SOLVE_OFFSCREEN : (front ? GLC_SOLVE_NOTHING : GLC_SOLVE_HIDDEN);
    return solve;
}

// The same, where nobody asks how far it is clear.
GlcSolve glc_march_hierarchical(sampler2D t_bounds, sampler2D t_plane, GlcRasterRay ray, int max_steps, out bool in_view) {
    float u_clear;
    return glc_march_hierarchical(t_bounds, t_plane, ray, max_steps, in_view, u_clear);
}

// The same, where nobody asks whether all of it is in view either.
GlcSolve glc_march_hierarchical(sampler2D t_bounds, sampler2D t_plane, GlcRasterRay ray, int max_steps) {
    bool in_view;
    return glc_march_hierarchical(t_bounds, t_plane, ray, max_steps, in_view);
}
