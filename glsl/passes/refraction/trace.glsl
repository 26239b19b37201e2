#include "common/ray_march.glsl"
#include "common/way_clear.glsl"
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
#if SEEDED || !FINAL
uniform sampler2D t_near;
#endif
#if HAS_CAUSTICS_VIEW
uniform sampler2D t_caustics;
#endif
#if SEEDED
uniform sampler2D t_last_reflection_m;     // of the last frame, by its own raster space
uniform mat4 u_last_raster_from_world;
#endif
uniform vec3 u_bounds_min_ws;
uniform vec3 u_bounds_max_ws;
uniform float u_bounds_diagonal_m;
uniform int u_refraction_iterations;
uniform int u_refraction_steps;
uniform int u_reflection_steps;

// Points of a ray at which the cascade looks for what may stand before it.
// With 6, thin blades at a grazing angle cost the cascade 1.1 % of what the DDA finds; with 12, 0.4 %, for 2 % of the frame.
const int CLEAR_POINTS = 12;
const int REFLECTION_ITERATIONS = 3;

#if HAS_SECOND
#include "passes/refraction/second.glsl"
#endif

// Where a ray ends, before anything is fetched there.
struct End {
    vec2 uv;
    float distance_m;
    float status;      // GLC_VIEW_*; SKY: nowhere on the picture
};

// The picture at an end. The radiance's alpha holds depth: where filtering at a hit would mix in another surface, the texel alone
// counts (fetched by the final stage: before it, such a pixel is left to do).
Seen seen_at(End end, vec3 d, GlcRasterRay ray, GlcSolve solve, out bool mixes) {
#if HAS_SECOND
    mixes = false;
    if (end.status == GLC_VIEW_SECOND) return seen_second(ray, solve);
#endif
    float s = ray.start.z + solve.u * ray.step.z;
    float depth_m = ORTHOGRAPHIC == 1 ? -s : 1.0 / s;
    vec4 filtered = textureLod(t_radiance, end.uv, 0.0);
    mixes = solve.status == GLC_SOLVE_HIT && abs(filtered.a - depth_m) > 0.02 * abs(depth_m);
#if FINAL
    if (mixes) filtered = texelFetch(t_radiance, ivec2(solve.texel), 0);
    if (end.status == GLC_VIEW_SKY) filtered.rgb = glc_sky_radiance(d);
#endif
    Seen seen = Seen(filtered.rgb, vec3(0.0), end.distance_m, end.uv, solve.error_px, float(solve.iterations), end.status);
#if HAS_CAUSTICS_VIEW
    seen.caustics = mixes ? texelFetch(t_caustics, ivec2(solve.texel), 0).rgb : textureLod(t_caustics, end.uv, 0.0).rgb;
    if (end.status == GLC_VIEW_SKY) seen.caustics = vec3(0.0);
#endif
    return seen;
}

End end_of(GlcRasterRay ray, GlcSolve solve, float status) {
    return End((ray.start.xy + solve.u * ray.step.xy) / u_raster_size, glc_raster_distance(ray, solve.u), status);
}

#if USE_NEWTON || USE_MARCH
// The last surface that a ray was known to be in front of, as a plane. before_px: where its way was in front of one before it
// started, unless -1: that counts if all of it is hidden.
struct Last {
    vec2 px;
    vec4 plane;
    float u;         // there
    bool meets;      // the ray meets it
    float met;       // where
};

Last last_surface(GlcRasterRay ray, GlcSolve solve, vec2 before_px) {
    // Two pixels back: the rim itself is an edge-on surface as often as not.
    float back = 2.0 / max(max(abs(ray.step.x), abs(ray.step.y)), 1e-6);
    float u_last = max(min(solve.u_front, ray.u_screen) - back, 0.0);
    vec2 px = clamp(ray.start.xy + u_last * ray.step.xy, vec2(0.5), u_raster_size - 0.5);
    if (before_px.x >= 0.0 && solve.u_front <= 0.0) px = before_px;
    vec4 plane = texelFetch(t_plane, ivec2(px), 0);
    vec2 f = glc_raster_plane(ray, plane);
    float met = f.x / (f.y < 0.0 ? f.y : -1e-30);
    return Last(px, plane, u_last, f.y < 0.0 && met > 0.0 && met <= 1.0, met);
}

