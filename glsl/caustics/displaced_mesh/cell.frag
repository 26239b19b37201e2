// One fragment a cell between four vertices: is it drawn as two triangles, and with what densities? A cell that is not (an edge
// runs through it, or a fold that the map's texels cannot resolve) leaves its four vertices' flux to leftover.frag.
#include "caustics/displaced_mesh/grid.glsl"
#if WARP
#include "interface/map_warp.glsl"
#endif

uniform sampler2D t_vertex;
uniform float u_fold_width;  // texels: a cell wider than this is drawn in any case
uniform float u_change;      // relative change of the density over a texel that triangles may show

layout(location = 0) out vec4 o_cell;   // of both triangles: largest density, and the factor that keeps its flux; 0: not drawn
layout(location = 1) out vec4 o_weight; // x: share that triangles take, 0 (unresolved, or an edge runs through) .. 1; y: flux drawn / flux

const float DENSITY_CAP = 1.5;  // times flux / area of the triangle

float cross2(vec2 a, vec2 b) { return a.x * b.y - a.y * b.x; }

// Area that the triangle's landing points span, signed, texels^2 of the map.
float signed_area(vec3 a, vec3 b, vec3 c) { return 0.5 * cross2(b.xy - a.xy, c.xy - a.xy); }

// Cap of the density (vertices per texel^2), and the factor by which min(1/|det|, cap) is scaled so that the triangle holds its
// flux exactly (quadrature of degree 3 over a triangle: Zienkiewicz 1971, table 8.2).
// `side`: of the triangle as it is drawn. A sliver can lie the wrong way round though its sheet does not fold, since its edges are
// chords: its neighbours then overlap, and drawn as less than nothing it takes off what they have too much.
// `area`: that it covers as it is drawn, its edges straight in the map, texels^2 of the view; of a long narrow one in a warped map far
// more than its landing points span. `drawn` gathers the share of the flux that is drawn then.
vec2 densities(vec3 a, vec3 b, vec3 c, float side, float area, inout float drawn) {
    vec3 det = vec3(a.z, b.z, c.z);
    float low = min(det.x, min(det.y, det.z)), high = max(det.x, max(det.y, det.z));
    // Where the determinant hardly changes, 1/|det| is more exact than the triangle's area.
    float smallest = low * high > 0.0 ? min(abs(low), abs(high)) : 0.0;
    float uneven = smoothstep(2.0, 6.0, max(abs(low), abs(high)) / max(smallest, 1e-12));
    float spanned = max(abs(signed_area(a, b, c)), 1e-6);
    float ratio = 0.5 / mix(spanned, max(area, spanned), smoothstep(1.5, 3.0, area / spanned));
    float cap = DENSITY_CAP * ratio / max(uneven, 1e-3);
    float mean = 0.0;
    for (int i = 0; i < 3; ++i) {
        mean += 0.05 * min(1.0 / max(abs(det[i]), 1e-12), cap);
        mean += (2.0 / 15.0) * min(1.0 / max(abs(0.5 * (det[i] + det[(i + 1) % 3])), 1e-12), cap);
    }
    mean += 0.45 * min(3.0 / max(abs(det.x + det.y + det.z), 1e-12), cap);
    float factor = mix(1.0, ratio / mean, uneven);
    bool turned = smallest > 0.0 && side * low < 0.0;
    float share = factor * mean / ratio;  // of a sliver, whose area says little, none is known
    float sliver = (1.0 - uneven) * smoothstep(1.1, 1.4, max(share, 1.0 / max(share, 1e-12)));
    drawn += 0.5 * mix(share, 1.0, sliver);
    if (turned) factor *= uneven - 1.0;
    return vec2(cap, factor);
}

// Is there a fold ahead, where the determinant changes its sign? Looked for down its slope, as far as that predicts and on.
bool folds_ahead(ivec2 texel, vec2 slope, float mean) {
    float steep = max(length(slope), 1e-30);
    vec2 towards = -sign(mean) * slope / steep;
    float predicted = abs(mean) / steep;  // vertices
    ivec2 size = textureSize(t_vertex, 0);
    if (predicted > float(max(size.x, size.y))) return false;
    for (int i = 0; i < 3; ++i) {
        vec2 ahead = towards * (predicted * (1.0 + 0.5 * float(i)) + 1.0);
        vec4 v = texelFetch(t_vertex, clamp(texel + ivec2(floor(ahead + 0.5)), ivec2(0), size - 1), 0);
        if (v.w > 0.0 && v.z * mean < 0.0) return true;
    }
    return false;
}

