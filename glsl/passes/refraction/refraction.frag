// What water, glass and mirrors show: the camera's specular layer over the shaded opaque layer. Exact Fresnel, Beer-Lambert absorption
// and the radiance scale (n_from/n_to)^2 at every interface that the eye ray crosses (pbrt-v4, sec. 9.5.2). The refracted ray
// is followed in screen space: Sousa 2005's offset, with the offset taken from the refracted ray and improved by a fixed point.
#include "common/optics.glsl"
#include "common/intersect_box.glsl"
#include "interface/camera.glsl"
#include "interface/objects.glsl"
#include "interface/sky.glsl"

uniform sampler2D t_radiance;
uniform sampler2D t_opaque_depth_m;
uniform sampler2D t_specular_depth_m;
uniform sampler2D t_specular_normal;
#if HAS_BACK
uniform sampler2D t_back_depth_m;
uniform sampler2D t_back_normal;
#endif
#if HAS_CAUSTICS_VIEW
uniform sampler2D t_caustics;
#endif
uniform vec3 u_bounds_min_ws;
uniform vec3 u_bounds_max_ws;
uniform int u_refraction_iterations;
uniform int u_reflection_steps;

in vec2 v_uv;
#if HAS_RADIANCE
layout(location = LOCATION_RADIANCE) out vec4 o_radiance;
#endif
#if HAS_CAUSTICS_VIEW
layout(location = LOCATION_CAUSTICS_VIEW) out vec4 o_caustics;   // E_c at the first non-specular surface of the eye's path
#endif
#if HAS_STATUS
layout(location = LOCATION_STATUS) out float o_status;           // see GLC_VIEW_*
#endif

#define GLC_VIEW_OPAQUE 0.0
#define GLC_VIEW_SOLVED 1.0
#define GLC_VIEW_SKY 2.0
#define GLC_VIEW_FALLBACK 3.0   // Sousa: the unperturbed pixel
#define GLC_VIEW_TIR 4.0

struct Seen {
    vec3 radiance;
    vec3 caustics;
    float distance_m;
    float status;
};

Seen seen_at(vec2 uv, float distance_m, float status) {
    Seen seen = Seen(textureLod(t_radiance, uv, 0.0).rgb, vec3(0.0), distance_m, status);
#if HAS_CAUSTICS_VIEW
    seen.caustics = textureLod(t_caustics, uv, 0.0).rgb;
#endif
    return seen;
}

Seen seen_sky(vec3 d, float distance_m) {
    return Seen(glc_sky_radiance(d), vec3(0.0), distance_m, GLC_VIEW_SKY);
}

bool on_screen(vec3 projected) {
    return projected.z > 0.0 && all(greaterThanEqual(projected.xy, vec2(0.0))) && all(lessThan(projected.xy, vec2(1.0)));
}

float opaque_depth(vec2 uv) {
    return texelFetch(t_opaque_depth_m, ivec2(uv * vec2(textureSize(t_opaque_depth_m, 0))), 0).r;
}

// The opaque layer along a refracted ray. min_depth_m: depth of the interface; nearer samples stand before it.
Seen look_through(vec3 p, vec3 d, float min_depth_m, vec2 uv_straight) {
    float straight = opaque_depth(uv_straight);
    float room = glc_box_exit(p, d, u_bounds_min_ws, u_bounds_max_ws);
    vec3 behind = glc_camera_position_ws(uv_straight, straight > 0.0 ? straight : min_depth_m + room);
    float t = straight > 0.0 ? length(behind - p) : room;
    float best_gap = 1e30;
    vec2 best_uv = uv_straight;
    float best_t = t;
    bool found = false, sky = false;
    for (int i = 0; i < u_refraction_iterations; ++i) {
        vec3 q = p + t * d;
        vec3 projected = glc_camera_project(q);
        if (!on_screen(projected)) break;
        float depth_m = opaque_depth(projected.xy);
        if (depth_m <= 0.0) { sky = true; break; }
        sky = false;
        if (depth_m < min_depth_m) break;
        vec3 x = glc_camera_position_ws(projected.xy, depth_m);
        float gap = length(x - q);
        if (gap < best_gap) { best_gap = gap; best_uv = projected.xy; best_t = t; found = true; }
        t = length(x - p);
    }
    if (found && best_gap < 0.25 * best_t) return seen_at(best_uv, best_t, GLC_VIEW_SOLVED);
    if (sky) return seen_sky(d, room);
    if (found) return seen_at(best_uv, best_t, GLC_VIEW_FALLBACK);
    if (straight <= 0.0) return seen_sky(d, room);
    return seen_at(uv_straight, length(behind - p), GLC_VIEW_FALLBACK);
}

// The opaque layer along a reflected ray: a coarse march over the screen, then bisection; else the sky.
Seen look_along(vec3 p, vec3 d) {
    float room = glc_box_exit(p, d, u_bounds_min_ws, u_bounds_max_ws);
    float t_before = 0.0;
    for (int i = 1; i <= u_reflection_steps; ++i) {
        float s = float(i) / float(u_reflection_steps);
        float t = room * s * s;                     // denser near the mirror
        vec3 projected = glc_camera_project(p + t * d);
        if (!on_screen(projected)) break;
        float depth_m = opaque_depth(projected.xy);
        if (depth_m > 0.0 && projected.z > depth_m) {
            float lo = t_before, hi = t;
            for (int k = 0; k < 6; ++k) {
                float mid = 0.5 * (lo + hi);
                vec3 at = glc_camera_project(p + mid * d);
                float stored = opaque_depth(at.xy);
                if (stored > 0.0 && at.z > stored) hi = mid; else lo = mid;
            }
            vec3 at = glc_camera_project(p + hi * d);
            float stored = opaque_depth(at.xy);
            if (on_screen(at) && abs(at.z - stored) < 0.1 * (hi - 0.0) + 0.02 * at.z) return seen_at(at.xy, hi, GLC_VIEW_SOLVED);
        }
        t_before = t;
    }
    return seen_sky(d, room);
}

