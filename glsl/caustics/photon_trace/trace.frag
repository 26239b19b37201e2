// Cascaded image-space photon tracing (Meenrattanakorn & Lambers 2022): one fragment a photon. It starts at a point that the light
// sees of a specular surface, is refracted or reflected, and followed through the light's view, then through the camera's.
// BRANCH: GLC_REFLECT, GLC_THROUGH (an open interface) or GLC_IN_AND_OUT (a solid's two). CHANCE 1: Fresnel's equations decide which of
// the branches a photon takes (theirs); 0: every photon takes all, weighted: less noise for more work.
// FIRST 1: only what the first estimate settles; the others are left to a second stage by a depth mask.
#define GLC_REFLECT 0
#define GLC_THROUGH 1
#define GLC_IN_AND_OUT 2

#include "common/solid_path.glsl"
#include "interface/receiver_view.glsl"
#include "interface/light.glsl"
#include "interface/objects.glsl"
#include "caustics/photon_trace/sample.glsl"
#if BRANCH == GLC_REFLECT
#include "caustics/photon_trace/reflected.glsl"
#else
#include "caustics/photon_trace/land.glsl"
uniform sampler2D t_receiver_position;
uniform sampler2D t_receiver_normal;
#endif

uniform vec3 u_bounds_min_ws;      // box around all receivers
uniform vec3 u_bounds_max_ws;
#if BRANCH == GLC_IN_AND_OUT
uniform sampler2D t_back_position;
uniform sampler2D t_back_normal;
#endif
uniform vec3 u_channels;           // 1 for the colour channels that this branch carries, else 0
uniform int u_channel;             // channel whose index of refraction is used
uniform int u_max_iterations;
uniform int u_march_steps;
uniform uint u_frame;
uniform float u_luminance_cutoff;  // photons that keep less of the light's luminance are not traced (theirs, sec. 3.1: 0.04)
uniform float u_roughness_cutoff;  // nor those of rougher surfaces (theirs: 0.3)

layout(location = 0) out vec4 o_landing;  // xy: pixel; z: 1 / area of the receiver in it, 1/m^2; w: status (land.glsl; 0 = no photon)
layout(location = 1) out vec4 o_flux;     // rgb: flux (carried, or lost when status < 0), W or lm; w: look-ups

#define PHOTON_DARK -5
#define PHOTON_SECOND_HIT -7
#define PHOTON_DIM -12
#define PHOTON_ROUGH -13
const float STEEPEST = 8.0;        // largest weight of a jittered light point (see below)
const int ESTIMATE = GLC_HYBRID;

#if BRANCH == GLC_IN_AND_OUT
#include "caustics/shared/solid_way.glsl"
#endif

float photon_luminance(vec3 flux) {
    return dot(flux, vec3(0.2126, 0.7152, 0.0722));
}

vec3 stratum_flux(GlcView view, vec3 p_ws, vec3 d) {
    float texels = view.size.x * view.size.y / float(u_photon_grid.x * u_photon_grid.y);
    if (u_light.w == 0.0) return u_light_intensity * (view.texel_measure * texels);
    return u_light_intensity * (glc_light_cone(d) * glc_texel_solid_angle(view, p_ws) * texels);
}

// Reflected and transmitted share of the flux; ior: of the channel that decides the direction.
void split(GlcObject object, float n_dot_l, float eta, out vec3 reflected, out float transmitted) {
    bool mirror = object.kind == GLC_MIRROR;
    float r = glc_fresnel_dielectric(n_dot_l, eta);
    reflected = mirror ? glc_fresnel_metal(object.base_color, n_dot_l) : vec3(r);
    transmitted = mirror ? 0.0 : (1.0 - r) * object.transmission;
}

