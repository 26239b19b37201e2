// The determinant that is interpolated over the triangles. Linear interpolation lies above a convex function, by h^2 f'' / 12 in the
// mean: it is lowered by as much, or every focus between two vertices would come out too dark.
#include "caustics/displaced_mesh/grid.glsl"

uniform sampler2D t_exact;

layout(location = 0) out vec4 o_vertex;  // as t_exact: xy place, z determinant, w links

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 vertex = texelFetch(t_exact, texel, 0);
    o_vertex = vertex;
    if (any(equal(texel, ivec2(0))) || any(equal(texel, textureSize(t_exact, 0) - 1))) return;
    vec4 left = texelFetch(t_exact, texel - ivec2(1, 0), 0), right = texelFetch(t_exact, texel + ivec2(1, 0), 0);
    vec4 down = texelFetch(t_exact, texel - ivec2(0, 1), 0), up = texelFetch(t_exact, texel + ivec2(0, 1), 0);
    bool joined = (int(left.w) & LINK_RIGHT) != 0 && (int(down.w) & LINK_UP) != 0
               && (int(vertex.w) & (LINK_RIGHT | LINK_UP)) == (LINK_RIGHT | LINK_UP);
    if (!joined) return;
    float bend = left.z + right.z + down.z + up.z - 4.0 * vertex.z;
    float limit = 0.5 * abs(vertex.z);
    o_vertex.z = vertex.z - clamp(bend / 12.0, -limit, limit);
}
