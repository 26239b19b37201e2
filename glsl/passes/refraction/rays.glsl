// Where the rays of a specular surface go, and what the eye sees of that.
#include "passes/refraction/trace.glsl"
#include "passes/refraction/surface.glsl"
#if HAS_SOLID
#include "passes/refraction/solid.glsl"
#endif
#if CONTINUED
#include "passes/refraction/continued.glsl"
#endif

// Shares of the reflection below which the sky stands for what a march would find, faded in between.
const float REFLECT_FROM = 0.07, REFLECT_TO = 0.16;

#if FINISH
uniform sampler2D t_todo;
#endif

// A ray from the surface.
GlcRasterRay surface_ray(Surface at, vec3 d, float room_m) {
#if CONTINUED
    return glc_raster_ray(u_raster_from_world, u_raster_size, at.p, d, room_m);
#else
    return pixel_ray(at.depth_m, d, room_m);
#endif
}

// The refracted ray, from where it leaves what is solid. d: unit, behind the surface. under: object index + 1 of the interface that a
// solid is left below, or 0; ENDS_INSIDE: as ending says. False: it is still held inside.
bool refracted_ray(Surface at, inout vec3 p, inout vec3 d, inout vec3 tint, out GlcRasterRay ray, out float under, out Ending ending) {
    bool leaves = true;
    under = 0.0;
    ending = NO_ENDING;
#if HAS_SOLID
    if (at.object.kind == GLC_SOLID && !at.from_dense) {
#if HAS_MEDIA
        float outside = at.around.ior / at.before.ior, limb_m = at.limb_m;
#if CONTINUED && NESTED
        if (at.contained) under = CONTAINED;
#endif
#else
        float outside = 1.0;
        const float limb_m = 0.0;
#endif
        leaves = solid_through(p, d, limb_m, at.object.ior.g, at.eta, at.object.sigma_a, tint, outside, under, ending);
        tint /= outside * outside;
#if CONTINUED && NESTED
        if (leaves && under == CONTAINED) leaves = leave_first(p, d, at.around.ior / at.before.ior, at.before.sigma_a, tint, under, ending);
#endif
        ray = eye_ray(p, d);
    } else
#endif
    {
        tint /= at.eta * at.eta;   // radiance behind the interface is larger by (n_behind / n_eye)^2
#if FINAL
        float room = glc_box_exit(p, d, u_bounds_min_ws, u_bounds_max_ws);
#else
        float room = u_bounds_diagonal_m;   // long enough; where the scene ends matters to the final stage alone
#endif
        ray = surface_ray(at, d, room);
    }
    return leaves;
}

// Both ways put together, with what the media on them absorb. behind: radiance from there, Fresnel included; behind_m: of the way;
// under: as of `refracted_ray`.
vec3 shown(Surface at, vec3 reflection, vec3 behind, float behind_m, float under) {
#if EXITS_UNDER
    if (under > 0.0) behind *= glc_transmittance(glc_object(int(under + 0.5) - 1).sigma_a, behind_m);
#endif
#if HAS_MEDIA
    // Beyond an interface its own medium; around a solid, what it stands in; out of the eye's medium, air.
    vec3 far_sigma_a = at.object.kind == GLC_INTERFACE ? at.object.sigma_a : at.around.sigma_a;
    if (at.from_dense || under > 0.0 || under == ENDS_INSIDE) far_sigma_a = vec3(0.0);
    return at.carries * (reflection + glc_transmittance(far_sigma_a, behind_m) * behind);
#else
    // Under water from the eye to the surface, over it along the refracted ray; solids count their own way.
    float absorbing_m = at.from_dense ? length(at.p - u_world_from_camera[3].xyz) : behind_m;
    vec3 held = at.object.kind == GLC_INTERFACE ? glc_transmittance(at.object.sigma_a, absorbing_m) : vec3(1.0);
    return at.from_dense ? held * (reflection + behind) : reflection + held * behind;
#endif
}