void trace() {
    uvec2 cell = uvec2(gl_FragCoord.xy);
    vec3 xi = glc_stratum_point(cell, u_seed, u_sequence);
    GlcView caster_view = glc_caster_view();
    vec2 uv = (vec2(cell) + xi.xy) / vec2(u_photon_grid);
    float density = photon_warp(uv);
    vec2 at = min(uv * caster_view.size, caster_view.size - 0.001);
    PhotonStart start = photon_start(at);
    if (start.object < 0) return;
    GlcObject object = glc_object(start.object);
#if BRANCH == GLC_THROUGH
    if (object.kind != GLC_INTERFACE) return;
#elif BRANCH == GLC_IN_AND_OUT
    if (object.kind != GLC_SOLID) return;
#endif
    vec3 p = start.position_ws;
    vec3 d = glc_light_direction(caster_view, p);
    bool from_dense = object.kind == GLC_INTERFACE && start.side < 0.0;
    vec3 n = glc_met_normal(start.normal_ws * (start.side < 0.0 ? -1.0 : 1.0), d);
    float n_dot_l = -dot(n, d);
    vec3 flux = stratum_flux(caster_view, p, d) * u_channels / density;
    if (max(flux.r, max(flux.g, flux.b)) <= 0.0) return;   // outside of a spot's cone
    float light_luminance = photon_luminance(flux) / (u_light.w == 0.0 ? 1.0 : glc_light_cone(d));
#if SIZED
    // The photon starts where the light's centre sees the caster, and comes from another point of the light. At grazing incidence the
    // weight grows without bound; cutting it costs what falls on the last tan^2 / 64 of the silhouette.
    vec3 to_centre = d;
    d = glc_light_jitter(p, to_centre, glc_cell_point(cell, u_frame, u_seed, 0));
    float jittered_dot_l = -dot(n, d);
    if (jittered_dot_l <= 0.0) return;   // this point of the light has set
    flux *= min(jittered_dot_l / (n_dot_l * dot(d, to_centre)), STEEPEST);
    n_dot_l = jittered_dot_l;
#endif
    float ior = object.ior[u_channel];
    float eta = from_dense ? 1.0 / ior : ior;
    if (from_dense && u_light.w != 0.0) flux *= glc_transmittance(object.sigma_a, length(p - u_light.xyz));

    vec3 surface_n = n;
    float alpha = object.roughness * object.roughness;
#if ROUGH
    if (alpha > 0.0) {
        n = glc_ggx_visible_normal(n, -d, alpha, glc_cell_point(cell, u_frame, u_seed, 1));
        n_dot_l = -dot(n, d);
    }
#endif
    vec3 reflected;
    float transmitted;
    split(object, n_dot_l, eta, reflected, transmitted);
#if CHANCE
    float chance = object.kind == GLC_MIRROR ? 1.0 : reflected.g;
    bool is_reflected = xi.z < chance;
    if (is_reflected != (BRANCH == GLC_REFLECT)) return;
    flux /= is_reflected ? chance : 1.0 - chance;
#endif
    vec3 arriving = flux;
    flux *= BRANCH == GLC_REFLECT ? reflected : vec3(transmitted);
    bool is_rough = object.roughness > u_roughness_cutoff;
    if (is_rough || photon_luminance(flux) < u_luminance_cutoff * light_luminance) {
        o_landing.w = float(is_rough ? PHOTON_ROUGH : PHOTON_DIM);
        o_flux.rgb = flux;
        return;
    }
    vec3 ray = reflect(d, n);
    float iterations = 0.0;
#if BRANCH == GLC_REFLECT
    bool in_absorber = from_dense;
#else
    if (!glc_refract(d, n, eta, ray)) {
#if !REFLECTION_FOLLOWED   // else another branch carries it
        o_landing.w = float(GLC_TIR);
        o_flux.rgb = arriving;
#endif
        return;
    }
    bool in_absorber = object.kind == GLC_INTERFACE && !from_dense;
#endif
#if ROUGH
    if (alpha > 0.0) {
        float cos_out = dot(ray, surface_n) * (BRANCH == GLC_REFLECT ? 1.0 : -1.0);
        if (cos_out <= 0.0) { o_landing.w = float(GLC_BETWEEN_FACETS); o_flux.rgb = flux; return; }
        flux *= glc_ggx_visible_share(cos_out, alpha);
    }
#endif
#if BRANCH == GLC_IN_AND_OUT
    SolidWay way = SolidWay(p, ray, flux, float(start.object + 1), object.sigma_a, ior, alpha, glc_cell_point(cell, u_frame, u_seed, 2),
                            0, 0, 0.0, GlcHit(0.0, p, -ray, 0, GLC_LEFT));
    int passed = pass_solids(caster_view, glc_receiver_view(), way);
    p = way.p_ws;
    ray = way.ray;
    flux = way.flux;
    iterations = way.iterations;
    if (passed < 0) { o_landing.w = float(passed); o_flux = vec4(flux, iterations); return; }
#endif
    if (max(flux.r, max(flux.g, flux.b)) <= 0.0) { o_landing.w = float(PHOTON_DARK); return; }

    float t_max = glc_box_exit(p, ray, u_bounds_min_ws, u_bounds_max_ws);
    if (t_max <= 0.0) { o_landing.w = float(PHOTON_LEFT); o_flux = vec4(flux, iterations); return; }
#if BRANCH == GLC_REFLECT
    PhotonLanding landing = photon_land_reflected(p, ray, t_max);
#else
    GlcView receiver_view = glc_receiver_view();
    GlcHit hit;
#if BRANCH == GLC_IN_AND_OUT && (LAYERS == 2 || RECEIVERS_INSIDE)
    hit = way.landed;
    p = passed == GLC_LANDED ? hit.position_ws - hit.t * ray : p;
    if (passed != GLC_LANDED)
#endif
    hit = glc_intersect(t_receiver_position, t_receiver_normal, receiver_view, p, ray, t_max, ESTIMATE, u_max_iterations,
                        FIRST == 1 ? 0 : u_march_steps);
    float slack_m = 0.5 * glc_texel_width(receiver_view, hit.status > 0 ? hit.position_ws : p);
    PhotonLanding landing = photon_land(p, ray, hit, slack_m, t_max);
    iterations += float(hit.iterations);
#endif
    iterations += float(landing.lookups);
#if HAS_MIRROR
    // Light that meets a second mirror on its way is another path (L S S D), which the photons do not follow.
    if (landing.status > 0 && object.kind == GLC_MIRROR) {
        vec3 lifted = p + surface_n * (2.0 * glc_texel_width(caster_view, p));
        GlcHit second = glc_intersect_march(t_caster_position, t_caster_normal, caster_view, lifted, ray, landing.t, u_march_steps);
        iterations += float(second.iterations);
        if (second.status > 0) landing.status = PHOTON_SECOND_HIT;
    }
#endif
    if (in_absorber && landing.status > 0) flux *= glc_transmittance(object.sigma_a, landing.t);
    o_landing = vec4(landing.px, landing.per_m2, float(landing.status));
    o_flux = vec4(flux, iterations);
}

void main() {
    o_landing = vec4(0.0);
    o_flux = vec4(0.0);
    trace();
#if FIRST
    gl_FragDepth = o_landing.w == float(PHOTON_TODO) ? 1.0 : 0.0;
#endif
}
