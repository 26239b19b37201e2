// What water, glass and mirrors show: the camera's specular layer over the shaded opaque layer. Exact Fresnel, Beer-Lambert
// absorption and the radiance scale (n_from/n_to)^2 at every interface that the eye ray crosses (pbrt-v4, sec. 9.5.2). Rays are
// followed in screen space, see trace.glsl. The cascade's first stage (FINAL 0) leaves black what it did not solve, and leaves out
// reflections that count; its last stage (FINISH) adds both, where t_todo says.
#include "passes/refraction/surface.glsl"
#include "passes/refraction/trace.glsl"
#if HAS_SOLID
#include "passes/refraction/solid.glsl"
#endif

// Shares of the reflection below which the sky stands for what a march would find, faded in between.
const float REFLECT_FROM = 0.07, REFLECT_TO = 0.16;

// The refracted ray, from where it leaves what is solid. d: unit, behind the surface. False: it is still held inside.
bool refracted_ray(Surface at, inout vec3 p, inout vec3 d, inout vec3 tint, out GlcRasterRay ray) {
    bool leaves = true;
#if HAS_SOLID
    if (at.object.kind == GLC_SOLID && (HAS_EYE_MEDIUM == 0 || !at.from_dense)) {
        leaves = solid_through(p, d, at.eta, at.object.sigma_a, tint);
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
        ray = pixel_ray(at.depth_m, d, room);
    }
    return leaves;
}

// Both ways put together, with what the media on them absorb. behind: radiance from there, Fresnel included; behind_m: of the way.
vec3 shown(Surface at, vec3 reflection, vec3 behind, float behind_m) {
#if HAS_EYE_MEDIUM
    // Beyond an interface its own medium; around a solid, the eye's; out of the eye's medium, air.
    vec3 near = glc_eye_transmittance(v_uv, at.depth_m, u_bounds_min_ws, u_bounds_max_ws);
    vec3 far_sigma_a = at.from_dense ? vec3(0.0) : (at.object.kind == GLC_INTERFACE ? at.object.sigma_a : u_eye_sigma_a);
    return near * (reflection + glc_transmittance(far_sigma_a, behind_m) * behind);
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
    vec3 mirror_d;
    vec3 weight;         // of the mirrored way
    float share;         // the same, of a dielectric
};

Rays rays_of(Surface at) {
    Rays rays;
    rays.share = glc_fresnel_dielectric(at.cos_i, at.eta);
    rays.weight = at.mirror ? glc_fresnel_metal(at.object.base_color, at.cos_i) : vec3(rays.share);
    rays.reflects = at.mirror || rays.share > REFLECT_FROM;
    rays.mirror_d = reflect(at.v, at.n);
    rays.refracts = glc_refract(at.v, at.n, at.eta, rays.d) && !at.mirror;
#if FINISH
    rays.refracts = rays.refracts && texelFetch(t_todo, ivec2(gl_FragCoord.xy), 0).r > 1.5 * GLC_TODO_REFLECTION;
#endif
    rays.leaves = true;
    rays.p = at.p;
    rays.tint = vec3((1.0 - rays.share) * at.object.transmission);
    if (rays.refracts) rays.leaves = refracted_ray(at, rays.p, rays.d, rays.tint, rays.ray);
    return rays;
}

// What reaches the eye of the mirrored way, before the medium that the eye is in absorbs it up to the surface.
vec3 mirrored(Surface at, Rays rays, Seen seen) {
#if HAS_EYE_MEDIUM
    seen.radiance *= glc_transmittance(u_eye_sigma_a, seen.distance_m);
#else
    if (at.from_dense) seen.radiance *= glc_transmittance(at.object.sigma_a, seen.distance_m);
#endif
    float found = at.mirror ? 1.0 : smoothstep(REFLECT_FROM, REFLECT_TO, rays.share);
    return rays.weight * mix(glc_sky_radiance(rays.mirror_d), seen.radiance, found);
}

#if USE_MARCH
// The refracted ray, the mirrored one, or both in turn: one loop, so that pixels with one of either kind march together. A mirror
// shows the mirrored one. reflection_m: to where that was solved; 0: it was not.
void look_everywhere(Surface at, Rays rays, float from, inout Seen seen, inout vec3 reflection, out float reflection_m) {
    GlcRasterRay mirror_ray = pixel_ray(at.depth_m, rays.mirror_d, glc_box_exit(at.p, rays.mirror_d, u_bounds_min_ws, u_bounds_max_ws));
    GlcRasterRay ray = mirror_ray;
    bool refracted = rays.refracts;
    if (refracted) ray = rays.ray;
    reflection_m = 0.0;
    for (;;) {
        Seen found = look_along(ray, at.p, refracted ? rays.d : rays.mirror_d, refracted ? from : 0.0, !refracted);
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

void main() {
    Surface at = surface_at(ivec2(gl_FragCoord.xy));
    Rays rays = rays_of(at);
    const Seen NOTHING = Seen(vec3(0.0), vec3(0.0), 0.0, vec2(0.0), 0.0, 0.0, GLC_VIEW_OPAQUE);
    Seen seen = Seen(vec3(0.0), vec3(0.0), 0.0, v_uv, 0.0, 0.0, at.mirror ? GLC_VIEW_SKY : GLC_VIEW_TIR);
    vec3 reflection = rays.weight * glc_sky_radiance(rays.mirror_d);
    float todo = GLC_TODO_NOTHING, reflection_m = 0.0;
#if USE_MARCH
    float from = 0.0;
#if FINISH
    if (rays.refracts) from = clear_u(texelFetch(t_todo, ivec2(gl_FragCoord.xy), 0).r, rays.ray);
    else seen = NOTHING;   // is there already
#endif
    look_everywhere(at, rays, from, seen, reflection, reflection_m);
    if (rays.refracts && !rays.leaves) seen.status = GLC_VIEW_TIR;
#else
    float clear_px = 0.0;
    bool solved = true;
    if (rays.refracts) seen = look_through(rays.ray, rays.p, rays.d, solved, clear_px);
    if (rays.refracts && !rays.leaves) seen.status = GLC_VIEW_TIR;
#if !FINAL
    if (!solved || at.mirror) seen = NOTHING;
    if (!solved || rays.reflects) reflection = vec3(0.0);
    todo = solved ? (rays.reflects ? GLC_TODO_REFLECTION : GLC_TODO_NOTHING) : todo_from(clear_px);
#endif
#endif
    seen.radiance = shown(at, reflection, rays.refracts ? rays.tint * seen.radiance : vec3(0.0), seen.distance_m);
    write_view(seen, todo, FINISH == 1 ? 0.0 : 1.0, reflection_m);
}
