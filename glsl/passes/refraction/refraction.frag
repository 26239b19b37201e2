// What water, glass and mirrors show: the camera's specular layer over the shaded opaque layer. Exact Fresnel, Beer-Lambert
// absorption and the radiance scale (n_from/n_to)^2 at every interface that the eye ray crosses (pbrt-v4, sec. 9.5.2). Rays are
// followed in screen space, see trace.glsl. The cascade's first stage (FINAL 0) leaves black what it did not solve, and leaves out
// reflections that count; its last stage (FINISH) adds both, where t_todo says.
// CONTINUED: the surface is the one that a ray behind the first one met (behind.frag), and what it shows is added.
#include "passes/refraction/rays.glsl"

#if HAS_BEHIND
uniform float u_widest;              // object index + 1 of the widest specular object in the picture: the others lie within u_others_px
uniform vec4 u_others_px;

// Whether the way of the refracted ray, to where it was solved or to its end, touches the pixels of objects other than its own.
float may_meet_others(Rays rays, Seen seen) {
    if (!rays.refracts) return 0.0;
    if (abs(texelFetch(t_specular_normal, ivec2(gl_FragCoord.xy), 0).w) != u_widest) return 1.0;
    bool ends = seen.status == GLC_VIEW_NEWTON || seen.status == GLC_VIEW_MARCHED;
    vec2 end = ends ? seen.uv * u_raster_size : (rays.ray.start + rays.ray.u_screen * rays.ray.step).xy;
    vec2 least = min(min(gl_FragCoord.xy, rays.ray.start.xy), end) - 1.0, most = max(max(gl_FragCoord.xy, rays.ray.start.xy), end) + 1.0;
    return all(lessThan(least, u_others_px.zw)) && all(greaterThan(most, u_others_px.xy)) ? 1.0 : 0.0;
}
#endif

void main() {
#if CONTINUED
    Surface at = continued_surface(ivec2(gl_FragCoord.xy));
#else
    Surface at = surface_at(ivec2(gl_FragCoord.xy));
#endif
    Rays rays = rays_of(at);
    const Seen NOTHING = Seen(vec3(0.0), vec3(0.0), 0.0, vec2(0.0), 0.0, 0.0, GLC_VIEW_OPAQUE);
    Seen seen = Seen(vec3(0.0), vec3(0.0), 0.0, v_uv, 0.0, 0.0, at.mirror ? GLC_VIEW_SKY : GLC_VIEW_TIR);
    vec3 reflection = rays.weight * glc_sky_radiance(rays.mirror_d);
    float todo = GLC_TODO_NOTHING, reflection_m = 0.0;
#if USE_MARCH
#if FINISH
    if (!rays.refracts) seen = NOTHING;   // is there already
#endif
    look_everywhere(at, rays, seen, reflection, reflection_m);
    if (rays.refracts && !rays.leaves) seen.status = GLC_VIEW_TIR;
#else
    bool solved = true;
    if (rays.refracts) seen = look_through(rays.ray, rays.p, rays.d, rays.ending, solved);
    if (rays.refracts && !rays.leaves) seen.status = GLC_VIEW_TIR;
#if !FINAL
    if (!solved || at.mirror) seen = NOTHING;
    if (!solved || rays.reflects) reflection = vec3(0.0);
    todo = solved ? (rays.reflects ? GLC_TODO_REFLECTION : GLC_TODO_NOTHING) : GLC_TODO_ALL;
#endif
#endif
#if HAS_BEHIND
    o_behind = may_meet_others(rays, seen);
#endif
    seen.radiance = shown(at, reflection, rays.refracts ? rays.tint * seen.radiance : vec3(0.0), seen.distance_m, rays.under);
    write_view(seen, todo, FINISH + CONTINUED > 0 ? 0.0 : 1.0, reflection_m);
}
