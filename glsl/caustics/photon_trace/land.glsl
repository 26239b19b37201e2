// The second half of the cascade: what the light's view found, or did not find, is looked for in the camera's view (Meenrattanakorn &
// Lambers 2022, sec. 3.2). Ends are exact on the tangent plane of the pixel that they fall into.
#include "common/ray_march.glsl"
#include "interface/camera.glsl"
#include "interface/raster.glsl"

uniform sampler2D t_plane;       // of the camera's G-buffer
#if DDA
uniform sampler2D t_depth_m;
#else
uniform sampler2D t_bounds;
#endif
uniform int u_view_steps;

#define PHOTON_BY_LIGHT_VIEW 1
#define PHOTON_BY_EYE_VIEW 2
#define PHOTON_HIDDEN -2         // behind what the light sees, and not found by the eye
#define PHOTON_UNRESOLVED -3
#define PHOTON_LEFT -8
#define PHOTON_TODO -99          // of the first stage: marched by the second
#define PHOTON_UNSEEN -9         // lands where the eye looks, behind something
#define PHOTON_OUTSIDE -10       // lands outside of the picture

struct PhotonLanding {
    vec2 px;             // pixel that gets it
    float per_m2;        // 1 / area of the receiver within that pixel
    float t;             // metres along the ray
    int status;
    int lookups;
    vec4 plane;          // of that pixel, world space: unit normal towards the eye, and offset
    float width_m;       // of that pixel
};

// The tangent plane in world space: unit normal towards the eye, and offset.
vec4 photon_plane(vec4 plane) {
    vec4 q = vec4(-plane.xy, 1.0, -plane.z) * u_raster_from_world;
    float l2 = dot(q.xyz, q.xyz);
    return l2 > 0.0 ? q * inversesqrt(l2) : vec4(0.0);
}

// 1 / (area of the receiver in a pixel) = cos / (area of the pixel facing the eye). With the receiver's own area in it, not the
// angle at which the photon arrives (theirs, eq. 3), the flux of the pixels adds up to what landed on slanted receivers too.
float photon_per_m2(vec2 texel, float depth_m, vec3 n_ws) {
    vec3 ray = glc_camera_ray_ws((texel + 0.5) / u_raster_size);
    vec2 side = 2.0 * u_camera_lens.xy / u_raster_size;
    float area_m2 = side.x * side.y;
    if (u_camera_lens.z == 0.0) area_m2 *= depth_m * depth_m * -dot(ray, normalize(u_world_from_camera[2].xyz));
    return max(-dot(n_ws, ray), 0.0) / area_m2;
}

float photon_pixel_width(float depth_m) {
    return 2.0 * u_camera_lens.y / u_raster_size.y * (u_camera_lens.z == 0.0 ? depth_m : 1.0);
}

// Does the eye see the surface at p? Tries the pixel, and at edges those beside it that p is nearest to: a pixel shows the surface at
// its centre. Returns false with status 0 where p floats before what is seen, so that the photon flies on.
bool photon_is_seen(vec3 p, vec3 normal_ws, vec3 d, float slack_m, inout PhotonLanding landing) {
    vec4 q = u_raster_from_world * vec4(p, 1.0);
    vec2 px = q.xy / (q.w > 0.0 ? q.w : 1.0);
    if (q.w <= 0.0 || any(lessThan(px, vec2(0.0))) || any(greaterThanEqual(px, u_raster_size))) {
        landing.status = PHOTON_OUTSIDE;
        return false;
    }
    vec2 texel = floor(px);
    vec2 beside = sign(px - texel - 0.5);
    landing.status = PHOTON_UNSEEN;
    for (int k = 0; k < 4; ++k) {
        vec2 at = clamp(texel + beside * vec2(k & 1, k >> 1), vec2(0.0), u_raster_size - 1.0);
        vec4 stored = texelFetch(t_plane, ivec2(at), 0);
        landing.lookups += 1;
        if (stored.w <= 0.0) { if (k == 0) landing.status = 0; continue; }
        vec4 plane = photon_plane(stored);
        float gap = dot(plane.xyz, p) + plane.w;
        float tolerance = slack_m + photon_pixel_width(stored.w);
        if (abs(gap) < tolerance && abs(dot(plane.xyz, normal_ws)) > 0.6) {
            if (dot(plane.xyz, d) >= 0.0) { landing.status = PHOTON_UNSEEN; return false; }   // arrives at the other side
            landing.px = at;
            landing.per_m2 = photon_per_m2(at, stored.w, plane.xyz);
            landing.plane = plane;
            landing.width_m = photon_pixel_width(stored.w);
            landing.status = PHOTON_BY_LIGHT_VIEW;
            return true;
        }
        // A pixel whose centre shows what lies behind an edge gets all photons behind it, those that the edge hides too. With those beyond
        // the edge from the pixels beside it there would be a bright rim. Behind by little it is the other face of a convex edge.
        if (k == 0 && gap < -2.0 * tolerance) return false;
        if (k == 0 && gap > 0.0) landing.status = 0;
    }
    return false;
}

