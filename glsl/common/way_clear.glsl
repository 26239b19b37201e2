#include "common/newton.glsl"

// How far the way of a ray towards u is clear, in u: points on it, against the nearest s of the 4 x 4 texels around each. u: all of it;
// less: after that point something may stand before the ray, it may have met it. `count` points at most, a cell apart where the way is
// short. The loop is left at its end: see newton.glsl.
float glc_way_clear(sampler2D t_bounds, vec2 size, GlcRasterRay ray, float u, int count) {
    vec2 way = abs(u * ray.step.xy);
    float points = min(floor(max(way.x, way.y) / 4.0), float(count)), stride = u / (points + 1.0);
    float i = 1.0;
    bool clear = true;
    for (;;) {
        vec3 p = ray.start + i * stride * ray.step;
        vec2 index = floor(clamp(p.xy, vec2(0.0), size - 0.001) / 4.0);
        clear = p.z > texelFetch(t_bounds, ivec2(index), 0).r || points < 1.0;
        i += 1.0;
        if (!clear || i > points) break;
    }
    return clear ? u : (i - 2.0) * stride;
}
