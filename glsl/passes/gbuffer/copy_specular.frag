// The first specular layer, where the second one is drawn over it: rays that leave its surfaces meet those of other objects beside them.
// Depth keeps the second one off where nothing can be seen behind the first.
#include "interface/objects.glsl"

uniform sampler2D t_depth_m;
uniform sampler2D t_normal;
uniform sampler2D t_plane;
#if HAS_DEPTH_M
layout(location = LOCATION_DEPTH_M) out float o_depth_m;
#endif
#if HAS_NORMAL_WS
layout(location = LOCATION_NORMAL_WS) out vec4 o_normal_ws;
#endif
#if HAS_PLANE
layout(location = LOCATION_PLANE) out vec4 o_plane;
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 first = texelFetch(t_normal, pixel, 0);
    bool clear = first.w != 0.0 && int(texelFetch(t_objects, ivec2(0, int(abs(first.w) - 0.5)), 0).w + 0.5) != GLC_MIRROR;
    gl_FragDepth = clear ? 1.0 : 0.0;
#if HAS_DEPTH_M
    o_depth_m = texelFetch(t_depth_m, pixel, 0).r;
#endif
#if HAS_NORMAL_WS
    o_normal_ws = first;
#endif
#if HAS_PLANE
    o_plane = texelFetch(t_plane, pixel, 0);
#endif
}
