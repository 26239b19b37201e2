// How far apart the light of neighbouring texels lands: covariance of the splat in texels of the caustic map.
// C = sigma^2 x mean of the outer products of the one-sided differences of the landing points (for an affine map sigma^2 J J^T), plus
// the map's own pixel filter (Zwicker et al. 2001, EWA splatting, eq. 14: the sum of both covariances). Two one-sided differences rather
// than a central one: at a fold they cancel, though the light is spread.
#include "interface/receiver_view.glsl"

uniform sampler2D t_landing;
uniform sampler2D t_caster_position;
uniform sampler2D t_caster_normal;
uniform float u_sigma;          // standard deviation of a splat in units of the distance to its neighbour
uniform float u_max_radius;     // texels

const float GLC_PIXEL_VARIANCE = 0.2;   // texels^2: the map's own filter
const float GLC_CUTOFF = 7.0;           // squared Mahalanobis radius where the kernel ends; SPLAT_CUTOFF in splat.frag

#if CORES > 0
// The maps of this window's cores, the finest last. A splat is drawn once, in the finest map that holds it whole and where it is small:
// so light that is spread wide costs few texels, and a focus is sharp.
uniform mat4 u_core_clip_from_world[CORES];
uniform float u_core_texels[CORES];      // texels of the core's map in one of this map
uniform vec2 u_core_size[CORES];         // texels

const float GLC_CORE_RADIUS = 10.0;      // texels of the core: a wider splat goes to a coarser map

int tier_of(vec3 p_ws, float variance) {
    for (int k = CORES - 1; k >= 0; --k) {
        float radius = sqrt(GLC_CUTOFF * (variance * u_core_texels[k] * u_core_texels[k] + GLC_PIXEL_VARIANCE));
        vec4 clip = u_core_clip_from_world[k] * vec4(p_ws, 1.0);
        vec2 reach = 1.0 - 2.0 * (radius + 2.0) / u_core_size[k];
        if (radius < GLC_CORE_RADIUS && clip.w > 0.0 && all(lessThan(abs(clip.xy), reach * clip.w))) return k + 1;
    }
    return 0;
}
#endif
#if TIER > 0
uniform sampler2D t_tiers;               // what the window's own pass decided: w = tier
#endif

layout(location = 0) out vec4 o_splat;  // x, y: centre in texels of the map; z: radius, texels (0: no splat); w: face of a cube, or the core that draws it (then without radius)
layout(location = 1) out vec4 o_conic;  // xyz: inverse covariance (a, b, c); w: 1 / integral of the kernel


// TURN: how much a ray turns with the normal: 2 reflected, about a half refracted.

// Difference of landing points to a neighbour, metres; valid = false across a silhouette, another object or a lost ray.
vec3 difference(ivec2 texel, ivec2 step, vec4 here, float object, out bool valid) {
    ivec2 there = texel + step;
    valid = false;
    ivec2 size = textureSize(t_landing, 0);
    if (any(lessThan(there, ivec2(0))) || any(greaterThanEqual(there, size))) return vec3(0.0);
#if CASTER_FACES == 6
    ivec2 tile = size / ivec2(3, 2);
    if (there / tile != texel / tile) return vec3(0.0);   // another face of the cube: no neighbour
#endif
    vec4 landing = texelFetch(t_landing, there, 0);
    bool same_path = floor(0.5 * (landing.w - 1.0)) == floor(0.5 * (here.w - 1.0));
    valid = landing.w > 0.0 && same_path && texelFetch(t_caster_position, there, 0).w == object;
    return valid ? landing.xyz - here.xyz : vec3(0.0);
}

// Mean covariance of the two one-sided differences along one grid axis; of two that differ by far, the longer one crosses an edge.
vec3 axis_covariance(GlcView view, vec3 centre, int face, vec4 here, float object, ivec2 texel, ivec2 step, float alone) {
    bool ok_a, ok_b;
    vec3 a = difference(texel, step, here, object, ok_a);
    vec3 b = difference(texel, -step, here, object, ok_b);
    float la = dot(a, a), lb = dot(b, b);
    if (ok_a && ok_b) {
        if (la > 16.0 * lb + 1e-30) ok_a = false;
        else if (lb > 16.0 * la + 1e-30) ok_b = false;
    }
    vec2 ua = ok_a ? glc_view_project_on(view, here.xyz + a, face).xy - centre.xy : vec2(0.0);
    vec2 ub = ok_b ? glc_view_project_on(view, here.xyz + b, face).xy - centre.xy : vec2(0.0);
    float count = float(ok_a) + float(ok_b);
    if (count == 0.0) return vec3(alone, 0.0, alone);
    return (vec3(ua.x * ua.x, ua.x * ua.y, ua.y * ua.y) + vec3(ub.x * ub.x, ub.x * ub.y, ub.y * ub.y)) / count;
}

void main() {
    o_splat = vec4(0.0);
    o_conic = vec4(0.0);
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 here = texelFetch(t_landing, texel, 0);
    if (here.w <= 0.0) return;
#if TIER > 0
    if (texelFetch(t_tiers, texel, 0).w != float(TIER)) return;
#endif
    GlcView view = glc_receiver_view();
    int face = glc_view_face(view, here.xyz);
    vec3 centre = glc_view_project_on(view, here.xyz, face);
    // A sliver one texel wide has no neighbour to measure against: its normal's change over the texel says how far it spreads.
    vec4 caster = texelFetch(t_caster_position, texel, 0);
    float bend = abs(texelFetch(t_caster_normal, texel, 0).w) - 1.0;
    float spread = TURN * bend * length(here.xyz - caster.xyz) / max(glc_texel_width(view, here.xyz), 1e-30);
    vec3 c = axis_covariance(view, centre, face, here, caster.w, texel, ivec2(1, 0), spread * spread)
           + axis_covariance(view, centre, face, here, caster.w, texel, ivec2(0, 1), spread * spread);
    c *= u_sigma * u_sigma;
    float half_trace = 0.5 * (c.x + c.z);
    float largest = half_trace + sqrt(max(half_trace * half_trace - (c.x * c.z - c.y * c.y), 0.0));
#if CORES > 0
    int tier = tier_of(here.xyz, largest);
    if (tier > 0) { o_splat.w = float(tier); return; }
#endif
    // A splat that is too wide keeps its flux and its shape; never does it get narrower than the map's own filter.
    float most = max(u_max_radius * u_max_radius / GLC_CUTOFF - GLC_PIXEL_VARIANCE, 0.0);
    c = c * min(1.0, most / max(largest, 1e-30)) + vec3(GLC_PIXEL_VARIANCE, 0.0, GLC_PIXEL_VARIANCE);
    float radius = sqrt(GLC_CUTOFF * (min(largest, most) + GLC_PIXEL_VARIANCE));
    float det = max(c.x * c.z - c.y * c.y, GLC_PIXEL_VARIANCE * GLC_PIXEL_VARIANCE);
    // Integral of exp(-q/2) - exp(-Q/2) over q < Q.
    float integral = 2.0 * GLC_PI * sqrt(det) * (1.0 - exp(-0.5 * GLC_CUTOFF) * (1.0 + 0.5 * GLC_CUTOFF));
    o_splat = vec4(centre.xy, radius, float(face));
    o_conic = vec4(c.z / det, -c.y / det, c.x / det, 1.0 / integral);
}
