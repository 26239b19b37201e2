// Nearest affine depth s around each cell of 16 x 16 texels: within GLC_NEAR_CELLS cells (common/way_clear.glsl) in every direction.
#include "common/way_clear.glsl"

uniform sampler2D t_bounds;   // all levels of the chain
uniform ivec2 u_origin;       // of the level of 16 x 16 in it, texels
uniform ivec2 u_cells;        // of that level
layout(location = 0) out vec4 o_near;

void main() {
    ivec2 cell = ivec2(gl_FragCoord.xy);
    const int REACH = int(GLC_NEAR_CELLS.w);
    o_near = vec4(-1e30);
    for (int y = -REACH; y <= REACH; ++y) {
        for (int x = -REACH; x <= REACH; ++x) {
            float s = texelFetch(t_bounds, u_origin + clamp(cell + ivec2(x, y), ivec2(0), u_cells - 1), 0).r;
            bvec4 within = greaterThanEqual(GLC_NEAR_CELLS, vec4(max(abs(x), abs(y))));
            o_near = mix(o_near, max(o_near, vec4(s)), within);
        }
    }
}