// Does the density change too fast for samples one texel apart? Smallest singular value of the cell's mean derivative: its width in
// texels; the determinant's relative change over a cell, divided by that width, is the change over a texel. Along a fold, x texels
// from it, that is 1 / 2x whatever the mesh. A focus that does not fold is one sheet: samples of it need no care.
// 0 where it does, 1 where triangles will do, and a ramp between, so that no rounding decides which of both is seen.
float resolved_share(ivec2 texel, vec3 a, vec3 b, vec3 c, vec3 d) {
    vec2 e = 0.5 * (b.xy - a.xy + d.xy - c.xy), f = 0.5 * (c.xy - a.xy + d.xy - b.xy);
    float s = dot(e, e) + dot(f, f), det = cross2(e, f);
    float largest2 = 0.5 * (s + sqrt(max(s * s - 4.0 * det * det, 0.0)));
    float width = abs(det) * inversesqrt(max(largest2, 1e-30));
    float low = min(min(a.z, b.z), min(c.z, d.z)), high = max(max(a.z, b.z), max(c.z, d.z));
    float smallest = low * high > 0.0 ? min(abs(low), abs(high)) : 0.0;
    float change = (high - low) / max(smallest * width, 1e-12);
    float share = 1.0 - smoothstep(0.5 * u_change, 2.0 * u_change, change);
    share = max(share, smoothstep(u_fold_width, 2.0 * u_fold_width, width));
    if (share == 1.0 || smallest == 0.0) return share;
    vec2 slope = 0.5 * vec2(b.z - a.z + d.z - c.z, c.z - a.z + d.z - b.z);
    return folds_ahead(texel, slope, 0.25 * (a.z + b.z + c.z + d.z)) ? share : 1.0;
}

// Area of a triangle of the map (a, b, c) in texels^2 of the view; `middle`: of its corners there.
float drawn_area(vec3 a, vec3 b, vec3 c, vec2 middle) {
    float area = abs(signed_area(a, b, c));
#if WARP
    vec2 rate;
    warp(middle, u_receiver_size, rate);
    area /= rate.x * rate.y;
#endif
    return area;
}

// Position and determinant of a vertex on the face of the cell's first one.
vec3 corner(ivec2 texel, vec4 vertex, int face) {
    vec3 on_face = grid_on_face(texel, texelFetch(t_projected, texel, 0), face);
    return vec3(on_face.xy, vertex.z * on_face.z);
}

void main() {
    o_cell = vec4(0.0);
    o_weight = vec4(0.0);
    ivec2 texel = ivec2(gl_FragCoord.xy);
    if (any(greaterThanEqual(texel, textureSize(t_vertex, 0) - 1))) return;
    ivec2 right = texel + ivec2(1, 0), up = texel + ivec2(0, 1), both = texel + 1;
    vec4 va = texelFetch(t_vertex, texel, 0), vb = texelFetch(t_vertex, right, 0);
    vec4 vc = texelFetch(t_vertex, up, 0), vd = texelFetch(t_vertex, both, 0);
    int la = int(va.w), lb = int(vb.w), lc = int(vc.w);
    if ((la & LINK_RIGHT) == 0 || (la & LINK_UP) == 0 || (lb & LINK_UP) == 0 || (lc & LINK_RIGHT) == 0) return;
#if RECEIVER_FACES == 6
    int face = grid_face(texelFetch(t_projected, texel, 0));
    vec3 a = corner(texel, va, face), b = corner(right, vb, face), c = corner(up, vc, face), d = corner(both, vd, face);
#else
    vec3 a = va.xyz, b = vb.xyz, c = vc.xyz, d = vd.xyz;
#endif
    o_weight.x = resolved_share(texel, a, b, c, d);
    if (o_weight.x == 0.0) return;
    vec3 map_a = a, map_b = b, map_c = c, map_d = d;
#if RECEIVER_FACES == 1
    // Flux is counted in texels of the view, which are all alike; what can be resolved, in those of the map.
    a.xy = texelFetch(t_projected, texel, 0).xy;
    b.xy = texelFetch(t_projected, right, 0).xy;
    c.xy = texelFetch(t_projected, up, 0).xy;
    d.xy = texelFetch(t_projected, both, 0).xy;
#endif
    vec2 sides = sign(vec2(signed_area(map_a, map_b, map_c), signed_area(map_b, map_d, map_c)));
    vec2 areas = vec2(drawn_area(map_a, map_b, map_c, (a + b + c).xy / 3.0), drawn_area(map_b, map_d, map_c, (b + d + c).xy / 3.0));
    o_cell = vec4(densities(a, b, c, sides.x, areas.x, o_weight.y), densities(b, d, c, sides.y, areas.y, o_weight.y));
}
