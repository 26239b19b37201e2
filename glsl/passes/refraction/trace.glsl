#include "common/ray_march.glsl"
#include "common/intersect_box.glsl"
#include "interface/raster.glsl"
#include "interface/sky.glsl"
#include "passes/refraction/outputs.glsl"

// What lies along a ray behind an interface, in the shaded opaque layer. USE_NEWTON, USE_MARCH (0 none, 1 DDA, 2 hierarchical)
// and USE_SOUSA choose the solver; the stages of the cascade are permutations of this.
uniform sampler2D t_radiance;
uniform sampler2D t_opaque_depth_m;
#if USE_NEWTON || USE_MARCH
uniform sampler2D t_plane;
#endif
#if USE_MARCH == 2 || !FINAL
uniform sampler2D t_bounds;
#endif
#if HAS_CAUSTICS_VIEW
uniform sampler2D t_caustics;
#endif
uniform vec3 u_bounds_min_ws;
uniform vec3 u_bounds_max_ws;
uniform float u_bounds_diagonal_m;
uniform int u_refraction_iterations;
uniform int u_refraction_steps;
uniform int u_reflection_steps;

// Points of a ray at which the cascade looks for what may stand before it.
const int CLEAR_POINTS = 6;

#if HAS_SECOND
#include "passes/refraction/second.glsl"
#endif

Seen seen_at(vec2 uv, float distance_m, GlcSolve solve, float status) {
    Seen seen = Seen(textureLod(t_radiance, uv, 0.0).rgb, vec3(0.0), distance_m, uv, solve.error_px, float(solve.iterations), status);
#if HAS_CAUSTICS_VIEW
    seen.caustics = textureLod(t_caustics, uv, 0.0).rgb;
#endif
    return seen;
}

// At a solved ray's end. The radiance's alpha holds depth: where filtering would mix in another surface, the texel alone counts
// (fetched by the final stage: before it, such a pixel is left to do).
Seen seen_hit(GlcRasterRay ray, GlcSolve solve, float status, out bool mixes) {
#if HAS_SECOND
    mixes = false;
    if (status == GLC_VIEW_SECOND) return seen_second(ray, solve);
#endif
    vec3 end = ray.start + solve.u * ray.step;
    float depth_m = ORTHOGRAPHIC == 1 ? -end.z : 1.0 / end.z;
    vec2 uv = end.xy / u_raster_size;
    vec4 filtered = textureLod(t_radiance, uv, 0.0);
    mixes = abs(filtered.a - depth_m) > 0.02 * abs(depth_m);
#if FINAL
    if (mixes) filtered = texelFetch(t_radiance, ivec2(solve.texel), 0);
#endif
    Seen seen = Seen(filtered.rgb, vec3(0.0), glc_raster_distance(ray, solve.u), uv, solve.error_px, float(solve.iterations), status);
#if HAS_CAUSTICS_VIEW
    seen.caustics = mixes ? texelFetch(t_caustics, ivec2(solve.texel), 0).rgb : textureLod(t_caustics, uv, 0.0).rgb;
#endif
    return seen;
}

// The ray met nothing on the picture. Its last known surface is continued as a plane: if the ray meets that within the scene, the
// surface is continued beyond its visible edge by its mirror image (where that is the same plane; else by its last texel), else it
// is the sky. Continuous at the picture's border and at the rims of objects, and without streaks.
Seen seen_beyond(GlcRasterRay ray, vec3 d, GlcSolve solve) {
#if USE_NEWTON || USE_MARCH
    // Two pixels back: the rim itself is an edge-on surface as often as not.
    float back = 2.0 / max(max(abs(ray.step.x), abs(ray.step.y)), 1e-6);
    float u_last = max(min(solve.u_front, ray.u_screen) - back, 0.0);
    vec2 px = clamp(ray.start.xy + u_last * ray.step.xy, vec2(0.5), u_raster_size - 0.5);
    vec4 plane = texelFetch(t_plane, ivec2(px), 0);
    vec2 f = glc_raster_plane(ray, plane);
    float met = f.x / (f.y < 0.0 ? f.y : -1e-30);
    bool hidden = solve.status == GLC_SOLVE_HIDDEN;
    bool meets = f.y < 0.0 && met > 0.0 && met <= 1.0;
    if (hidden && !meets && plane.w > 0.0) {   // behind something, and the surface before it does not reach there: its rim
        met = u_last;
        meets = true;
    }
    if (meets) {
        vec2 beyond = ray.start.xy + met * ray.step.xy - px;
        // To and fro over a quarter of the picture's height, should it go on for long.
        float reach = length(beyond), fold = 0.25 * u_raster_size.y;
        float folded = fold - abs(mod(reach, 2.0 * fold) - fold);
        vec2 mirrored = clamp(px - beyond * (folded / max(reach, 1e-3)), vec2(0.5), u_raster_size - 0.5);
        vec4 other = texelFetch(t_plane, ivec2(mirrored), 0);
        float s = plane.z + dot(plane.xy, mirrored);
        if (other.w > 0.0 && abs(other.z + dot(other.xy, mirrored) - s) < 0.04 * abs(s)) px = mirrored;
        float status = solve.status == GLC_SOLVE_OFFSCREEN ? GLC_VIEW_OFFSCREEN : (hidden ? GLC_VIEW_HIDDEN : GLC_VIEW_FALLBACK);
        return seen_at(px / u_raster_size, glc_raster_distance(ray, met), solve, status);
    }
#endif
    return Seen(glc_sky_radiance(d), vec3(0.0), ray.length_m, vec2(-1.0), solve.error_px, float(solve.iterations), GLC_VIEW_SKY);
}

