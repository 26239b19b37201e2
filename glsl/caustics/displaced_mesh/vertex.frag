// The signed determinant of the light map (texels of the casters' view -> texels of the caustic map) at each vertex, from
// fourth-order central differences of the landing points; of lower order beside an edge. No further ray is traced: the landing
// points around carry the derivatives of any chain of interfaces to O(h^4).
#include "caustics/displaced_mesh/grid.glsl"
#if WARP
#include "interface/map_warp.glsl"
#endif

uniform float u_unit;  // texels of the map that a texel of the casters' view covers where light goes straight on

layout(location = 0) out vec4 o_vertex;  // xy: position, texels of the map; z: signed determinant, texels^2 of the view; w: links, see grid.glsl
layout(location = 1) out vec4 o_axes;    // xy: derivative along the grid's rows, zw: along its columns; 0 where there is none

const float STRETCH = 3.0;  // a step this much longer than both its neighbours crosses an edge

struct Line {
    vec2 p[5];   // landing points of the vertices at -2 .. 2 along one axis of the grid
    int same[5]; // 1: light of the same object
};

Line read_line(ivec2 texel, ivec2 step, vec4 here) {
    ivec2 size = textureSize(t_projected, 0);
#if CASTER_FACES == 6
    ivec2 tile = size / ivec2(3, 2);
    ivec2 lower = texel / tile * tile, upper = lower + tile;
#else
    ivec2 lower = ivec2(0), upper = size;
#endif
    Line line;
    for (int k = 0; k < 5; ++k) {
        ivec2 there = texel + (k - 2) * step;
        bool inside = all(greaterThanEqual(there, lower)) && all(lessThan(there, upper));
        vec4 v = inside ? texelFetch(t_projected, there, 0) : vec4(0.0);
        line.same[k] = grid_key(v) == grid_key(here) ? 1 : 0;
        vec3 on_face = line.same[k] == 1 ? grid_on_face(there, v, grid_face(here)) : vec3(0.0);
        line.p[k] = on_face.xy;
        if (on_face.z == 0.0) line.same[k] = 0;
    }
    return line;
}

// 1 where the vertices k and k + 1 of the line belong to one sheet of light.
int link(Line line, int k) {
    if (line.same[k] * line.same[k + 1] == 0) return 0;
    float reach = u_unit;
    if (k > 0 && line.same[k - 1] == 1) reach = max(reach, length(line.p[k] - line.p[k - 1]));
    if (k < 3 && line.same[k + 2] == 1) reach = max(reach, length(line.p[k + 2] - line.p[k + 1]));
    return length(line.p[k + 1] - line.p[k]) <= STRETCH * reach ? 1 : 0;
}

vec2 derivative(Line line, out bool right) {
    ivec2 inner = ivec2(link(line, 1), link(line, 2));
    ivec2 outer = inner * ivec2(link(line, 0), link(line, 3));
    vec2 p[5] = line.p;
    right = inner.y == 1;
    if (outer == ivec2(1)) return (8.0 * (p[3] - p[1]) - (p[4] - p[0])) / 12.0;
    if (inner == ivec2(1)) return 0.5 * (p[3] - p[1]);
    if (outer.y == 1) return -1.5 * p[2] + 2.0 * p[3] - 0.5 * p[4];
    if (outer.x == 1) return 1.5 * p[2] - 2.0 * p[1] + 0.5 * p[0];
    if (inner.y == 1) return p[3] - p[2];
    if (inner.x == 1) return p[2] - p[1];
    return vec2(0.0);
}

#if WARP
// A whole step, not the derivative at its middle: texels may crowd within it.
vec2 warped_step(vec2 at, vec2 step) {
    vec2 rate;
    return warp(at + 0.5 * step, u_receiver_size, rate) - warp(at - 0.5 * step, u_receiver_size, rate);
}
#endif

void main() {
    o_vertex = vec4(0.0);
    o_axes = vec4(0.0);
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 here = texelFetch(t_projected, texel, 0);
    if (grid_key(here) == 0) return;
    bool right, up;
    vec2 a = derivative(read_line(texel, ivec2(1, 0), here), right);
    vec2 b = derivative(read_line(texel, ivec2(0, 1), here), up);
#if WARP
    vec2 rate;
    vec2 place = warp(here.xy, u_receiver_size, rate);
    o_axes = vec4(warped_step(here.xy, a), warped_step(here.xy, b));
#else
    vec2 place = here.xy;
    o_axes = vec4(a, b);
#endif
    int links = LINK_HERE + (right ? LINK_RIGHT : 0) + (up ? LINK_UP : 0);
    o_vertex = vec4(place, a.x * b.y - a.y * b.x, float(links));
}