// The ray met nothing on the picture. Its last known surface is continued as a plane: if the ray meets that within the scene, the
// surface is continued beyond its visible edge by its mirror image (where that is the same plane; else by its last texel), else it
// is the sky. Continuous at the picture's border and at the rims of objects, and without streaks.
End end_beyond(GlcRasterRay ray, GlcSolve solve, vec2 before_px) {
    Last last = last_surface(ray, solve, before_px);
    vec2 px = last.px;
    vec4 plane = last.plane;
    float met = last.met;
    bool hidden = solve.status == GLC_SOLVE_HIDDEN, meets = last.meets;
    if (hidden && !meets && plane.w > 0.0) {   // behind something, and the surface before it does not reach there: its rim
        met = last.u;
        meets = true;
    }
    vec2 beyond = ray.start.xy + met * ray.step.xy - px;
    // To and fro over a quarter of the picture's height, should it go on for long.
    float reach = length(beyond), fold = 0.25 * u_raster_size.y;
    float folded = fold - abs(mod(reach, 2.0 * fold) - fold);
    vec2 mirrored = clamp(px - beyond * (folded / max(reach, 1e-3)), vec2(0.5), u_raster_size - 0.5);
    vec4 other = texelFetch(t_plane, ivec2(mirrored), 0);
    float s = plane.z + dot(plane.xy, mirrored);
    float there = other.z + dot(other.xy, mirrored);
    if (other.w > 0.0 && there < ray.start.z && abs(there - s) < 0.3 * abs(s)) px = mirrored;
    float status = solve.status == GLC_SOLVE_OFFSCREEN ? GLC_VIEW_OFFSCREEN : (hidden ? GLC_VIEW_HIDDEN : GLC_VIEW_FALLBACK);
    return meets ? End(px / u_raster_size, glc_raster_distance(ray, met), status) : End(vec2(-1.0), ray.length_m, GLC_VIEW_SKY);
}
#endif

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
    bool mixes;
    return seen_at(End(px / u_raster_size, t, there > 0.0 ? GLC_VIEW_FALLBACK : GLC_VIEW_SKY), d, ray, none, mixes);
}

#if USE_MARCH == 1
#define MARCH(ray, steps, in_view) glc_march_dda(t_opaque_depth_m, t_plane, ORTHOGRAPHIC == 1, ray, steps, in_view)
#elif USE_MARCH == 2
#define MARCH(ray, steps, in_view) glc_march_hierarchical(t_bounds, t_plane, ray, steps, in_view)
#endif

// The ray of this pixel's surface, from the pixel's centre. depth_m: of the surface, along the view axis.
GlcRasterRay pixel_ray(float depth_m, vec3 d, float room_m) {
    float w = ORTHOGRAPHIC == 1 ? 1.0 : depth_m;
    vec3 start = vec3(gl_FragCoord.xy, ORTHOGRAPHIC == 1 ? -depth_m : 1.0 / depth_m);
    return glc_raster_ray_from(u_raster_from_world, u_raster_size, start, w, d, room_m);
}

#include "passes/refraction/inside.glsl"