// Where the pixel's rays begin: the refracted one, tinted by what it crosses, and the mirrored one.
struct Rays {
    bool refracts;
    bool reflects;       // a mirrored ray that counts
    bool leaves;         // the refracted ray gets out of what is solid
    vec3 p;              // of the refracted ray, metres
    vec3 d;
    vec3 tint;
    GlcRasterRay ray;
    float under;         // object index + 1 of the interface that it leaves a solid below, or 0; ENDS_INSIDE
    Ending ending;
    vec3 mirror_d;
    vec3 weight;         // of the mirrored way
    float share;         // the same, of a dielectric
};

Rays rays_of(Surface at) {
    Rays rays;
    float cos_t = glc_cos_transmitted(at.cos_i, at.eta);
    rays.share = glc_fresnel_dielectric(at.cos_i, cos_t, at.eta);
    rays.weight = at.mirror ? glc_fresnel_metal(at.object.base_color, at.cos_i) : vec3(rays.share);
    rays.reflects = at.mirror || rays.share > REFLECT_FROM;
    rays.mirror_d = reflect(at.v, at.n);
    rays.refracts = cos_t > 0.0 && !at.mirror;
    rays.d = (at.v + at.cos_i * at.n) / at.eta - cos_t * at.n;
#if FINISH
    rays.refracts = rays.refracts && texelFetch(t_todo, ivec2(gl_FragCoord.xy), 0).r > 0.5 * (GLC_TODO_REFLECTION + GLC_TODO_ALL);
#endif
    rays.leaves = true;
    rays.under = 0.0;
    rays.ending = NO_ENDING;
    rays.p = at.p;
    rays.tint = vec3((1.0 - rays.share) * at.object.transmission);
    if (rays.refracts) rays.leaves = refracted_ray(at, rays.p, rays.d, rays.tint, rays.ray, rays.under, rays.ending);
    return rays;
}

// What reaches the eye of the mirrored way, before the medium that the eye is in absorbs it up to the surface.
vec3 mirrored(Surface at, Rays rays, Seen seen) {
#if HAS_MEDIA
    seen.radiance *= glc_transmittance(at.before.sigma_a, seen.distance_m);
#else
    if (at.from_dense) seen.radiance *= glc_transmittance(at.object.sigma_a, seen.distance_m);
#endif
    float found = at.mirror ? 1.0 : smoothstep(REFLECT_FROM, REFLECT_TO, rays.share);
    return rays.weight * mix(glc_sky_radiance(rays.mirror_d), seen.radiance, found);
}

#if USE_MARCH
// The refracted ray, the mirrored one, or both in turn: one loop, so that pixels with one of either kind march together. A mirror
// shows the mirrored one. reflection_m: to where that was solved; 0: it was not.
void look_everywhere(Surface at, Rays rays, inout Seen seen, inout vec3 reflection, out float reflection_m) {
    GlcRasterRay mirror_ray = surface_ray(at, rays.mirror_d, glc_box_exit(at.p, rays.mirror_d, u_bounds_min_ws, u_bounds_max_ws));
    GlcRasterRay ray = mirror_ray;
    vec3 mirror_d = rays.mirror_d;
    bool refracted = rays.refracts;
    if (refracted) ray = rays.ray;
    reflection_m = 0.0;
#if CONTINUED
    Upward upward = Upward(false, false, 0.0, vec3(1.0));
#endif
    for (;;) {
        Seen found = look_along(ray, at.p, refracted ? rays.d : mirror_d, !refracted, rays.ending);
#if CONTINUED
        if (!refracted && comes_up(at, found, upward, ray, mirror_d)) continue;
#endif
        if (refracted || at.mirror) seen = found;
        if (!refracted) {
            reflection = mirrored(at, rays, found);
            reflection_m = found.status == GLC_VIEW_MARCHED ? found.distance_m : 0.0;
        }
        if (!refracted || !rays.reflects) break;
        refracted = false;
        ray = mirror_ray;
    }
}
#endif