GlcRasterRay eye_ray(vec3 p, vec3 d) {
    float room = glc_box_exit(p, d, u_bounds_min_ws, u_bounds_max_ws);
    return glc_raster_ray(u_raster_from_world, u_raster_size, p, d, room);
}

// Sousa 2005: the straight pixel moved as the refracted ray is at the straight surface's distance, unless what is there stands
// before the interface (his mask, here by depth).
Seen look_sousa(GlcRasterRay ray, vec3 p, vec3 d) {
    GlcSolve none = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_DIVERGED, 1);
    float own = texelFetch(t_opaque_depth_m, ivec2(clamp(ray.start.xy, vec2(0.5), u_raster_size - 0.5)), 0).r;
    float start = ORTHOGRAPHIC == 1 ? -ray.start.z : 1.0 / ray.start.z;
    float t = own > 0.0 ? own - start : ray.length_m;
    vec4 q = u_raster_from_world * vec4(p + t * d, 1.0);
    vec2 px = clamp(q.w > 0.0 ? q.xy / q.w : ray.start.xy, vec2(0.5), u_raster_size - 0.5);
    float there = texelFetch(t_opaque_depth_m, ivec2(px), 0).r;
    if (there > 0.0 && there < start) px = clamp(ray.start.xy, vec2(0.5), u_raster_size - 0.5);
    Seen seen = seen_at(px / u_raster_size, t, none, GLC_VIEW_FALLBACK);
    if (there <= 0.0) {
        seen.radiance = glc_sky_radiance(d);
        seen.caustics = vec3(0.0);
        seen.status = GLC_VIEW_SKY;
    }
    return seen;
}

#if USE_MARCH == 1
#define MARCH(ray, steps, in_view) glc_march_dda(t_opaque_depth_m, t_plane, ORTHOGRAPHIC == 1, ray, steps, in_view)
#elif USE_MARCH == 2
#define MARCH(ray, steps, in_view) glc_march_hierarchical(t_bounds, t_plane, ray, steps, in_view)
#endif

// Along a refracted ray. solved: false where a later stage should look again.
Seen look_through(GlcRasterRay ray, vec3 p, vec3 d, out bool solved) {
    solved = true;
#if USE_SOUSA
    return look_sousa(ray, p, d);
#else
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_DIVERGED, 0);
    float status = GLC_VIEW_NEWTON;
    bool in_view = false;
#if USE_NEWTON
    solve = glc_newton(t_plane, ray, 1.0, u_refraction_iterations);
    in_view = solve.status == GLC_SOLVE_HIT;
#endif
#if USE_MARCH
    if (solve.status != GLC_SOLVE_HIT) {
        int before = solve.iterations;
        solve = MARCH(ray, u_refraction_steps, in_view);
        solve.iterations += before;
        status = GLC_VIEW_MARCHED;
    }
#endif
#if HAS_SECOND
    if (!in_view) look_behind(ray, u_refraction_steps, solve, status);
#endif
    solved = solve.status == GLC_SOLVE_HIT;
    vec2 uv = (ray.start.xy + solve.u * ray.step.xy) / u_raster_size;
    Seen seen;
    if (solved) {
        bool mixes;
        seen = seen_hit(ray, solve, status, mixes);
#if !FINAL
        solved = !mixes && glc_way_is_clear(t_bounds, u_raster_size, ray, solve, CLEAR_POINTS);
#endif
        return seen;
    }
#if FINAL
    seen = seen_beyond(ray, d, solve);
#else
    seen = Seen(vec3(0.0), vec3(0.0), 0.0, uv, solve.error_px, float(solve.iterations), GLC_VIEW_FALLBACK);
#endif
    seen.uv = uv;   // the solver's own estimate, for who judges it
    return seen;
#endif
}

// Along a reflected ray: marched where marching is on, else what the sky holds.
Seen look_along(vec3 p, vec3 d) {
#if USE_MARCH
    GlcRasterRay ray = eye_ray(p, d);
    bool mixes, in_view;
    GlcSolve solve = MARCH(ray, u_reflection_steps, in_view);
    float status = GLC_VIEW_MARCHED;
#if HAS_SECOND
    if (!in_view) look_behind(ray, u_reflection_steps, solve, status);
#endif
    if (solve.status == GLC_SOLVE_HIT)
        return seen_hit(ray, solve, status, mixes);
    return seen_beyond(ray, d, solve);
#else
    return Seen(glc_sky_radiance(d), vec3(0.0), 0.0, vec2(-1.0), 0.0, 0.0, GLC_VIEW_SKY);
#endif
}
