// The caster's grid, every vertex moved to where its light lands (Mayer, Assarsson, Sintorn 2026, light rays, step 2). Six
// vertices a cell, without buffers: a cell that is not drawn leaves the picture before it is clipped. On a cube the mesh is drawn
// once for each face, so that a triangle that crosses a border is cut there and goes on behind it.
#include "caustics/displaced_mesh/grid.glsl"

uniform sampler2D t_vertex;
uniform sampler2D t_drawn;
uniform sampler2D t_cell;
uniform int u_width;        // of the grid, vertices
uniform vec2 u_map_size;    // texels
#if RECEIVER_FACES == 6
uniform int u_face;         // the one that is drawn now
#endif

out vec4 v_flux_det;        // rgb: flux of a texel of the casters' view, W or lm; w: the signed determinant
flat out vec2 v_density;    // largest density, factor

#if RECEIVER_FACES == 6
bool reaches_face(ivec2 cell) {
    for (int i = 0; i < 4; ++i)
        if (grid_face(texelFetch(t_projected, cell + ivec2(i & 1, i >> 1), 0)) == u_face) return true;
    return false;
}
#endif

void main() {
    int cell = gl_VertexID / 6, corner = gl_VertexID - 6 * cell;
    ivec2 texel = ivec2(cell % (u_width - 1), cell / (u_width - 1));
    vec4 densities = texelFetch(t_cell, texel, 0);
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    v_flux_det = vec4(0.0, 0.0, 0.0, 1.0);
    v_density = corner < 3 ? densities.xy : densities.zw;
    if (densities.x <= 0.0) return;
#if RECEIVER_FACES == 6
    if (!reaches_face(texel)) return;
#endif
    int index = corner < 3 ? corner : (corner == 3 ? 1 : (corner == 4 ? 3 : 2));  // 0 1 2 and 1 3 2
    texel += ivec2(index & 1, index >> 1);
    v_flux_det = texelFetch(t_drawn, texel, 0);
#if RECEIVER_FACES == 6
    vec3 on_face = grid_on_face(texel, texelFetch(t_projected, texel, 0), u_face);
    v_flux_det.w *= on_face.z;
    vec2 tile = u_map_size / vec2(3.0, 2.0);
    gl_Position = vec4((on_face.xy / tile - vec2(u_face % 3, u_face / 3)) * 2.0 - 1.0, 0.0, 1.0);
#else
    gl_Position = vec4(texelFetch(t_vertex, texel, 0).xy / u_map_size * 2.0, 0.0, 1.0);
#endif
}
