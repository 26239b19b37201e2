// Where the refracted ray of the first specular surface meets one of another object before it meets anything opaque: there the same
// shading goes on (refraction.frag, CONTINUED). Of the first surface only its reflection is left in the view, or left to do.
uniform sampler2D t_opaque_plane;
uniform sampler2D t_opaque_bounds;
#include "passes/refraction/rays.glsl"
#include "passes/refraction/media.glsl"

#if !EXITS_UNDER
uniform sampler2D t_behind_plane;    // the second layer's planes, the first one's where there is none
uniform sampler2D t_behind_normal;
#endif
uniform sampler2D t_behind_bounds;
#if HAS_SOLID
uniform sampler2D t_behind_back;     // of its solids, the back faces' planes
uniform sampler2D t_turned_plane;    // the same as met from behind
uniform sampler2D t_turned_bounds;
uniform sampler2D t_turned_normal;
#endif
layout(location = LOCATION_POINT) out vec4 o_point;   // world space, metres; w: what the ray runs in there, MEDIUM_*
layout(location = LOCATION_WAY) out vec4 o_way;       // unit direction; w: of the surface met, as in the layer's normals
layout(location = LOCATION_SHARE) out vec4 o_share;   // of what that shows, how much the eye sees

const int OWN_TRIES = 3;
// A solid's exit and a mirror that touches it differ by rounding: look this part of the depth before the exit, too.
const float TOUCHING = 2e-4;
const float RIM_SLACK = 0.5;         // of a rim's thickness
const float FLAT_PX = 16.0, FLAT_COSINE = 0.9999;

// The planes of a solid's rim run on before and behind it: a ray that meets them beyond its other side passes beside it.
bool stands_at(GlcRasterRay ray, vec2 texel, float u) {
#if HAS_SOLID
    float far_m = texelFetch(t_behind_back, ivec2(texel), 0).w;
    float near_m = texelFetch(t_behind_plane, ivec2(texel), 0).w;
    float s = ray.start.z + u * ray.step.z, slack_m = RIM_SLACK * (far_m - near_m);
    float depth_m = ORTHOGRAPHIC == 1 ? -s : 1.0 / s;
    if (far_m > 0.0) return depth_m <= far_m + slack_m && depth_m >= near_m - slack_m;
#endif
    return true;
}

// Beyond the picture's border a surface that is flat there goes on. A curved one ends: neither its sides nor its exit can be guessed.
bool goes_on_beyond(GlcRasterRay ray, float own, out vec4 met, out float u) {
    vec2 px = clamp(ray.start.xy + ray.u_screen * ray.step.xy, vec2(0.5), u_raster_size - 0.5);
    vec2 f = glc_raster_plane(ray, texelFetch(t_behind_plane, ivec2(px), 0));
    met = texelFetch(t_behind_normal, ivec2(px), 0);
    u = f.x / (f.y < 0.0 ? f.y : -1e-30);
    vec2 inward = px - FLAT_PX * ray.step.xy / max(length(ray.step.xy), 1e-6);
    vec4 within = texelFetch(t_behind_normal, ivec2(clamp(inward, vec2(0.5), u_raster_size - 0.5)), 0);
    if (within.w != met.w || dot(within.xyz, met.xyz) < FLAT_COSINE) return false;
    return met.w != 0.0 && abs(met.w) != own && u >= ray.u_screen && u <= 1.0;
}

// own: object index + 1 of the surface that the ray comes from: meeting that again is another matter. w of met: as in the normals; u:
// along the ray.
bool meets_second(GlcRasterRay ray, float own, out vec4 met, out float u) {
    met = vec4(0.0);
    u = 0.0;
    float from = 0.0, pixel = 1.0 / max(max(abs(ray.step.x), abs(ray.step.y)), 1e-6);
    for (int i = 0; i < OWN_TRIES && from < ray.u_screen; ++i) {
        GlcRasterRay part = ray;
        part.start = ray.start + from * ray.step;
        part.step = (1.0 - from) * ray.step;
        part.u_screen = (ray.u_screen - from) / (1.0 - from);
        GlcSolve solve = glc_march_hierarchical(t_behind_bounds, t_behind_plane, part, u_refraction_steps);
        if (solve.status == GLC_SOLVE_OFFSCREEN) return goes_on_beyond(ray, own, met, u);
        if (solve.status != GLC_SOLVE_HIT) return false;
        u = from + (1.0 - from) * solve.u;
        met = texelFetch(t_behind_normal, ivec2(solve.texel), 0);
        if (met.w != 0.0 && abs(met.w) != own && stands_at(ray, solve.texel, u)) return true;
        from = u + pixel;
    }
    return false;
}

