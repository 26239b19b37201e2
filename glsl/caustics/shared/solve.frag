// Caustics mapping (Shah, Konttinen, Pattanaik 2007), one fragment a texel of the casters' light view: the light that meets the
// specular surface in this texel is refracted (or reflected), its landing point found, its flux weighed. They displace a
// vertex grid in the vertex shader; a fragment solves the same and leaves it in a texture, which the splat and the statistics share.
//
// Flux of a texel: exact, E_perp x cross-section or I x solid angle. NAIVE_FLUX 1 is their eq. 6, N.L / V, the baseline.
// BRANCH: GLC_REFLECT, GLC_THROUGH (an open interface) or GLC_IN_AND_OUT (a solid's two).
#define ROUGH 0   // all surfaces are taken for smooth
#define GLC_REFLECT 0
#define GLC_THROUGH 1
#define GLC_IN_AND_OUT 2

#include "common/solid_path.glsl"
#include "interface/caster_view.glsl"
#include "interface/receiver_view.glsl"
#include "interface/light.glsl"
#include "interface/objects.glsl"

uniform sampler2D t_caster_position;
uniform sampler2D t_caster_normal;
uniform sampler2D t_receiver_position;
uniform sampler2D t_receiver_normal;
#if BRANCH == GLC_IN_AND_OUT
uniform sampler2D t_back_position;
uniform sampler2D t_back_normal;
#endif
uniform vec3 u_bounds_min_ws;      // box around all receivers
uniform vec3 u_bounds_max_ws;
uniform vec3 u_channels;           // 1 for the colour channels that this branch carries, else 0
uniform int u_channel;             // channel whose index of refraction is used
uniform int u_max_iterations;
uniform int u_march_steps;
#if BRANCH == GLC_IN_AND_OUT
#include "caustics/shared/solid_way.glsl"
#endif
#if NAIVE_FLUX
uniform float u_inverse_texels;    // 1 / V: number of texels the casters cover
uniform float u_caster_area_m2;    // total flux is kept comparable: E_perp x this
#endif

layout(location = 0) out vec4 o_landing;  // xyz: landing point, metres, world; w: status (intersect.glsl; GLC_TIR; 0 = no caster), where it lands plus 2 x path
layout(location = 1) out vec4 o_flux;     // rgb: flux (carried, or lost when status < 0), W or lm; w: look-ups

#define GLC_DARK -5
#define GLC_SECOND_HIT -7

vec3 texel_flux(GlcView view, vec3 p_ws, vec3 d, float n_dot_l) {
#if NAIVE_FLUX
    return u_light_intensity * u_caster_area_m2 * n_dot_l * u_inverse_texels;
#else
    if (u_light.w == 0.0) return u_light_intensity * view.texel_measure;
    return u_light_intensity * glc_light_cone(d) * glc_texel_solid_angle(view, p_ws);
#endif
}