#if !USE_MARCH
// Along a refracted ray. solved: false where the last stage should look again.
Seen look_through(GlcRasterRay ray, vec3 p, vec3 d, Ending ending, out bool solved) {
    solved = true;
#if USE_SOUSA
    return look_sousa(ray, p, d);
#else
#if FINAL
    float above = 0.0;
#else
    float above = glc_way_above(t_near, u_raster_size, ray);
#endif
    GlcSolve solve = glc_newton_from(t_plane, ray, 1.0, above, RESTARTS == 1, u_refraction_iterations);
    float status = GLC_VIEW_NEWTON;
#if OPAQUE_INSIDE
    if (ending.ends) {
        solve = ending.solve;
        status = ending.status;
    }
#endif
    bool hit = solve.status == GLC_SOLVE_HIT, mixes;
#if HAS_SECOND
    if (!hit && !ending.ends) look_behind(ray, u_refraction_steps, solve, status);
    hit = solve.status == GLC_SOLVE_HIT;
#endif
    End end = end_of(ray, solve, hit ? status : GLC_VIEW_FALLBACK);
    vec2 estimate = end.uv;
#if FINAL
    if (!hit) end = end_beyond(ray, solve, ending.px);
#endif
    Seen seen = seen_at(end, d, ray, solve, mixes);
#if !FINAL
    solved = hit && !mixes && glc_way_clear(t_bounds, u_raster_size, ray, above, solve.u, CLEAR_POINTS) >= solve.u;
#if OPAQUE_INSIDE
    solved = ending.solved && (ending.ends ? hit && !mixes : solved);
#endif
#endif
    seen.uv = estimate;   // the solver's own, for who judges it
    return seen;
#endif
}
#endif

#if SEEDED
// Newton's method from where the ray of the same point ended in the last frame. Its hit counts if the way to it is clear, too.
GlcSolve solve_again(vec3 p, GlcRasterRay ray) {
    vec4 q = u_last_raster_from_world * vec4(p, 1.0);
    vec2 was = q.xy / max(q.w, 1e-20);
    bool seen = q.w > 0.0 && all(greaterThanEqual(was, vec2(0.0))) && all(lessThan(was, u_raster_size));
    float last_m = seen ? texelFetch(t_last_reflection_m, ivec2(was), 0).r : 0.0;
    int iterations = last_m > 0.0 ? REFLECTION_ITERATIONS : 0;
    GlcSolve solve = glc_newton_from(t_plane, ray, 1.0, clamp(glc_raster_at(ray, last_m), 0.0, ray.u_screen), false, iterations);
    float above = glc_way_above(t_near, u_raster_size, ray);
    if (glc_way_clear(t_bounds, u_raster_size, ray, above, solve.u, CLEAR_POINTS) < solve.u) solve.status = GLC_SOLVE_DIVERGED;
    return solve;
}
#endif

#if USE_MARCH
// Along a refracted or mirrored ray of the surface at p. ending: of a refracted one.
Seen look_along(GlcRasterRay ray, vec3 p, vec3 d, bool mirrored, Ending ending) {
    int steps = mirrored ? u_reflection_steps : u_refraction_steps;
    float status = GLC_VIEW_MARCHED;
    bool mixes, in_view = true;
    GlcSolve solve = GlcSolve(0.0, 0.0, vec2(0.0), 1e6, GLC_SOLVE_DIVERGED, 0);
    bool known = false;
#if OPAQUE_INSIDE
    if (ending.ends && !mirrored) {
        known = true;
        solve = ending.solve;
        status = ending.status;
    }
#endif
#if SEEDED
    if (mirrored) solve = solve_again(p, ray);
    known = known || solve.status == GLC_SOLVE_HIT;
#endif
    if (!known) solve = MARCH(ray, steps, in_view);
#if HAS_SECOND
    if (!in_view) look_behind(ray, steps, solve, status);
#endif
    End end = end_of(ray, solve, status);
    vec2 estimate = end.uv;
    if (solve.status != GLC_SOLVE_HIT) end = end_beyond(ray, solve, mirrored ? vec2(-1.0) : ending.px);
    Seen seen = seen_at(end, d, ray, solve, mixes);
    seen.uv = estimate;   // the solver's own, for who judges it
    return seen;
}
#endif
