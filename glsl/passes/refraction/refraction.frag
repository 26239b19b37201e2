// What water, glass and mirrors show: the camera's specular layer over the shaded opaque layer. Exact Fresnel, Beer-Lambert
// absorption and the radiance scale (n_from/n_to)^2 at every interface that the eye ray crosses (pbrt-v4, sec. 9.5.2). Rays are
// followed in screen space, see trace.glsl. The first stage leaves pixels to do
// (FINAL 0): reflections that count (REFLECTION: added as the difference to the sky that it put there), and unsolved ones, done anew.
#include "common/optics.glsl"
#include "interface/camera.glsl"
#include "interface/objects.glsl"
#include "passes/refraction/trace.glsl"

uniform sampler2D t_specular_depth_m;
uniform sampler2D t_specular_normal;
#if HAS_SOLID
#include "passes/refraction/solid.glsl"
#endif

#if HAS_EYE_MEDIUM
#include "passes/refraction/eye_medium.glsl"
#endif


#if ONE_OBJECT
// A scene with one specular object, of this kind: its material without a fetch.
uniform vec3 u_one_ior;
uniform vec3 u_one_sigma_a;
uniform float u_one_transmission;
#endif

in vec2 v_uv;
in vec3 v_ray_ws;

// Shares of the reflection below which the sky stands for what a march would find, faded in between.
const float REFLECT_FROM = 0.07, REFLECT_TO = 0.16;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float depth_m = texelFetch(t_specular_depth_m, pixel, 0).r;
    vec4 stored = texelFetch(t_specular_normal, pixel, 0);
#if ONE_OBJECT
    GlcObject object = GlcObject(vec3(1.0), ONE_OBJECT, u_one_ior, 0.0, u_one_sigma_a, u_one_transmission);
#else
    GlcObject object = glc_object(int(abs(stored.w) + 0.5) - 1);
#endif
#if ORTHOGRAPHIC
    vec3 p = glc_camera_position_ws(v_uv, depth_m);
    vec3 v = glc_camera_ray_ws(v_uv);
#else
    vec3 p = u_world_from_camera[3].xyz + depth_m * v_ray_ws;
    vec3 v = normalize(v_ray_ws);
#endif
    vec3 n = stored.xyz;
    // A shading normal that leans away from the eye would reflect into the surface: bring it back to grazing.
    float cos_i = -dot(n, v);
    if (cos_i < 0.02) { n = normalize(n - v * (0.02 - cos_i)); cos_i = max(-dot(n, v), 0.02); }

#if HAS_MIRROR
    if (object.kind == GLC_MIRROR) {
#if REFLECTION
        write_view(Seen(vec3(0.0), vec3(0.0), 0.0, v_uv, 0.0, 0.0, GLC_VIEW_OPAQUE), GLC_TODO_NOTHING);   // done already
        return;
#endif
        Seen mirror = look_along(p, reflect(v, n), u_reflection_steps);
#if HAS_EYE_MEDIUM
        mirror.radiance *= glc_eye_transmittance(v_uv, depth_m, u_bounds_min_ws, u_bounds_max_ws) * glc_transmittance(u_eye_sigma_a, mirror.distance_m);
#endif
        mirror.radiance *= glc_fresnel_metal(object.base_color, cos_i);
        write_view(mirror, GLC_TODO_ALL);
        return;
    }
#endif
#if HAS_EYE_MEDIUM
    bool from_dense = stored.w < 0.0 && (object.kind == GLC_INTERFACE || -stored.w == u_eye_solid);
    float eta = from_dense ? 1.0 / object.ior.g : object.ior.g / u_eye_ior;
    vec3 near = glc_eye_transmittance(v_uv, depth_m, u_bounds_min_ws, u_bounds_max_ws);
#else
    bool from_dense = object.kind == GLC_INTERFACE && stored.w < 0.0;
    float eta = from_dense ? 1.0 / object.ior.g : object.ior.g;
