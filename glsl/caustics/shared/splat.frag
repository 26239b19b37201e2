// An elliptical Gaussian splat, cut at q = 7 and lowered to reach zero there, so that neighbours blend without a rim.
flat in vec2 v_centre;
flat in vec3 v_conic;
flat in vec3 v_flux;
flat in vec4 v_tile;

#if WARP
#include "interface/map_warp.glsl"
#endif
layout(location = 0) out vec4 o_flux;  // flux per texel of the map (of the view, where the map is warped), W or lm; additive

const float SPLAT_CUTOFF = 7.0;
const float SPLAT_FLOOR = 0.0301973834223;  // exp(-7/2)
const float SPLAT_BORDER_REACH = 64.0;  // texels: the largest radius a splat can have

float kernel(vec2 x) {
    float q = v_conic.x * x.x * x.x + 2.0 * v_conic.y * x.x * x.y + v_conic.z * x.y * x.y;
    return q < SPLAT_CUTOFF ? exp(-0.5 * q) - SPLAT_FLOOR : 0.0;
}

void main() {
    vec2 x = gl_FragCoord.xy - v_centre;
    float w = kernel(x);
#if RECEIVER_FACES == 6
    // What falls across the border of a cube face belongs to the copy on the other one.
    if (any(lessThan(gl_FragCoord.xy, v_tile.xy)) || any(greaterThanEqual(gl_FragCoord.xy, v_tile.zw))) discard;
#else
    // What would fall across the border of the map is mirrored back: no flux is lost, no rim darkens.
    vec2 mirrored = 2.0 * mix(v_tile.xy, v_tile.zw, step(0.5 * (v_tile.xy + v_tile.zw), v_centre)) - gl_FragCoord.xy - v_centre;
    vec2 to_border = min(v_centre - v_tile.xy, v_tile.zw - v_centre);
    if (min(to_border.x, to_border.y) < SPLAT_BORDER_REACH) {
        if (any(lessThan(gl_FragCoord.xy, v_tile.xy)) || any(greaterThanEqual(gl_FragCoord.xy, v_tile.zw))) discard;
        w += kernel(vec2(mirrored.x, x.y)) + kernel(vec2(x.x, mirrored.y)) + kernel(mirrored);
    }
#endif
    if (w <= 0.0) discard;
#if WARP
    w /= warped_area(ivec2(gl_FragCoord.xy));
#endif
    o_flux = vec4(v_flux * w, 0.0);
}
