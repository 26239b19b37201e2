// The specular surface that the eye sees in a pixel, from the G-buffer's specular layer.
#include "common/optics.glsl"
#include "interface/camera.glsl"
#include "interface/objects.glsl"
#if HAS_EYE_MEDIUM
#include "passes/refraction/eye_medium.glsl"
#endif

uniform sampler2D t_specular_depth_m;
uniform sampler2D t_specular_normal;
#if ONE_OBJECT
// A scene with one specular object, of this kind: its material without a fetch.
uniform vec3 u_one_ior;
uniform vec3 u_one_sigma_a;
uniform float u_one_transmission;
#endif

in vec2 v_uv;
in vec3 v_ray_ws;

// The ray to the surface runs in something else than air. solid: object index + 1 of the closed solid that this is the inside of, or 0.
#define HAS_MEDIA (HAS_EYE_MEDIUM || CONTINUED)
struct Medium {
    vec3 sigma_a;
    float ior;
    float solid;
};

struct Surface {
    vec3 p;              // metres
    float depth_m;
    vec3 v;              // unit, from the eye
    vec3 n;              // unit, against v
    float cos_i;
    GlcObject object;
    bool mirror;
    bool from_dense;     // seen from inside the object's medium
    float eta;           // n_behind / n_before
#if HAS_MEDIA
    Medium before;       // what the ray to the surface runs in
    Medium around;       // what the rays behind a solid run in
    float limb_m;        // a length, where the surface is a solid's that faces away from the eye; else 0
    bool contained;      // the surface lies within another closed solid, and `around` around that
    vec3 carries;        // of what leaves the surface, to the eye
#endif
};

// What the surface is, from p, v and what the ray to it runs in. stored: as in the layer's normals.
void set_surface(inout Surface at, vec4 stored) {
#if ONE_OBJECT
    at.object = GlcObject(vec3(1.0), ONE_OBJECT, u_one_ior, 0.0, u_one_sigma_a, u_one_transmission);
#else
    at.object = glc_object(int(abs(stored.w) + 0.5) - 1);
#endif
    // A shading normal that leans away from the eye would reflect into the surface: bring it back to grazing.
    at.n = stored.xyz;
    at.cos_i = -dot(at.n, at.v);
    float lean = max(0.02 - at.cos_i, 0.0), unit = inversesqrt(1.0 + lean * (2.0 * at.cos_i + lean));
    at.n = unit * (at.n - lean * at.v);
    at.cos_i = max(unit * (at.cos_i + lean), 0.02);
    at.mirror = HAS_MIRROR == 1 && at.object.kind == GLC_MIRROR;
#if HAS_MEDIA
    at.from_dense = stored.w < 0.0 && (at.object.kind == GLC_INTERFACE || -stored.w == at.before.solid);
    at.eta = at.from_dense ? 1.0 / at.object.ior.g : at.object.ior.g / at.before.ior;
#else
    at.from_dense = at.object.kind == GLC_INTERFACE && stored.w < 0.0;
    at.eta = at.from_dense ? 1.0 / at.object.ior.g : at.object.ior.g;
#endif
}

Surface surface_at(ivec2 pixel) {
    Surface at;
    at.depth_m = texelFetch(t_specular_depth_m, pixel, 0).r;
#if ORTHOGRAPHIC
    at.p = glc_camera_position_ws(v_uv, at.depth_m);
    at.v = glc_camera_ray_ws(v_uv);
#else
    at.p = u_world_from_camera[3].xyz + at.depth_m * v_ray_ws;
    at.v = normalize(v_ray_ws);
#endif
#if HAS_EYE_MEDIUM
    at.before = Medium(u_eye_sigma_a, u_eye_ior, u_eye_solid);
    at.around = at.before;
    at.contained = false;
    at.limb_m = 0.0;
    at.carries = glc_eye_transmittance(v_uv, at.depth_m, u_bounds_min_ws, u_bounds_max_ws);
#endif
    set_surface(at, texelFetch(t_specular_normal, pixel, 0));
    return at;
}
