// What the triangles leave out of a vertex's flux: all of it beside a cell that is not drawn. It becomes a splat, spread as the
// light map spreads it, at least as wide as the map's own pixel filter: no flux is dropped at an edge, and a fold that texels cannot
// resolve is anti-aliased. In the mesh the vertex fades to nothing there, so that both add up to one sheet without a seam.
#include "caustics/displaced_mesh/grid.glsl"
#include "common/optics.glsl"
#if WARP
#include "interface/map_warp.glsl"
#endif

uniform sampler2D t_vertex;
uniform sampler2D t_axes;
uniform sampler2D t_weight;
uniform sampler2D t_flux;
uniform float u_sigma;       // standard deviation of a whole texel's splat in units of the distance to its neighbour
uniform float u_max_radius;  // texels
#if RECEIVER_FACES == 1
uniform vec2 u_map_size;     // texels
#endif

layout(location = 0) out vec4 o_splat;  // xy: centre in texels of the map; z: radius, texels (0: nothing left over); w: face
layout(location = 1) out vec4 o_conic;  // xyz: inverse covariance (a, b, c); w: share of the flux / integral of the kernel
layout(location = 2) out vec4 o_drawn;  // rgb: flux of the vertex in the triangles, W or lm; w: signed determinant

const float PIXEL_VARIANCE = 0.2;   // texels^2: the map's own filter
#if CASTER_FACES == 6
const float CUBE_RAMP = 10.0;       // vertices
#endif
const float CUTOFF = 7.0;           // squared Mahalanobis radius where the kernel ends; SPLAT_CUTOFF in splat.frag

// Share of a vertex's flux that the triangles around it draw: they fade out towards an edge or an unresolved cell. `excess`: by how
// much they would draw too much; taken out over four cells, since a factor a triangle would show the triangles.
float drawn_share(ivec2 texel, out float excess) {
    float share = 1.0, sum = 0.0, count = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 cell = texel - 1 + ivec2(i & 1, i >> 1);
        vec4 weight = all(greaterThanEqual(cell, ivec2(0))) ? texelFetch(t_weight, cell, 0) : vec4(0.0);
        share = min(share, weight.x);
        sum += weight.y;
        count += weight.y > 0.0 ? 1.0 : 0.0;
    }
    excess = count > 0.0 ? sum / count : 1.0;
#if CASTER_FACES == 6
    // Between faces of the casters' cube there are no cells. Splats blur the share by 1/2 sigma^2 share'': it has to change slowly.
    ivec2 tile = textureSize(t_vertex, 0) / ivec2(3, 2), at = texel % tile;
    ivec2 to_border = min(at, tile - 1 - at);
    share *= smoothstep(0.0, CUBE_RAMP, float(min(to_border.x, to_border.y)));
#endif
    return share;
}

void main() {
    o_splat = vec4(0.0);
    o_conic = vec4(0.0);
    o_drawn = vec4(0.0, 0.0, 0.0, 1.0);
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 vertex = texelFetch(t_vertex, texel, 0);
    if (vertex.w == 0.0) return;
    float excess;
    float share = drawn_share(texel, excess);
    o_drawn = vec4(share / excess * texelFetch(t_flux, texel, 0).rgb, vertex.z);
    if (share == 1.0) return;
    vec4 projected = texelFetch(t_projected, texel, 0);
    vec4 axes = texelFetch(t_axes, texel, 0);
    vec2 a = axes.xy, b = axes.zw, centre = vertex.xy;
    vec2 alone = vec2(a == vec2(0.0), b == vec2(0.0)) * projected.w, rate = vec2(1.0);
#if WARP
    warp(projected.xy, u_receiver_size, rate);
#endif
    vec3 c = vec3(a.x * a.x + b.x * b.x, a.x * a.y + b.x * b.y, a.y * a.y + b.y * b.y) + vec3(rate.x * rate.x, 0.0, rate.y * rate.y) * dot(alone, alone);
    c *= u_sigma * u_sigma;
    float half_trace = 0.5 * (c.x + c.z);
    float largest = half_trace + sqrt(max(half_trace * half_trace - (c.x * c.z - c.y * c.y), 0.0));
    // A splat that is too wide keeps its flux and its shape; never does it get narrower than the map's own filter.
    float most = max(u_max_radius * u_max_radius / CUTOFF - PIXEL_VARIANCE, 0.0);
    c = c * min(1.0, most / max(largest, 1e-30)) + vec3(PIXEL_VARIANCE, 0.0, PIXEL_VARIANCE);
    float radius = sqrt(CUTOFF * (min(largest, most) + PIXEL_VARIANCE));
    float det = max(c.x * c.z - c.y * c.y, PIXEL_VARIANCE * PIXEL_VARIANCE);
    float integral = 2.0 * GLC_PI * sqrt(det) * (1.0 - exp(-0.5 * CUTOFF) * (1.0 + 0.5 * CUTOFF));
#if RECEIVER_FACES == 1
    centre += 0.5 * u_map_size;
#endif
    o_splat = vec4(centre, radius, float(grid_face(projected)));
    o_conic = vec4(c.z / det, -c.y / det, c.x / det, (1.0 - share) / integral);
}
