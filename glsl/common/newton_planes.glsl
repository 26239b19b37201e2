#include "common/raster_ray.glsl"

// Tangent planes in raster space (see raster_ray.glsl) for G-buffers that store none: from stored normals, or from depth alone
// (Mayer, Assarsson, Sintorn 2026, sec. 2.2 name both). Pure functions, no uniforms. Where planes are stored they are the better
// choice: one fetch instead of two or nine, and a triangle's own plane agrees with the depths beside it, a smooth normal does not.

// Depth below which a slope is taken as edge-on, relative to the texel's own s.
const float GLC_PLANE_EDGE_ON = 1e-4;

// Plane (g.x, g.y, c, depth_m) through a texel, of a surface with a normal.
//   ray_from_px: perspective: eye ray of unit depth in world space = M (px, px, 1); orthographic: columns 0 and 1 are the world
//                offset of a pixel in metres, column 2 the view's forward axis
//   texel: integer coordinates; depth_m: along the view axis, metres, 0 = nothing; n_ws: any length but zero, either side
vec4 glc_plane_from_normal(mat3 ray_from_px, bool orthographic, vec2 texel, float depth_m, vec3 n_ws) {
    vec3 px = vec3(texel + 0.5, 1.0);
    vec3 k = n_ws * ray_from_px;
    float facing = orthographic ? k.z : dot(k, px);
    float least = GLC_PLANE_EDGE_ON * length(n_ws) * length(orthographic ? ray_from_px[2] : ray_from_px * px);
    if (abs(facing) < least) facing = facing < 0.0 ? -least : least;
    float s = orthographic ? -depth_m : 1.0 / max(depth_m, 1e-30);
    vec2 g = orthographic ? k.xy / facing : k.xy * (s / facing);
    return vec4(g, s - dot(g, px.xy), depth_m);
}

// Affine depth s of a texel; -1e30 where nothing is stored or the picture ends.
float glc_raster_s(sampler2D t_depth_m, bool orthographic, ivec2 texel) {
    ivec2 size = textureSize(t_depth_m, 0);
    if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, size))) return -1e30;
    float depth_m = texelFetch(t_depth_m, texel, 0).r;
    return depth_m <= 0.0 ? -1e30 : (orthographic ? -depth_m : 1.0 / depth_m);
}

// Slope of s a texel along one axis, from the side whose two texels continue to the middle one: s is affine on planes, so beside
// an edge the wrong side gives itself away. No surface on either side: 0, facing the eye.
float glc_one_sided_slope(float s, vec2 before, vec2 after) {
    float misfit_before = abs(2.0 * before.x - before.y - s), misfit_after = abs(2.0 * after.x - after.y - s);
    // A lone texel on one side (its neighbour is another surface) still tells more than nothing.
    if (min(misfit_before, misfit_after) > 1e29) {
        bool has_before = before.x > -1e29, has_after = after.x > -1e29;
        if (!has_before && !has_after) return 0.0;
        return has_before && (!has_after || abs(s - before.x) < abs(after.x - s)) ? s - before.x : after.x - s;
    }
    return misfit_before < misfit_after ? s - before.x : after.x - s;
}

// Plane through a texel from nine depths: itself and two to each side. depth 0 where the texel holds nothing.
vec4 glc_plane_from_depth(sampler2D t_depth_m, bool orthographic, vec2 texel) {
    ivec2 at = ivec2(texel);
    float s = glc_raster_s(t_depth_m, orthographic, at);
    if (s <= -1e29) return vec4(0.0);
    vec2 g;
    for (int axis = 0; axis < 2; ++axis) {
        ivec2 e = axis == 0 ? ivec2(1, 0) : ivec2(0, 1);
        vec2 before = vec2(glc_raster_s(t_depth_m, orthographic, at - e), glc_raster_s(t_depth_m, orthographic, at - 2 * e));
        vec2 after = vec2(glc_raster_s(t_depth_m, orthographic, at + e), glc_raster_s(t_depth_m, orthographic, at + 2 * e));
        float slope = glc_one_sided_slope(s, before, after);
        if (axis == 0) g.x = slope; else g.y = slope;
    }
    return vec4(g, s - dot(g, texel + 0.5), orthographic ? -s : 1.0 / s);
}
