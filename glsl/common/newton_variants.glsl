#include "common/newton.glsl"
#include "common/newton_planes.glsl"

// Variants of glc_newton (newton.glsl), the same answer by other means; what each of them pays is in docs/methods/eye_refraction.md.
// Pure functions, no uniforms. All take and return what glc_newton does: rays and planes in raster space, u in [0, 1] along the
// ray, errors in pixels; `iterations` counts texel look-ups of the surface (filtered ones too).

struct GlcNewtonState {
    float behind;      // last known point behind a surface; in front: GlcSolve.u_front
    float length_px;   // of the last step
    bool hit;
};

// The texel (integer coordinates) of a texture of the picture's size that the ray is over at u, kept on the picture.
vec2 glc_newton_texel(sampler2D t, GlcRasterRay ray, float u) {
    return clamp(floor(ray.start.xy + u * ray.step.xy), vec2(0.0), vec2(textureSize(t, 0)) - 1.0);
}

// One iteration from the plane of the texel at solve.u: accepts it, or goes on to `next` (u), kept within the bracket.
// f: of glc_raster_plane. next: where this variant would look; the plane's own intersection is f.x / f.y.
void glc_newton_advance(GlcRasterRay ray, vec2 texel, vec2 f, float next, inout GlcSolve solve, inout GlcNewtonState state) {
    float met = f.y < 0.0 ? f.x / f.y : -1.0;
    vec2 off = abs(ray.start.xy + met * ray.step.xy - texel - 0.5);
    solve.error_px = met >= 0.0 && met <= 1.0 ? max(off.x, off.y) : 1e6;
    solve.texel = texel;
    solve.iterations += 1;
    state.hit = solve.error_px <= GLC_SOLVE_TOLERANCE_PX;
    float u = solve.u;
    if (u * f.y >= f.x) solve.u_front = u; else state.behind = u;
    bool inside = next > solve.u_front - 1e-6 && next < state.behind + 1e-6;
    solve.u = state.hit ? met : min(inside ? next : 0.5 * (solve.u_front + state.behind), ray.u_screen);
    state.length_px = abs(solve.u - u) * max(abs(ray.step.x), abs(ray.step.y));
}

// What to call the end of the iteration: sets the status, as glc_newton does.
void glc_newton_classify(GlcRasterRay ray, GlcNewtonState state, inout GlcSolve solve) {
    float extent = max(abs(ray.step.x), abs(ray.step.y));
    if (state.hit) solve.status = GLC_SOLVE_HIT;
    else if (solve.u >= ray.u_screen && ray.u_screen < 1.0) solve.status = GLC_SOLVE_OFFSCREEN;
    else if ((state.behind - solve.u_front) * extent < 1.0) solve.status = GLC_SOLVE_DISCONTINUITY;
}

// From stored normals: two fetches an iteration. t_normal: world space, w unused; ray_from_px: see glc_plane_from_normal.
GlcSolve glc_newton_normals(sampler2D t_depth_m, sampler2D t_normal, mat3 ray_from_px, bool orthographic, GlcRasterRay ray,
                            int max_iterations) {
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_DIVERGED, 0);
    GlcNewtonState state = GlcNewtonState(1.0, 0.0, false);
    for (int i = 0; i < max_iterations && !state.hit; ++i) {
        vec2 texel = glc_newton_texel(t_depth_m, ray, solve.u);
        float depth_m = texelFetch(t_depth_m, ivec2(texel), 0).r;
        vec3 n = texelFetch(t_normal, ivec2(texel), 0).xyz;
        vec2 f = glc_raster_plane(ray, glc_plane_from_normal(ray_from_px, orthographic, texel, depth_m, n));
        glc_newton_advance(ray, texel, f, f.y < 0.0 ? f.x / f.y : -1.0, solve, state);
    }
    glc_newton_classify(ray, state, solve);
    return solve;
}