void main() {
    o_landing = vec4(0.0);
    o_flux = vec4(0.0);
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 caster = texelFetch(t_caster_position, texel, 0);
    if (caster.w == 0.0) return;
    GlcObject object = glc_object(int(caster.w + 0.5) - 1);
#if BRANCH == GLC_THROUGH
    if (object.kind != GLC_INTERFACE) return;
#elif BRANCH == GLC_IN_AND_OUT
    if (object.kind != GLC_SOLID) return;
#endif
    GlcView caster_view = glc_caster_view();
    GlcView receiver_view = glc_receiver_view();
    vec4 stored_normal = texelFetch(t_caster_normal, texel, 0);
    vec3 p = caster.xyz;
    vec3 d = glc_light_direction(caster_view, p);

    // The side the light is on decides which medium it comes from.
    bool from_dense = object.kind == GLC_INTERFACE && stored_normal.w < 0.0;
    vec3 n = glc_met_normal(stored_normal.xyz * (stored_normal.w < 0.0 ? -1.0 : 1.0), d);
    float n_dot_l = -dot(n, d);
    vec3 flux = texel_flux(caster_view, p, d, max(n_dot_l, 0.0)) * u_channels;
    float ior = object.ior[u_channel];
    float eta = from_dense ? 1.0 / ior : ior;
    if (from_dense && u_light.w != 0.0) flux *= glc_transmittance(object.sigma_a, length(p - u_light.xyz));

    vec3 ray = reflect(d, n);
    float iterations = 0.0, path = 0.0;
#if BRANCH == GLC_REFLECT
    vec3 reflectance = object.kind == GLC_MIRROR ? glc_fresnel_metal(object.base_color, n_dot_l)
                                                 : vec3(glc_fresnel_dielectric(n_dot_l, eta));
    flux *= reflectance;
    bool in_absorber = from_dense;
#else
    float transmitted_share = (1.0 - glc_fresnel_dielectric(n_dot_l, eta)) * object.transmission;
    if (!glc_refract(d, n, eta, ray)) {
#if !REFLECTION_FOLLOWED   // else another branch carries it
        o_landing.w = float(GLC_TIR);
        o_flux.rgb = flux;
#endif
        return;
    }
    flux *= transmitted_share;
    bool in_absorber = object.kind == GLC_INTERFACE && !from_dense;
#if BRANCH == GLC_IN_AND_OUT
    SolidWay way = SolidWay(p, ray, flux, caster.w, object.sigma_a, ior, 0.0, vec2(0.0), 0, 0, 0.0, GlcHit(0.0, p, -ray, 0, GLC_LEFT));
    int passed = pass_solids(caster_view, receiver_view, way);
    p = way.p_ws;
    ray = way.ray;
    flux = way.flux;
    iterations = way.iterations;
    path = float(min(way.reflections, 7) + 8 * min(way.solids, 7));
    if (passed < 0) { o_landing.w = float(passed); o_flux = vec4(flux, iterations); return; }
#endif
#endif
    if (max(flux.r, max(flux.g, flux.b)) <= 0.0) { o_landing.w = float(GLC_DARK); return; }

    float t_max = glc_box_exit(p, ray, u_bounds_min_ws, u_bounds_max_ws);
    GlcHit hit = GlcHit(0.0, p, -ray, 0, GLC_LEFT);
#if BRANCH == GLC_IN_AND_OUT
    hit = way.landed;
    if (passed != GLC_LANDED)
#endif
    if (t_max > 0.0) {
#if BRANCH == GLC_REFLECT
        // A reflected ray leaves the light's direction altogether: the fixed point has no reason to contract there.
        if (ESTIMATE == GLC_HYBRID)
            hit = glc_intersect_march(t_receiver_position, t_receiver_normal, receiver_view, p, ray, t_max, u_march_steps);
        else
#endif
        hit = glc_intersect(t_receiver_position, t_receiver_normal, receiver_view, p, ray, t_max, ESTIMATE, u_max_iterations,
                            u_march_steps);
    }
#if HAS_MIRROR
    // Light that meets a second mirror on its way is another path (L S S D), which this map does not follow.
    if (hit.status > 0 && object.kind == GLC_MIRROR) {
        vec3 lifted = p + n * (2.0 * glc_texel_width(caster_view, p));
        GlcHit second = glc_intersect_march(t_caster_position, t_caster_normal, caster_view, lifted, ray, hit.t, u_march_steps);
        iterations += float(second.iterations);
        if (second.status > 0) hit.status = GLC_SECOND_HIT;
    }
#endif
    if (in_absorber && hit.status > 0) flux *= glc_transmittance(object.sigma_a, hit.t);
    // The map stores the side that the light sees: what arrives at the other side of an opaque surface stays there.
    vec3 direct = glc_light_direction(receiver_view, hit.position_ws);
    if (hit.status > 0 && dot(hit.normal_ws, ray) * dot(hit.normal_ws, direct) < 0.0) hit.status = GLC_HIDDEN;
    o_landing = vec4(hit.position_ws, float(hit.status) + (hit.status > 0 ? 2.0 * path : 0.0));
    o_flux = vec4(flux, iterations + float(hit.iterations));
}