// Part of the ray within a view's picture and in front of it, metres along the ray; y <= x: none.
vec2 photon_clip(mat4 raster_from_world, vec2 size, bool orthographic, vec3 o, vec3 d, float t0, float t1) {
    vec4 q = raster_from_world * vec4(o, 1.0), dq = raster_from_world * vec4(d, 0.0);
    float near_w = orthographic ? 0.5 : 1e-3 * max(q.w, q.w + t1 * dq.w);
    float value[5] = float[5](q.w - near_w, q.x, size.x * q.w - q.x, q.y, size.y * q.w - q.y);
    float slope[5] = float[5](dq.w, dq.x, size.x * dq.w - dq.x, dq.y, size.y * dq.w - dq.y);
    for (int i = 0; i < 5; ++i) {
        if (abs(slope[i]) < 1e-20) { if (value[i] < 0.0) return vec2(1.0, 0.0); continue; }
        float at = -value[i] / slope[i];
        if (slope[i] > 0.0) t0 = max(t0, at); else t1 = min(t1, at);
    }
    return vec2(t0, t1);
}

// Marches from t0 on in the camera's view. True where the eye sees all of the ray from o to where that ends: what it found is certain.
// clear: up to where it sees all of it, metres along the ray.
bool photon_march(vec3 o, vec3 d, float t0, float t1, inout PhotonLanding landing, out float clear) {
    bool orthographic = u_camera_lens.z != 0.0, in_view;
    float u_clear;
    clear = 0.0;
    vec2 part = photon_clip(u_raster_from_world, u_raster_size, orthographic, o, d, t0, t1);
    landing.status = PHOTON_OUTSIDE;
    if (part.y <= part.x) return false;
    GlcRasterRay ray = glc_raster_ray(u_raster_from_world, u_raster_size, o + part.x * d, d, part.y - part.x);
#if DDA
    GlcSolve solve = glc_march_dda(t_depth_m, t_plane, orthographic, ray, u_view_steps, in_view, u_clear);
#else
    GlcSolve solve = glc_march_hierarchical(t_bounds, t_plane, ray, u_view_steps, in_view, u_clear);
#endif
    landing.lookups += solve.iterations;
    if (part.x <= 0.0) clear = glc_raster_distance(ray, u_clear);
    if (solve.status == GLC_SOLVE_HIT) {
        landing.t = part.x + glc_raster_distance(ray, solve.u);
        // The march takes the first texel whose plane the ray crosses within half a pixel of it, which depends on the cells it skipped:
        // the photon belongs to the pixel that it projects to, if that shows the same surface.
        vec3 end = ray.start + solve.u * ray.step;
        vec2 texel = clamp(floor(end.xy), vec2(0.0), u_raster_size - 1.0);
        vec4 stored = texelFetch(t_plane, ivec2(texel), 0);
        bool same = stored.w > 0.0 && abs(dot(photon_plane(stored), vec4(o + landing.t * d, 1.0))) < photon_pixel_width(stored.w);
        if (!same) {
            texel = solve.texel;
            stored = texelFetch(t_plane, ivec2(texel), 0);
        }
        landing.px = texel;
        landing.per_m2 = photon_per_m2(texel, stored.w, photon_plane(stored).xyz);
        landing.status = PHOTON_BY_EYE_VIEW;
        return in_view && part.x <= 0.0;
    } else if (in_view && clear >= 0.9999 * t1) {
        landing.status = PHOTON_LEFT;
        return true;
    } else if (solve.status == GLC_SOLVE_HIDDEN) {
        landing.status = PHOTON_UNSEEN;
    } else if (solve.status == GLC_SOLVE_DIVERGED) {
        landing.status = PHOTON_UNRESOLVED;
    }
    return false;
}

// Carries the light's end of the ray on to the tangent planes that the eye sees, where the light's view is the coarser one: Newton's
// method. True where it is settled: the photon landed, or the eye does not see its end. False: it floats before what the eye sees.
bool photon_refine(vec3 o, vec3 d, GlcHit hit, float slack, inout PhotonLanding landing) {
    vec3 p = hit.position_ws, n = hit.normal_ws;
    landing.t = hit.t;
    for (int i = 0; i < 4; ++i) {
        if (!photon_is_seen(p, n, d, slack, landing)) break;
        n = landing.plane.xyz;
        float gap = dot(n, p) + landing.plane.w, towards = -dot(n, d);
        slack = abs(gap) / max(towards, 1e-3);
        if (slack < 0.1 * landing.width_m || i == 3) break;
        landing.t += gap / max(towards, 1e-3);
        p = o + landing.t * d;
    }
    return landing.status != 0;
}

// Neither view knows. In front of all that the light sees, up to the end of the receivers, means out of the scene.
void photon_give_up(GlcHit hit, inout PhotonLanding landing) {
    if (hit.status == GLC_LEFT) landing.status = PHOTON_LEFT;
    else if (landing.status != PHOTON_UNRESOLVED) landing.status = PHOTON_HIDDEN;
}

// hit: the light view's answer on o + t d; slack_m: how exactly it knows surfaces (half a texel); t_max: end of the receivers' box.
PhotonLanding photon_land(vec3 o, vec3 d, GlcHit hit, float slack_m, float t_max) {
    PhotonLanding landing = PhotonLanding(vec2(0.0), 0.0, hit.t, 0, 0, vec4(0.0), 0.0);
    bool found = hit.status > 0;
    if (found && photon_refine(o, d, hit, slack_m, landing)) return landing;
#if FIRST
    landing.status = PHOTON_TODO;
    return landing;
#endif
    float clear;
    photon_march(o, d, found ? max(hit.t - 4.0 * slack_m, 0.0) : 0.0, t_max, landing, clear);
    if (landing.status <= 0 && !found) photon_give_up(hit, landing);
    return landing;
}
