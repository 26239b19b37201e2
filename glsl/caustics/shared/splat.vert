// One point a texel of the casters' light view, moved to where its light lands (Shah et al. 2007, sec. III C). BOX 1: two triangles
// around the kernel, for few splats, long and narrow, of which a point would cover the length squared. On a cube each splat
// is drawn once more on each of the two other faces nearest to it, so that one that crosses a border goes on there.
#if RECEIVER_FACES == 6
#include "common/light_view.glsl"
#endif
uniform sampler2D t_splat;
uniform sampler2D t_conic;
uniform sampler2D t_flux;
uniform int u_width;        // of the grid, texels
uniform int u_count;        // texels of the grid
uniform vec2 u_map_size;    // texels

flat out vec2 v_centre;
flat out vec3 v_conic;
flat out vec3 v_flux;
flat out vec4 v_tile;       // xy: lower corner, zw: upper corner, texels

#if RECEIVER_FACES == 6
// Carries a splat over to the face that is `copy`-th in line for its direction: centre, conic and radius in that face's texels; false where
// it does not reach there. Both faces are perspective views of one point: the map between them has a closed derivative.
bool carry_over(int copy, int face, inout vec2 centre, inout vec3 conic, inout float norm, inout float radius, out int to_face) {
    vec2 tile = u_map_size / vec2(3.0, 2.0);
    vec3 right, up, forward;
    glc_cube_axes(face, right, up, forward);
    vec2 t = (centre / tile - vec2(face % 3, face / 3)) * 2.0 - 1.0;
    vec3 d = forward + t.x * right + t.y * up;
    int own = face / 2, second = (own + 1) % 3, third = (own + 2) % 3;
    if (abs(d[third]) > abs(d[second])) { int swap = second; second = third; third = swap; }
    int axis = copy == 1 ? second : third;
    to_face = axis * 2 + (d[axis] < 0.0 ? 1 : 0);
    vec3 right_to, up_to, forward_to;
    glc_cube_axes(to_face, right_to, up_to, forward_to);
    float z = dot(d, forward_to);
    if (z < 0.5) return false;   // farther from the border than any splat reaches
    vec2 to = vec2(dot(d, right_to), dot(d, up_to)) / z;
    mat2 j = mat2((vec2(dot(right, right_to), dot(right, up_to)) - to * dot(right, forward_to)) / z,
                  (vec2(dot(up, right_to), dot(up, up_to)) - to * dot(up, forward_to)) / z);
    mat2 back = inverse(j);
    mat2 q = transpose(back) * mat2(conic.x, conic.y, conic.y, conic.z) * back;
    conic = vec3(q[0][0], q[0][1], q[1][1]);
    norm /= abs(determinant(j));
    radius *= sqrt(dot(j[0], j[0]) + dot(j[1], j[1]));
    centre = (to * 0.5 + 0.5 + vec2(to_face % 3, to_face / 3)) * tile;
    return true;
}
#endif

#if BOX
const float CUTOFF = 7.0;   // SPLAT_CUTOFF in splat.frag

// Corner of the box around the kernel, turned with it; of a square where the border of the map mirrors the kernel.
vec2 corner_of(int corner, vec2 centre, vec3 conic, float radius) {
    vec2 at = vec2(corner == 1 || corner == 3 || corner == 4, corner == 2 || corner == 4 || corner == 5) * 2.0 - 1.0;
#if RECEIVER_FACES == 1
    if (any(lessThan(min(centre, u_map_size - centre), vec2(radius + 1.0)))) return at * (radius + 1.0);
#endif
    float mean = 0.5 * (conic.x + conic.z), half_difference = 0.5 * (conic.x - conic.z);
    float apart = sqrt(half_difference * half_difference + conic.y * conic.y);
    vec2 narrow = half_difference > 0.0 ? vec2(half_difference + apart, conic.y) : vec2(conic.y, apart - half_difference);
    narrow = dot(narrow, narrow) > 0.0 ? normalize(narrow) : vec2(1.0, 0.0);
    vec2 reach = sqrt(CUTOFF / max(vec2(mean + apart, mean - apart), 1e-12));
    reach = min(reach, vec2(radius + 1.0));
    return at.x * reach.x * narrow + at.y * reach.y * vec2(-narrow.y, narrow.x);
}
#endif

void main() {
#if BOX
    int splat_index = gl_VertexID / 6, corner = gl_VertexID - 6 * splat_index;
#else
    int splat_index = gl_VertexID;
    gl_PointSize = 1.0;
#endif
    int index = splat_index % u_count;
    ivec2 texel = ivec2(index % u_width, index / u_width);
    vec4 splat = texelFetch(t_splat, texel, 0);
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    v_centre = splat.xy;
    v_conic = vec3(1.0, 0.0, 1.0);
    v_flux = vec3(0.0);
    v_tile = vec4(0.0, 0.0, u_map_size);
    if (splat.z <= 0.0) return;
    vec4 conic = texelFetch(t_conic, texel, 0);
#if RECEIVER_FACES == 6
    vec2 tile = u_map_size / vec2(3.0, 2.0);
    int face = int(splat.w + 0.5), copy = splat_index / u_count;
    if (copy > 0) {
        int to_face;
        vec2 centre = splat.xy;
        vec3 shape = conic.xyz;
        float norm = conic.w, radius = splat.z;
        if (!carry_over(copy, face, centre, shape, norm, radius, to_face)) return;
        face = to_face;
        v_centre = centre;
        conic = vec4(shape, norm);
        splat.z = radius;
    }
    v_tile.xy = vec2(face % 3, face / 3) * tile;
    v_tile.zw = v_tile.xy + tile;
    if (distance(clamp(v_centre, v_tile.xy, v_tile.zw), v_centre) > splat.z) return;
#endif
    v_conic = conic.xyz;
    v_flux = texelFetch(t_flux, texel, 0).rgb * conic.w;
#if BOX
    gl_Position = vec4((v_centre + corner_of(corner, v_centre, conic.xyz, splat.z)) / u_map_size * 2.0 - 1.0, 0.0, 1.0);
#else
    vec2 point = clamp(v_centre, v_tile.xy, v_tile.zw);   // a point whose centre lies outside of the map would be clipped as a whole
    gl_Position = vec4(point / u_map_size * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = 2.0 * splat.z + 1.0;
#endif
}
