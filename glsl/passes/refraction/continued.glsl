#include "passes/refraction/media.glsl"

// Where behind.frag found a second specular surface.
uniform sampler2D t_point;           // world space, metres; w: what the ray runs in there, MEDIUM_*
uniform sampler2D t_way;             // its unit direction; w: of the surface, as in the layer's normals
uniform sampler2D t_share;           // of what it shows, how much the eye sees
uniform sampler2D t_first_plane;
uniform sampler2D t_first_normal;

const int SURFACE_ITERATIONS = 6;
const float LIMB_PX = 24.0;           // of way within a solid that was entered from behind, to look for the exit from

// The layer's normal at a point, filtered over the texels of the surface that was met (w, as stored; limb: of a solid's far side).
vec3 second_normal(vec3 p, float w, bool limb, vec3 fallback) {
    vec4 q = u_raster_from_world * vec4(p, 1.0);
    vec2 at = q.xy / q.w - 0.5, first = floor(at), part = at - first;
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 corner = vec2(i & 1, i >> 1);
        ivec2 texel = ivec2(clamp(first + corner, vec2(0.0), u_raster_size - 1.0));
        vec4 stored = texelFetch(t_specular_normal, texel, 0);
#if HAS_SOLID
        if (limb) stored = texelFetch(t_back_normal, texel, 0) * vec4(-1.0, -1.0, -1.0, 1.0);
#endif
        vec2 share = mix(1.0 - part, part, corner);
        sum += stored.w == w ? (share.x * share.y + 1e-6) * stored.xyz : vec3(0.0);
    }
    return glc_safe_normalize(sum, fallback);
}

Medium medium_of(float code) {
#if HAS_EYE_MEDIUM
    if (code == MEDIUM_OF_EYE) return Medium(u_eye_sigma_a, u_eye_ior, u_eye_solid);
#endif
    if (code <= 0.0) return Medium(vec3(0.0), 1.0, 0.0);
    GlcObject object = glc_object(int(code + 0.5) - 1);
    return Medium(object.sigma_a, object.ior.g, object.kind == GLC_SOLID ? code : 0.0);
}

Surface continued_surface(ivec2 pixel) {
    vec4 point = texelFetch(t_point, pixel, 0), way = texelFetch(t_way, pixel, 0);
    Surface at;
    at.p = point.xyz;
    at.v = way.xyz;
    at.depth_m = 0.0;
    at.before = medium_of(point.w);
    at.around = at.before;
    at.contained = point.w > 0.0 && at.before.solid > 0.0;
    if (at.contained) at.around = medium_of(MEDIUM_OF_EYE);
    at.carries = texelFetch(t_share, pixel, 0).rgb;
    // A solid's far side, met from outside: the way in starts a little behind it.
    bool limb = way.w < 0.0 && -way.w != at.before.solid && glc_object(int(0.5 - way.w) - 1).kind == GLC_SOLID;
    at.limb_m = 0.0;
    set_surface(at, vec4(second_normal(at.p, way.w, limb, -at.v), way.w));
    if (limb) {
        vec4 q = u_raster_from_world * vec4(at.p, 1.0);
        at.limb_m = LIMB_PX * 2.0 * u_camera_lens.y / u_raster_size.y * (ORTHOGRAPHIC == 1 ? 1.0 : q.w);
    }
    return at;
}

// Where a ray below the first surface, an interface, comes up to it: distance and normal, against the ray. Beside the picture the
// pixel's own part of it goes on as a plane. False where the ray goes down, or is in no interface's medium.
bool first_surface(vec3 p, vec3 d, float medium, out vec3 n, out float t) {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 own = texelFetch(t_first_normal, pixel, 0);
    vec3 own_ws = glc_camera_position_ws((vec2(pixel) + 0.5) / u_raster_size, texelFetch(t_first_plane, pixel, 0).w);
    n = -own.xyz;
    t = dot(own_ws - p, own.xyz) / max(dot(d, own.xyz), 1e-6);
    if (own.w != medium || dot(d, own.xyz) <= 0.0 || t <= 0.0) return false;
    GlcRasterRay ray = eye_ray(p, d);
    GlcSolve solve = glc_newton(t_first_plane, ray, -1.0, SURFACE_ITERATIONS);
    vec4 met = texelFetch(t_first_normal, ivec2(solve.texel), 0);
    if (solve.status == GLC_SOLVE_HIT && met.w == medium && dot(met.xyz, d) > 0.0) {
        n = -met.xyz;
        t = glc_raster_distance(ray, solve.u);
    }
    return true;
}

