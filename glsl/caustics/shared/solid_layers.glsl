// Solids as two pairs of front and back faces in a light's view, the second one peeled from behind the first (Everitt 2001,
// "Interactive order-independent transparency"): folds, handles, cavities, and other solids behind. What is inside of neither pair
// is taken for outside; a solid with more layers still loses light there, and it is counted.
#include "common/solid_path.glsl"

uniform sampler2D t_front2_position;
uniform sampler2D t_front2_normal;
uniform sampler2D t_back2_position;
uniform sampler2D t_back2_normal;

struct Layers {
    bool inside;       // of one of the pairs
    int nearest;       // face that is nearest along the light: 0 front, 1 back, 2 second front, 3 second back; -1: nothing here
    vec3 surface_ws;   // of that face
    ivec2 texel;
};

// `object`: its number + 1, since the pairs of a texel may be another solid's.
Layers layers_at(GlcView view, vec3 p_ws, float object) {
    vec3 projected = glc_view_project(view, p_ws);
    Layers layers = Layers(false, -1, p_ws, ivec2(projected.xy));
    if (!glc_view_inside(view, projected)) return layers;
    vec4 face[4];
    face[0] = texelFetch(t_caster_position, layers.texel, 0);
    face[1] = texelFetch(t_back_position, layers.texel, 0);
    face[2] = texelFetch(t_front2_position, layers.texel, 0);
    face[3] = texelFetch(t_back2_position, layers.texel, 0);
    float here = glc_light_distance(view, p_ws), best = 0.0;
    for (int k = 0; k < 4; k += 2) {
        if (face[k].w != object || face[k + 1].w != object) continue;  // another solid's
        vec2 gap = vec2(glc_light_distance(view, face[k].xyz), glc_light_distance(view, face[k + 1].xyz)) - here;
        if (gap.x <= 0.0 && gap.y >= 0.0) layers.inside = true;
        for (int i = 0; i < 2; ++i)
            if (layers.nearest < 0 || abs(gap[i]) < best) {
                best = abs(gap[i]);
                layers.nearest = k + i;
                layers.surface_ws = face[k + i].xyz;
            }
    }
    return layers;
}

vec3 layer_normal(Layers at, vec2 uv, vec3 otherwise) {
    vec4 n = at.nearest == 0 ? texelFetch(t_caster_normal, at.texel, 0) : at.nearest == 1 ? texelFetch(t_back_normal, at.texel, 0)
           : at.nearest == 2 ? texelFetch(t_front2_normal, at.texel, 0) : texelFetch(t_back2_normal, at.texel, 0);
    vec3 at_texel = glc_safe_normalize(n.xyz, otherwise);
    if ((at.nearest & 1) == 0) return at_texel;
    // Between texels of one face the stored normals are interpolated, not between those of two.
    vec3 between = at.nearest == 1 ? textureLod(t_back_normal, uv, 0.0).xyz : textureLod(t_back2_normal, uv, 0.0).xyz;
    between = glc_safe_normalize(between, at_texel);
    return dot(between, at_texel) > 0.9 ? between : at_texel;
}

// The ray's point on the tangent plane of a face, if it lies beside its texel (as `glc_settle`).
bool settle_on(GlcView view, Layers at, vec3 o, vec3 d, inout GlcHit hit) {
    if (at.nearest < 0) return false;
    vec3 n = layer_normal(at, (vec2(at.texel) + 0.5) / view.size, -d);
    float d_n = dot(d, n);
    float t = abs(d_n) > 1e-3 ? dot(at.surface_ws - o, n) / d_n : hit.t;
    // Beside an edge a ray may start a texel or two beyond the face that it is about to leave through.
    if (t < 0.0 && d_n > 0.0 && t > -2.0 * GLC_REACH * glc_texel_width(view, o)) t = 0.0;
    vec3 p = o + t * d, off = p - at.surface_ws, l = glc_light_direction(view, p);
    if (t < 0.0 || length(off - l * dot(off, l)) > 2.0 * GLC_REACH * glc_texel_width(view, at.surface_ws)) return false;
    hit.t = t;
    hit.position_ws = p;
    hit.normal_ws = layer_normal(at, glc_view_project(view, p).xy / view.size, n);
    hit.status = GLC_BRACKETED;
    return true;
}