// From depth alone: nine fetches an iteration.
GlcSolve glc_newton_depth(sampler2D t_depth_m, bool orthographic, GlcRasterRay ray, int max_iterations) {
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_DIVERGED, 0);
    GlcNewtonState state = GlcNewtonState(1.0, 0.0, false);
    for (int i = 0; i < max_iterations && !state.hit; ++i) {
        vec2 texel = glc_newton_texel(t_depth_m, ray, solve.u);
        vec2 f = glc_raster_plane(ray, glc_plane_from_depth(t_depth_m, orthographic, texel));
        glc_newton_advance(ray, texel, f, f.y < 0.0 ? f.x / f.y : -1.0, solve, state);
    }
    glc_newton_classify(ray, state, solve);
    return solve;
}

// Second order: Halley's step with the curvature along the ray. The curvature costs no fetch: the cubic through the gaps and
// slopes of the last two iterates has it. (A curvature from a further fetch would be of order 3 for two fetches, where two plain
// steps are of order 4.) Source: Traub 1964 (iteration with memory).
GlcSolve glc_newton_curved(sampler2D t_plane, GlcRasterRay ray, int max_iterations) {
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_DIVERGED, 0);
    GlcNewtonState state = GlcNewtonState(1.0, 0.0, false);
    vec3 last = vec3(0.0);   // u, gap, slope of the iterate before
    float extent = max(abs(ray.step.x), abs(ray.step.y));
    for (int i = 0; i < max_iterations && !state.hit; ++i) {
        vec2 texel = glc_newton_texel(t_plane, ray, solve.u);
        vec2 f = glc_raster_plane(ray, texelFetch(t_plane, ivec2(texel), 0));
        vec3 now = vec3(solve.u, solve.u * f.y - f.x, f.y);
        float h = now.x - last.x;
        float next = f.y < 0.0 ? f.x / f.y : -1.0;
        // Texels are steps of a pixel: over less than two of them a difference of slopes tells nothing.
        if (i > 0 && f.y < 0.0 && abs(h) * extent > 2.0) {
            float curvature = 2.0 / h * (last.z + 2.0 * now.z - 3.0 * (now.y - last.y) / h);
            float bend = 0.5 * now.y * curvature / (now.z * now.z);
            next = now.x - now.y / now.z / clamp(1.0 - bend, 0.5, 2.0);
        }
        last = now;
        glc_newton_advance(ray, texel, f, next, solve, state);
    }
    glc_newton_classify(ray, state, solve);
    return solve;
}

// Filtered by the gap between sample and ray: far from the ray an average plane leads past small things, near it the texel's own
// plane decides. t_plane_mips: (g, c, 1) where something is stored, else 0, with mipmaps, linear filter: sums over the stored
// texels alone. width: of the filter, in gaps. The gap is the last step's length; of the first step, that of the texel's own plane.
GlcSolve glc_newton_filtered(sampler2D t_plane, sampler2D t_plane_mips, GlcRasterRay ray, float width, int max_iterations) {
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_DIVERGED, 0);
    GlcNewtonState state = GlcNewtonState(1.0, 0.0, false);
    vec2 size = vec2(textureSize(t_plane, 0));
    float extent = max(abs(ray.step.x), abs(ray.step.y));
    for (int i = 0; i < max_iterations && !state.hit; ++i) {
        vec2 texel = glc_newton_texel(t_plane, ray, solve.u);
        vec2 f = glc_raster_plane(ray, texelFetch(t_plane, ivec2(texel), 0));
        float met = f.y < 0.0 ? f.x / f.y : -1.0;
        float gap_px = abs(clamp(met, 0.0, 1.0) - solve.u) * extent;
        float next = met;
        if (gap_px * width > 1.0) {
            vec2 uv = clamp((ray.start.xy + solve.u * ray.step.xy) / size, vec2(0.0), vec2(1.0));
            vec4 mean = textureLod(t_plane_mips, uv, log2(gap_px * width));
            vec2 m = glc_raster_plane(ray, vec4(mean.xyz / max(mean.w, 1e-6), mean.w));
            if (mean.w > 0.0 && m.y < 0.0) next = m.x / m.y;
            solve.iterations += 1;
        }
        glc_newton_advance(ray, texel, f, next, solve, state);
    }
    glc_newton_classify(ray, state, solve);
    return solve;
}