// A mirrored ray on its way up.
struct Upward {
    bool met;            // it came up to the first surface
    bool over;           // and left the medium there
    float way_m;         // to there
    vec3 carries;
};

#if HAS_SOLID
// Where a mirrored ray comes back through the first surface's solid, a window before a mirror: in by the far side, out by the near one.
// Moves p and d to the way out; false where it passes beside that.
bool back_through_first(inout vec3 p, inout vec3 d, float around_ior, out float t, out vec3 carries) {
    t = 0.0;
    carries = vec3(1.0);
    float own = texelFetch(t_first_normal, ivec2(gl_FragCoord.xy), 0).w;
    GlcRasterRay ray = eye_ray(p, d);
    GlcSolve far = glc_newton(t_first_back_plane, ray, -1.0, SURFACE_ITERATIONS);
    vec4 stored = texelFetch(t_first_back_normal, ivec2(far.texel), 0);
    GlcObject object = glc_object(int(abs(own) + 0.5) - 1);
    if (own == 0.0 || object.kind != GLC_SOLID || far.status != GLC_SOLVE_HIT || abs(stored.w) != abs(own)) return false;
    t = glc_raster_distance(ray, far.u);
    vec3 n = dot(stored.xyz, d) > 0.0 ? -stored.xyz : stored.xyz, inside, onward;
    float eta = object.ior.g / around_ior;
    glc_refract(d, n, eta, inside);
    vec3 entry = p + t * d;
    ray = eye_ray(entry, inside);
    GlcSolve near = glc_newton(t_first_plane, ray, -1.0, SURFACE_ITERATIONS);
    vec4 front = texelFetch(t_first_normal, ivec2(near.texel), 0);
    vec3 m = dot(front.xyz, inside) > 0.0 ? -front.xyz : front.xyz;
    if (near.status != GLC_SOLVE_HIT || front.w != own || !glc_refract(inside, m, 1.0 / eta, onward)) return false;
    float inside_m = glc_raster_distance(ray, near.u);
    carries = object.transmission * glc_transmittance(object.sigma_a, inside_m);
    carries *= (1.0 - glc_fresnel_dielectric(-dot(n, d), eta)) * (1.0 - glc_fresnel_dielectric(-dot(m, inside), 1.0 / eta));
    p = entry + inside_m * inside;
    d = onward;
    return true;
}
#endif

// Whether a mirrored ray comes up to the first surface before it has met anything: `ray` goes on beyond it then, or is reflected down.
// Else `found` is what it shows, and distance_m what of its way lies in the medium.
bool comes_up(Surface at, inout Seen found, inout Upward upward, inout GlcRasterRay ray, inout vec3 d) {
    float medium = texelFetch(t_point, ivec2(gl_FragCoord.xy), 0).w, t;
    vec3 n, onward;
    bool meets = found.status == GLC_VIEW_MARCHED || found.status == GLC_VIEW_SECOND;
    bool rises = !upward.met && first_surface(at.p, d, medium, n, t) && !(meets && found.distance_m <= t);
#if HAS_SOLID
    vec3 p = at.p, back = d, carries;
    if (!upward.met && medium <= 0.0 && back_through_first(p, back, at.before.ior, t, carries) && !(meets && found.distance_m <= t)) {
        upward = Upward(true, false, t, carries);
        d = back;
        ray = eye_ray(p, d);
        return true;
    }
#endif
    if (!rises) {
        found.radiance *= upward.carries;
        found.distance_m = upward.way_m + (upward.over ? 0.0 : found.distance_m);
        return false;
    }
    upward = Upward(true, glc_refract(d, n, 1.0 / at.before.ior, onward), t, vec3(1.0));
    // Radiance below is larger by n^2.
    if (upward.over) upward.carries *= at.before.ior * at.before.ior * (1.0 - glc_fresnel_dielectric(-dot(n, d), 1.0 / at.before.ior));
    ray = eye_ray(at.p + t * d, onward);
    d = onward;
    return true;
}