// Where a ray inside the solid leaves it: the first end of a stretch inside that lies on a face.
GlcHit leave_layers(GlcView view, float object, vec3 o, vec3 d, float t_max, int march_steps) {
    GlcHit hit = GlcHit(0.0, o, -d, 0, GLC_LEFT);
    t_max += 4.0 * glc_texel_width(view, o);
    float t_in = 0.0;
    bool entered = true;   // the ray starts on a face, from there inwards
    int i = 0;
    while (i < march_steps) {
        float t = 0.0;
        bool ends = false;
        while (i < march_steps && !ends) {
            ++i;
            t = t_max * float(i) / float(march_steps);
            hit.iterations += 4;
            bool inside = layers_at(view, o + t * d, object).inside;
            ends = entered && !inside && i > 1;  // the first step may still graze the surface that the ray comes from
            if (inside) { t_in = t; entered = true; }
        }
        if (!ends) break;
        float lo = t_in, hi = t;
        for (int k = 0; k < 10; ++k) {
            float mid = 0.5 * (lo + hi);
            if (layers_at(view, o + mid * d, object).inside) lo = mid; else hi = mid;
        }
        hit.iterations += 40;
        hit.t = hi;
        if (settle_on(view, layers_at(view, o + lo * d, object), o, d, hit)) return hit;
        if (settle_on(view, layers_at(view, o + hi * d, object), o, d, hit)) return hit;
        entered = false;   // an edge between two layers, not a surface: still inside
    }
    return hit;
}

// The next solid that a ray in the open meets: status <= 0 if there is none. `object`: its number + 1. The first front faces are met
// beside their own texel, the second ones behind the first pair.
GlcHit enter_layers(GlcView view, vec3 o, vec3 d, float t_max, int estimate, int max_iterations, int march_steps, out float object) {
    object = 0.0;
    GlcHit next = GlcHit(t_max, o, -d, 0, GLC_LEFT);
    if (t_max <= 0.0) return next;
    GlcHit behind = glc_intersect(t_front2_position, t_front2_normal, view, o, d, t_max, estimate, max_iterations, march_steps);
    GlcHit beside = glc_intersect(t_caster_position, t_caster_normal, view, o, d, t_max, estimate, max_iterations, march_steps);
    int iterations = behind.iterations + beside.iterations;
    if (behind.status > 0 && dot(behind.normal_ws, d) < 0.0) {
        next = behind;
        vec3 projected = glc_view_project(view, next.position_ws);
        object = texelFetch(t_front2_position, ivec2(projected.xy), 0).w;
        vec3 between = glc_safe_normalize(textureLod(t_front2_normal, projected.xy / view.size, 0.0).xyz, next.normal_ws);
        if (dot(between, next.normal_ws) > 0.9) next.normal_ws = between;
    }
    if (beside.status > 0 && dot(beside.normal_ws, d) < 0.0 && (object == 0.0 || beside.t < next.t)) {
        vec3 projected = glc_view_project(view, beside.position_ws);
        float other = texelFetch(t_caster_position, ivec2(projected.xy), 0).w;
        if (other > 0.0 && glc_object(int(other + 0.5) - 1).kind == GLC_SOLID) {
            next = beside;
            object = other;
            vec3 between = glc_safe_normalize(textureLod(t_caster_normal, projected.xy / view.size, 0.0).xyz, next.normal_ws);
            if (dot(between, next.normal_ws) > 0.9) next.normal_ws = between;
        }
    }
    next.iterations = iterations;
    if (object == 0.0) next.status = GLC_LEFT;
    return next;
}