#if HAS_BACK
// Where the ray leaves the solid, by its back faces in the camera's view (Wyman 2005, with the exit iterated).
bool solid_exit(vec3 p, vec3 d, vec2 uv, float object_w, out vec3 exit_ws, out vec3 n_inward, out float t) {
    t = 0.0;
    bool found = false;
    vec2 size = vec2(textureSize(t_back_depth_m, 0));
    vec2 at = uv;
    exit_ws = p;
    n_inward = -d;
    for (int i = 0; i < 5; ++i) {
        float depth_m = texelFetch(t_back_depth_m, ivec2(at * size), 0).r;
        if (depth_m <= 0.0) break;
        vec4 n = texelFetch(t_back_normal, ivec2(at * size), 0);
        vec3 x = glc_camera_position_ws((floor(at * size) + 0.5) / size, depth_m);
        float d_n = dot(d, n.xyz);
        float plane = d_n < -0.05 ? dot(x - p, n.xyz) / d_n : length(x - p);
        t = plane > 0.0 ? plane : length(x - p);
        found = true;
        exit_ws = p + t * d;
        n_inward = n.xyz;
        vec3 projected = glc_camera_project(exit_ws);
        if (!on_screen(projected)) break;
        at = projected.xy;
    }
    return found;
}
#endif

void write(vec3 radiance, vec3 caustics, float status) {
#if HAS_RADIANCE
    o_radiance = vec4(radiance, 1.0);
#endif
#if HAS_CAUSTICS_VIEW
    o_caustics = vec4(caustics, 1.0);
#endif
#if HAS_STATUS
    o_status = status;
#endif
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float depth_m = texelFetch(t_specular_depth_m, pixel, 0).r;
    if (depth_m <= 0.0) {
        Seen plain = seen_at(v_uv, 0.0, GLC_VIEW_OPAQUE);
        write(plain.radiance, plain.caustics, plain.status);
        return;
    }
    vec4 stored = texelFetch(t_specular_normal, pixel, 0);
    GlcObject object = glc_object(int(abs(stored.w) + 0.5) - 1);
    bool front = stored.w > 0.0;
    vec3 p = glc_camera_position_ws(v_uv, depth_m);
    vec3 v = glc_camera_ray_ws(v_uv);
    vec3 n = stored.xyz;
    // A shading normal that leans away from the eye would reflect into the surface: bring it back to grazing.
    float cos_i = -dot(n, v);
    if (cos_i < 0.02) { n = normalize(n - v * (0.02 - cos_i)); cos_i = max(-dot(n, v), 0.02); }

    if (object.kind == GLC_MIRROR) {
        Seen mirror = look_along(p, reflect(v, n));
        vec3 f = glc_fresnel_metal(object.base_color, cos_i);
        write(f * mirror.radiance, mirror.caustics, mirror.status);
        return;
    }
    bool from_dense = object.kind == GLC_INTERFACE && !front;
    float eta = from_dense ? 1.0 / object.ior.g : object.ior.g;
    float reflected_share = glc_fresnel_dielectric(cos_i, eta);
    vec3 radiance = reflected_share > 0.004 ? reflected_share * look_along(p, reflect(v, n)).radiance : vec3(0.0);
    vec3 d;
    bool passes = glc_refract(v, n, eta, d);
    Seen through = Seen(vec3(0.0), vec3(0.0), 0.0, GLC_VIEW_TIR);
    if (passes) {
        vec3 tint = vec3((1.0 - reflected_share) * object.transmission);
        if (object.kind == GLC_INTERFACE) {
            through = look_through(p, d, depth_m, v_uv);
            if (front) tint *= glc_transmittance(object.sigma_a, through.distance_m);
            tint /= eta * eta;   // radiance behind the interface is larger by (n_behind / n_eye)^2
        }
#if HAS_BACK
        else {
            vec3 exit_ws, n_inward, outside;
            float t;
            if (solid_exit(p, d, v_uv, stored.w, exit_ws, n_inward, t)) {
                if (dot(n_inward, d) > 0.0) n_inward = -n_inward;
                tint *= glc_transmittance(object.sigma_a, t);
                float r_exit = glc_fresnel_dielectric(-dot(n_inward, d), 1.0 / object.ior.g);
                bool leaves = glc_refract(d, n_inward, 1.0 / object.ior.g, outside);
                vec3 projected = glc_camera_project(exit_ws);
                vec2 uv = on_screen(projected) ? projected.xy : v_uv;
                // Inside reflections are not followed on: under total reflection the mirrored direction stands for what they show.
                through = look_through(exit_ws, outside, depth_m, uv);
                tint *= leaves ? 1.0 - r_exit : 1.0;
                if (!leaves) through.status = GLC_VIEW_TIR;
            } else {
                through = look_through(p, v, depth_m, v_uv);
                through.status = GLC_VIEW_FALLBACK;
            }
        }
#endif
        radiance += tint * through.radiance;
    }
    if (from_dense) radiance *= glc_transmittance(object.sigma_a, length(p - u_world_from_camera[3].xyz));
    write(radiance, through.caustics, through.status);
}