#endif
    float share = glc_fresnel_dielectric(cos_i, eta);
    vec3 reflected = reflect(v, n);
    vec3 reflection = share * glc_sky_radiance(reflected);
    // Absorption: under water from the eye to the surface, over it along the refracted ray; solids count their own way.
    float absorbing_m = from_dense ? length(p - u_world_from_camera[3].xyz) : 0.0;
#if USE_MARCH && !RETRY
    {
        Seen seen = look_along(p, reflected, share > REFLECT_FROM ? u_reflection_steps : 0);
#if HAS_EYE_MEDIUM
        seen.radiance *= glc_transmittance(u_eye_sigma_a, seen.distance_m);
#else
        if (from_dense) seen.radiance *= glc_transmittance(object.sigma_a, seen.distance_m);
#endif
        vec3 marched = mix(reflection, share * seen.radiance, smoothstep(REFLECT_FROM, REFLECT_TO, share));
#if REFLECTION
        // Added to what the first stage wrote with the sky in the mirror.
#if HAS_EYE_MEDIUM
        seen.radiance = near * (marched - reflection);
#else
        seen.radiance = glc_transmittance(object.sigma_a, absorbing_m) * (marched - reflection);
#endif
        write_view(seen, GLC_TODO_NOTHING);
        return;
#endif
        reflection = marched;
    }
#endif
#if !REFLECTION
    vec3 d;
    bool solved = true;
    Seen through = Seen(vec3(0.0), vec3(0.0), 0.0, v_uv, 0.0, 0.0, GLC_VIEW_TIR);
    vec3 refraction = vec3(0.0);
    if (glc_refract(v, n, eta, d)) {
        vec3 tint = vec3((1.0 - share) * object.transmission);
        GlcRasterRay ray;
        bool leaves = true;
#if HAS_SOLID
#if HAS_EYE_MEDIUM
        if (object.kind == GLC_SOLID && !from_dense) {
            leaves = solid_through(p, d, eta, object.sigma_a, tint);
#else
        if (object.kind == GLC_SOLID) {
            leaves = solid_through(p, d, object.ior.g, object.sigma_a, tint);
#endif
            ray = eye_ray(p, d);
        } else
#endif
        {
            tint /= eta * eta;   // radiance behind the interface is larger by (n_behind / n_eye)^2
            float w = ORTHOGRAPHIC == 1 ? 1.0 : depth_m;
            vec3 start = vec3(gl_FragCoord.xy, ORTHOGRAPHIC == 1 ? -depth_m : 1.0 / depth_m);
#if FINAL
            float room = glc_box_exit(p, d, u_bounds_min_ws, u_bounds_max_ws);
#else
            float room = u_bounds_diagonal_m;   // long enough; where the scene ends matters to the final stage alone
#endif
            ray = glc_raster_ray_from(u_raster_from_world, u_raster_size, start, w, d, room);
        }
        through = look_through(ray, p, d, solved);
        if (object.kind == GLC_INTERFACE && !from_dense) absorbing_m = through.distance_m;
        if (!leaves) through.status = GLC_VIEW_TIR;
        refraction = tint * through.radiance;
    }
#if HAS_EYE_MEDIUM
    // Beyond an interface its own medium; around a solid, the eye's; out of the eye's medium, air.
    vec3 far_sigma_a = from_dense ? vec3(0.0) : (object.kind == GLC_INTERFACE ? object.sigma_a : u_eye_sigma_a);
    through.radiance = near * (reflection + glc_transmittance(far_sigma_a, through.distance_m) * refraction);
#else
    vec3 held = object.kind == GLC_INTERFACE ? glc_transmittance(object.sigma_a, absorbing_m) : vec3(1.0);
    through.radiance = from_dense ? held * (reflection + refraction) : reflection + held * refraction;
#endif
    write_view(through, solved ? (share > REFLECT_FROM ? GLC_TODO_REFLECTION : GLC_TODO_NOTHING) : GLC_TODO_ALL);
#endif
}