#if HAS_SOLID
// The limb of a solid that the eye does not see, since only bent rays come down on it: met from behind.
bool meets_limb(GlcRasterRay ray, float own, out vec4 met, out float u) {
    GlcRasterRay turned = ray;
    turned.start.z = -ray.start.z;
    turned.step.z = -ray.step.z;
    GlcSolve solve = glc_march_hierarchical(t_turned_bounds, t_turned_plane, turned, u_refraction_steps);
    u = solve.u;
    vec2 texel = solve.texel;
    met = texelFetch(t_turned_normal, ivec2(texel), 0);
    if (met.w == 0.0) {   // the texel beside the outline
        texel = clamp(texel + 0.5 + 1.4 * ray.step.xy / max(length(ray.step.xy), 1e-6), vec2(0.0), u_raster_size - 0.001);
        met = texelFetch(t_turned_normal, ivec2(texel), 0);
    }
    return solve.status == GLC_SOLVE_HIT && met.w != 0.0 && abs(met.w) != own && stands_at(ray, texel, u);
}
#endif

// Whether something opaque stands before the end of a ray.
bool is_hidden(GlcRasterRay ray, float u) {
    GlcRasterRay way = ray;
    way.step *= u;
    way.u_screen = min(ray.u_screen / u, 1.0);
    return glc_march_hierarchical(t_opaque_bounds, t_opaque_plane, way, u_refraction_steps).status == GLC_SOLVE_HIT;
}

#if NESTED
// What stands within a closed solid, liquids in their glasses too: metres from p on to a solid or mirror before the exit; 0: none.
float solid_holds(vec3 p, vec3 d, float own, out vec4 met) {
    vec3 exit_ws, n;
    float t, u;
    solid_exit(p, d, 0.0, exit_ws, n, t);
    GlcRasterRay ray = glc_raster_ray(u_raster_from_world, u_raster_size, p, d, t);
    if (!meets_second(ray, own, met, u)) return 0.0;
#if OPAQUE_INSIDE
    if (is_hidden(ray, u)) return 0.0;
#endif
    return glc_object(int(abs(met.w) + 0.5) - 1).kind == GLC_INTERFACE ? 0.0 : glc_raster_distance(ray, u);
}
#endif

// The first surface's part of the view, without what is behind it.
void leave_reflection(Surface at, Rays rays) {
    vec3 reflection = rays.weight * glc_sky_radiance(rays.mirror_d);
    float todo = GLC_TODO_NOTHING, reflection_m;
    Seen none = Seen(vec3(0.0), vec3(0.0), 0.0, vec2(0.0), 0.0, 0.0, GLC_VIEW_OPAQUE), seen = none;
#if USE_MARCH
    rays.refracts = false;
    look_everywhere(at, rays, seen, reflection, reflection_m);
#elif !FINAL
    if (rays.reflects) {
        reflection = vec3(0.0);
        todo = GLC_TODO_REFLECTION;
    }
#endif
    none.radiance = shown(at, reflection, vec3(0.0), 0.0, 0.0);
    write_view(none, todo, 1.0, 0.0);
}

void main() {
    Surface at = surface_at(ivec2(gl_FragCoord.xy));
    if (at.mirror) discard;
    Rays rays = rays_of(at);
    float own = texelFetch(t_specular_normal, ivec2(gl_FragCoord.xy), 0).w;
    float on_m = 0.0;
    vec4 met;
#if NESTED
    vec3 d;
    if (at.object.kind == GLC_SOLID && !at.from_dense && glc_refract(at.v, at.n, at.eta, d)) on_m = solid_holds(at.p, d, abs(own), met);
    if (on_m > 0.0) {
        vec3 tint = (1.0 - rays.share) * at.object.transmission * glc_transmittance(at.object.sigma_a, on_m) / (at.eta * at.eta);
        o_point = vec4(at.p + on_m * d, abs(own));
        o_way = vec4(d, met.w);
        o_share = vec4(shown(at, vec3(0.0), tint, 0.0, 0.0), 1.0);
    } else
#endif
    {
        float u;
        vec3 from = at.object.kind == GLC_SOLID ? rays.p - TOUCHING * at.depth_m * rays.d : rays.p;
        GlcRasterRay ray = eye_ray(from, rays.d);
        if (!rays.refracts || !rays.leaves || rays.under == ENDS_INSIDE) discard;
        bool meets = meets_second(ray, abs(own), met, u);
#if HAS_SOLID
        if (!meets) meets = meets_limb(ray, abs(own), met, u);
#endif
        if (!meets || is_hidden(ray, u)) discard;
        on_m = glc_raster_distance(ray, u);
        bool solid = at.object.kind == GLC_SOLID && !at.from_dense;
        float medium = solid ? (rays.under > 0.0 ? rays.under : MEDIUM_OF_EYE) : (at.from_dense ? MEDIUM_AIR : abs(own));
        o_point = vec4(from + on_m * rays.d, medium);
        o_way = vec4(rays.d, met.w);
        o_share = vec4(shown(at, vec3(0.0), rays.tint, on_m, rays.under), 1.0);
    }
    leave_reflection(at, rays);
}
