// The grid of displaced vertices: one a texel of the casters' view. Places are texels of the map, counted from its middle; on a cube
// from the corner of the atlas.
#include "interface/receiver_view.glsl"

#define LINK_HERE 1    // bits of t_vertex.w: light lands;
#define LINK_RIGHT 2   // one sheet with the next vertex of the row;
#define LINK_UP 4      // one sheet with the next vertex of the column

uniform sampler2D t_projected;
#if RECEIVER_FACES == 6
uniform sampler2D t_landing;
#endif

int grid_key(vec4 projected) { return int(projected.z + 0.5) / 8; }
int grid_face(vec4 projected) { return int(projected.z + 0.5) % 8; }

// Where a vertex lies on a face's plane, texels of the map; z: by how much larger its area is there than on its own face; 0: behind it.
vec3 grid_on_face(ivec2 texel, vec4 projected, int face) {
#if RECEIVER_FACES == 6
    int own = grid_face(projected);
    if (own == face) return vec3(projected.xy, 1.0);
    GlcView view = glc_receiver_view();
    vec3 landing = texelFetch(t_landing, texel, 0).xyz;
    vec3 there = glc_view_project_on(view, landing, face);
    float cosines = glc_view_project_on(view, landing, own).z / max(there.z, 1e-30);
    return there.z > 0.1 * length(landing - view.light.xyz) ? vec3(there.xy, cosines * cosines * cosines) : vec3(0.0);
#else
    return vec3(projected.xy, 1.0);
#endif
}
