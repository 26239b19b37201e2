#include "common/newton.glsl"

// How far a ray is clear of a G-buffer, by few look-ups of depth bounds (a chain of them: Uludag 2014): no march, and on the safe side.

// Cells of 16 x 16 texels, to all sides, over which depth_chain.near holds the nearest s, one channel each.
const vec4 GLC_NEAR_CELLS = vec4(1.0, 2.0, 4.0, 6.0);

// How far the ray is in front of all that is near it: nothing can be met before that u. t_near: rgba32f. The widest square that still
// tells counts most: a ray leaves the small ones, and comes down to the nearest of the wide ones.
float glc_way_above(sampler2D t_near, vec2 size, GlcRasterRay ray) {
    vec4 nearest = texelFetch(t_near, ivec2(clamp(ray.start.xy, vec2(0.0), size - 0.001) / 16.0), 0);
    vec4 down = (nearest - ray.start.z) / min(ray.step.z, -1e-30);
    vec4 above = min(down, 16.0 * GLC_NEAR_CELLS / max(max(abs(ray.step.x), abs(ray.step.y)), 1e-6));
    return clamp(max(max(above.x, above.y), max(above.z, above.w)), 0.0, ray.u_screen);
}

// How far the way of a ray towards u is clear, in u: points on it, against the nearest s of the 4 x 4 texels around each. u: all of it;
// less: after that point something may stand before the ray, it may have met it. `count` points at most, a cell apart where the way is
// short; those before `from` are clear. The loop is left at its end: see newton.glsl.
float glc_way_clear(sampler2D t_bounds, vec2 size, GlcRasterRay ray, float from, float u, int count) {
    vec2 way = abs(u * ray.step.xy);
    float points = min(floor(max(way.x, way.y) / 4.0), float(count)), stride = u / (points + 1.0);
    float i = max(1.0, floor(from / max(stride, 1e-20)));
    bool clear = true;
    for (;;) {
        vec3 p = ray.start + i * stride * ray.step;
        vec2 index = floor(clamp(p.xy, vec2(0.0), size - 0.001) / 4.0);
        clear = p.z > texelFetch(t_bounds, ivec2(index), 0).r || i > points;
        i += 1.0;
        if (!clear || i > points) break;
    }
    return clear ? u : (i - 2.0) * stride;
}
