// Photons that a surface throws back. They leave the light's direction altogether, so that both views have to be marched.
// The camera's comes first: a ray that the eye sees from its start to where it meets a surface has nothing in its way, and the light
// need not be asked. Meenrattanakorn & Lambers 2022, sec. 3.2, march the light's view first.
#include "caustics/photon_trace/land.glsl"
#include "interface/receiver_view.glsl"

uniform sampler2D t_light_plane;      // of the receivers' view, in its raster space
#if DDA
uniform sampler2D t_light_depth_m;
#else
uniform sampler2D t_light_bounds;
#endif
uniform mat4 u_receiver_raster_from_world;   // of a single frustum; cube faces make their own

// Raster space of the face of the receivers' view that sees p: see common/raster_ray.glsl; xy within the face.
mat4 photon_face_raster(GlcView view, vec2 face_size, vec3 p) {
#if RECEIVER_FACES == 1
    return u_receiver_raster_from_world;
#else
    vec3 right, up, forward;
    glc_cube_axes(glc_view_face(view, p), right, up, forward);
    vec3 x = 0.5 * face_size.x * (right + forward), y = 0.5 * face_size.y * (up + forward);
    vec3 c = view.light.xyz;
    return transpose(mat4(vec4(x, -dot(x, c)), vec4(y, -dot(y, c)), vec4(0.0, 0.0, 0.0, 1.0), vec4(forward, -dot(forward, c))));
#endif
}

// Where the ray meets what the light sees, from t on: no surface is stepped over, however thin.
GlcHit photon_march_light(GlcView view, vec3 o, vec3 d, float t, float t_max) {
    GlcHit hit = GlcHit(0.0, o, -d, 0, GLC_LEFT);
#if RECEIVER_FACES == 1
    vec2 face_size = view.size;
    bool orthographic = view.light.w == 0.0;
#else
    vec2 face_size = view.size / vec2(3.0, 2.0);
    const bool orthographic = false;
#endif
    // A straight line crosses the faces of a cube at most four times.
    for (int piece = 0; piece < (RECEIVER_FACES == 1 ? 1 : 5) && t < t_max && hit.status <= 0; ++piece) {
        vec3 inside = o + (RECEIVER_FACES == 1 ? 0.0 : t + 1e-4 * t_max) * d;
        mat4 raster = photon_face_raster(view, face_size, inside);
        vec2 part = photon_clip(raster, face_size, orthographic, o, d, t, t_max);
        t = RECEIVER_FACES == 1 ? t_max : max(part.y, t + 1e-4 * t_max);
        if (part.y <= part.x) continue;
        GlcRasterRay ray = glc_raster_ray(raster, face_size, o + part.x * d, d, part.y - part.x);
        vec2 corner = vec2(0.0);
#if RECEIVER_FACES == 6
        int face = glc_view_face(view, inside);
        corner = vec2(face % 3, face / 3) * face_size;
        ray.start.xy += corner;
#endif
#if DDA
        GlcSolve solve = glc_march_dda(t_light_depth_m, t_light_plane, orthographic, ray, u_view_steps);
#else
        GlcSolve solve = glc_march_hierarchical(t_light_bounds, t_light_plane, ray, u_view_steps);
#endif
        hit.iterations += solve.iterations;
        hit.status = solve.status == GLC_SOLVE_HIDDEN ? GLC_HIDDEN : (solve.status == GLC_SOLVE_DIVERGED ? GLC_UNCONVERGED : GLC_LEFT);
        if (solve.status != GLC_SOLVE_HIT) continue;
        vec4 stored = texelFetch(t_light_plane, ivec2(solve.texel), 0);
        stored.z += dot(stored.xy, corner);   // the plane in the face's own pixels
        vec4 plane = vec4(-stored.xy, 1.0, -stored.z) * raster;
        hit.t = part.x + glc_raster_distance(ray, solve.u);
        hit.position_ws = o + hit.t * d;
        hit.normal_ws = glc_safe_normalize(plane.xyz, -d);
        hit.status = GLC_BRACKETED;
    }
    return hit;
}

PhotonLanding photon_land_reflected(vec3 o, vec3 d, float t_max) {
    PhotonLanding landing = PhotonLanding(vec2(0.0), 0.0, 0.0, 0, 0, vec4(0.0), 0.0);
    float clear;
    if (photon_march(o, d, 0.0, t_max, landing, clear)) return landing;
    PhotonLanding eye = landing;
    GlcView view = glc_receiver_view();
    GlcHit hit = photon_march_light(view, o, d, clear, eye.status > 0 ? eye.t : t_max);
    bool found = hit.status > 0;
    landing.lookups += hit.iterations;
    eye.lookups = landing.lookups;
    if (found && photon_refine(o, d, hit, 0.5 * glc_texel_width(view, hit.position_ws), landing)) return landing;
    if (eye.status <= 0 && !found) photon_give_up(hit, eye);
    return eye;
}
