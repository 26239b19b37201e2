#include "common/light_view.glsl"

// Where a ray meets a surface that is known as positions + normals in a light's view (Shah, Konttinen, Pattanaik 2007,
// sec. III C and appendix; Mayer, Assarsson, Sintorn 2026, sec. 2). Three estimates of the distance t along the ray:
//   GLC_FIXED_POINT  t' = |X(o + t d) - o|                                            (Shah et al., sec. III C)
//   GLC_NEWTON_FD    Newton on the signed light distance, derivative by finite difference  (their appendix)
//   GLC_HYBRID       Newton on tangent planes (Mayer et al.), within a bracket: where the plane leads out of it the secant does,
//                    or bisection; then a bracketing march for the rest
// X(p) is the stored position at the texel that p projects to. Theirs starts at d = 1 and uses eps = 0.1 scene units; here the
// start is the distance to the surface straight behind the ray's origin, and lengths are counted in texel widths: scale-free.
// Every estimate ends on the tangent plane at the last texel: exact on planes, second order on curved surfaces.
// Pure functions, no uniforms. Of all of them:
//   t_position: rgba32f, world space, metres, w = 0 where nothing is stored; t_normal: world space, towards the light
//   view: that both are seen by; o, d: the ray's origin (metres) and unit direction, world space; t_max: its end, metres

#define GLC_FIXED_POINT 0
#define GLC_NEWTON_FD 1
#define GLC_HYBRID 2

#define GLC_CONVERGED 1
#define GLC_BRACKETED 2
#define GLC_HIDDEN -2        // the ray ends behind what the view shows
#define GLC_UNCONVERGED -3
#define GLC_LEFT -8          // the ray leaves the scene in front of all that the view shows

struct GlcHit {
    float t;            // metres along the ray
    vec3 position_ws;
    vec3 normal_ws;     // at the texel, as stored
    int iterations;     // texel look-ups
    int status;         // GLC_CONVERGED, GLC_BRACKETED, GLC_HIDDEN, GLC_UNCONVERGED, GLC_LEFT
};

struct GlcProbe {
    float gap;       // signed light distance from p to the stored surface, metres: > 0 while p is in front of it
    bool valid;      // a surface is stored there
    ivec2 texel;
    vec3 surface_ws;
};

// Looks the surface up that the view sees where p_ws is; far_m: the gap (metres) where it sees nothing.
GlcProbe glc_probe(sampler2D t_position, GlcView view, vec3 p_ws, float far_m) {
    vec3 projected = glc_view_project(view, p_ws);
    GlcProbe probe = GlcProbe(far_m, false, ivec2(projected.xy), p_ws);
    if (!glc_view_inside(view, projected)) return probe;
    vec4 stored = texelFetch(t_position, probe.texel, 0);
    if (stored.w == 0.0) return probe;
    probe.valid = true;
    probe.surface_ws = stored.xyz;
    probe.gap = glc_light_distance(view, stored.xyz) - glc_light_distance(view, p_ws);
    return probe;
}

// Unit normal at a probed texel, world space; against the ray where none is stored.
vec3 glc_probe_normal(sampler2D t_normal, GlcProbe probe, vec3 d) {
    return glc_safe_normalize(texelFetch(t_normal, probe.texel, 0).xyz, -d);
}

// Accepts the ray's point on the tangent plane (unit normal n) at the probed texel when it lies within `reach` texel widths of the
// texel, across the light; sets t, position and normal of the hit.
bool glc_settle(vec3 n, GlcView view, GlcProbe probe, vec3 o, vec3 d, float reach, inout GlcHit hit) {
    float d_n = dot(d, n);
    float width = glc_texel_width(view, probe.surface_ws);
    float t = abs(d_n) > 1e-3 ? dot(probe.surface_ws - o, n) / d_n : hit.t;
    vec3 p = o + t * d;
    vec3 off = p - probe.surface_ws;
    vec3 l = glc_light_direction(view, p);
    // Perpendicular to the light one texel is the resolution; along the light a slope stretches it, which the plane follows.
    float sideways = length(off - l * dot(off, l));
    if (t < 0.0 || sideways > reach * width) return false;
    hit.t = t;
    hit.position_ws = p;
    hit.normal_ws = n;
    return true;
}

const float GLC_REACH = 1.5;  // texel widths: half a texel's diagonal, plus one for the step still to go

