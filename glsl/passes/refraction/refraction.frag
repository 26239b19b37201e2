// What water, glass and mirrors show: the camera's specular layer over the shaded opaque layer. Exact Fresnel, Beer-Lambert
// absorption and the radiance scale (n_from/n_to)^2 at every interface that the eye ray crosses (pbrt-v4, sec. 9.5.2). Rays are
// followed in screen space, see trace.glsl. RETRY: only the pixels that the
// first stage left to do; REFLECTION: then what mirrors in them, as a difference to the sky that the first stage put there.
#include "common/optics.glsl"
#include "interface/camera.glsl"
#include "interface/objects.glsl"
#include "passes/refraction/trace.glsl"
#if HAS_SOLID
#include "passes/refraction/solid.glsl"
#endif

uniform sampler2D t_specular_depth_m;
uniform sampler2D t_specular_normal;
#if RETRY
uniform sampler2D t_unsolved;
#endif

in vec2 v_uv;

// Shares of the reflection below which the sky stands for what a march would find, faded in between.
const float REFLECT_FROM = 0.05, REFLECT_TO = 0.12;

float reflection_weight(float share) {
    return smoothstep(REFLECT_FROM, REFLECT_TO, share);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
#if RETRY
    int todo = int(texelFetch(t_unsolved, pixel, 0).r * 255.0 + 0.5);
    if ((todo & (REFLECTION == 1 ? GLC_TODO_REFLECTION : GLC_TODO_REFRACTION)) == 0) discard;
#endif
    float depth_m = texelFetch(t_specular_depth_m, pixel, 0).r;
    vec4 stored = texelFetch(t_specular_normal, pixel, 0);
    GlcObject object = glc_object(int(abs(stored.w) + 0.5) - 1);
    vec3 p = glc_camera_position_ws(v_uv, depth_m);
    vec3 v = glc_camera_ray_ws(v_uv);
    vec3 n = stored.xyz;
    // A shading normal that leans away from the eye would reflect into the surface: bring it back to grazing.
    float cos_i = -dot(n, v);
    if (cos_i < 0.02) { n = normalize(n - v * (0.02 - cos_i)); cos_i = max(-dot(n, v), 0.02); }

#if HAS_MIRROR
    if (object.kind == GLC_MIRROR) {
        Seen mirror = look_along(p, reflect(v, n));
        mirror.radiance *= glc_fresnel_metal(object.base_color, cos_i);
        write_view(mirror, GLC_TODO_REFRACTION);
        return;
    }
#endif
    bool from_dense = object.kind == GLC_INTERFACE && stored.w < 0.0;
    float eta = from_dense ? 1.0 / object.ior.g : object.ior.g;
    float share = glc_fresnel_dielectric(cos_i, eta);
    vec3 reflected = reflect(v, n);
    vec3 reflection = share * glc_sky_radiance(reflected);
    vec3 held = from_dense ? glc_transmittance(object.sigma_a, length(p - u_world_from_camera[3].xyz)) : vec3(1.0);
#if USE_MARCH && (REFLECTION || !RETRY)
    {
        Seen seen = look_along(p, reflected);
        if (from_dense) seen.radiance *= glc_transmittance(object.sigma_a, seen.distance_m);
        vec3 marched = mix(reflection, share * seen.radiance, reflection_weight(share));
#if REFLECTION
        // Added to what the stages before wrote with the sky in the mirror.
        seen.radiance = held * (marched - reflection);
        write_view(seen, 0);
        return;
#endif
        reflection = marched;
    }
#endif
#if !REFLECTION
    vec3 d;
    bool solved = true;
    Seen through = Seen(vec3(0.0), vec3(0.0), 0.0, v_uv, 0.0, 0.0, GLC_VIEW_TIR);
    vec3 radiance = reflection;
    if (glc_refract(v, n, eta, d)) {
        vec3 tint = vec3((1.0 - share) * object.transmission);
        bool leaves = true;
#if HAS_SOLID
        if (object.kind == GLC_SOLID) leaves = solid_through(p, d, object.ior.g, object.sigma_a, tint);
        else
#endif
        tint /= eta * eta;   // radiance behind the interface is larger by (n_behind / n_eye)^2
        through = look_through(p, d, solved);
        if (object.kind == GLC_INTERFACE && !from_dense) tint *= glc_transmittance(object.sigma_a, through.distance_m);
        if (!leaves) through.status = GLC_VIEW_TIR;
        radiance += tint * through.radiance;
    }
    through.radiance = held * radiance;
    write_view(through, (solved ? 0 : GLC_TODO_REFRACTION) | (share > REFLECT_FROM ? GLC_TODO_REFLECTION : 0));
#endif
}