// Bracketing march over (0, t_max]: finds the first crossing from in front of the surface to behind it that really is the
// surface (a ray that passes behind an occluder crosses too, but does not settle). steps: of equal length, 0 = none.
GlcHit glc_intersect_march(sampler2D t_position, sampler2D t_normal, GlcView view, vec3 o, vec3 d, float t_max, int steps) {
    GlcHit hit = GlcHit(0.0, o, -d, 0, GLC_LEFT);
    float t_front = 0.0;
    bool in_front = true;
    int i = 0;
    while (i < steps) {
        // Up to the next crossing: a loop of its own, since what is behind a branch within it may cost as if it were taken.
        float t = 0.0;
        GlcProbe probe;
        bool crosses = false;
        while (i < steps && !crosses) {
            ++i;
            t = t_max * float(i) / float(steps);
            probe = glc_probe(t_position, view, o + t * d, t_max);
            hit.iterations += 1;
            bool before = probe.gap > 0.0;
            crosses = in_front && !before;
            if (before) { t_front = t; in_front = true; }
        }
        if (!crosses) break;
        float lo = t_front, hi = t;
        for (int k = 0; k < 10; ++k) {
            float mid = 0.5 * (lo + hi);
            GlcProbe middle = glc_probe(t_position, view, o + mid * d, t_max);
            if (middle.gap > 0.0) { lo = mid; } else { hi = mid; probe = middle; }
        }
        hit.iterations += 10;
        hit.t = hi;
        if (glc_settle(glc_probe_normal(t_normal, probe, d), view, probe, o, d, GLC_REACH, hit)) { hit.status = GLC_BRACKETED; return hit; }
        in_front = false;
        t_front = t;
    }
    if (!in_front) hit.status = GLC_HIDDEN;
    return hit;
}

// estimate: GLC_FIXED_POINT, GLC_NEWTON_FD or GLC_HYBRID; max_iterations of it; march_steps: of GLC_HYBRID's fallback, 0 = none.
// Where it fails without one, t and position_ws are those of the last estimate.
GlcHit glc_intersect(sampler2D t_position, sampler2D t_normal, GlcView view, vec3 o, vec3 d, float t_max,
                     int estimate, int max_iterations, int march_steps) {
    GlcHit hit = GlcHit(0.0, o, -d, 0, GLC_UNCONVERGED);
    GlcProbe start = glc_probe(t_position, view, o, t_max);
    hit.iterations = 1;
    float t = start.valid ? min(length(start.surface_ws - o), t_max) : 0.5 * t_max;
    float t_before = 0.0, gap_before = start.gap;
    float lo = 0.0, hi = t_max;
    bool bracketed = false;
    for (int i = 0; i < max_iterations; ++i) {
        vec3 p = o + t * d;
        GlcProbe probe = glc_probe(t_position, view, p, t_max);
        hit.iterations += 1;
        hit.t = t;
        float t_plane = -1.0;
        if (probe.valid) {
            vec3 n = glc_probe_normal(t_normal, probe, d);
            float d_n = dot(d, n);
            if (abs(d_n) > 1e-3) t_plane = dot(probe.surface_ws - o, n) / d_n;
            // Farther off, a plane that happens to be met beside its texel is another surface as often as not.
            bool close = abs(probe.gap) < 6.0 * glc_texel_width(view, probe.surface_ws);
            if (close && glc_settle(n, view, probe, o, d, GLC_REACH, hit)) {
                hit.status = GLC_CONVERGED;
                return hit;
            }
        }
        float next = t;
        if (estimate == GLC_FIXED_POINT) {
            next = probe.valid ? length(probe.surface_ws - o) : t_max;
        } else if (estimate == GLC_NEWTON_FD) {
            float eps = 2.0 * glc_texel_width(view, p);
            float slope = (glc_probe(t_position, view, p + eps * d, t_max).gap - probe.gap) / eps;
            hit.iterations += 1;
            next = abs(slope) > 1e-4 ? t - probe.gap / slope : t_max;
        } else {
            if (probe.gap > 0.0) { lo = t; } else { hi = t; bracketed = true; }
            float rise = probe.gap - gap_before;
            if (t_plane > lo && t_plane < hi) {
                next = t_plane;
            } else {
                next = abs(rise) > 1e-6 * t_max ? t - probe.gap * (t - t_before) / rise : 0.5 * (lo + hi);
                float margin = 0.02 * (hi - lo);
                if (bracketed && (next <= lo + margin || next >= hi - margin)) next = 0.5 * (lo + hi);
            }
        }
        t_before = t;
        gap_before = probe.gap;
        t = clamp(next, 0.0, t_max);
    }
    if (estimate != GLC_HYBRID || march_steps == 0) {
        GlcProbe last = glc_probe(t_position, view, o + t * d, t_max);
        if (!last.valid) hit.status = GLC_LEFT;
        hit.t = t;   // the last estimate, for who judges it
        hit.position_ws = o + t * d;
        return hit;
    }
    GlcHit marched = glc_intersect_march(t_position, t_normal, view, o, d, t_max, march_steps);
    marched.iterations += hit.iterations;
    return marched;
}
