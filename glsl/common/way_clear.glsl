#include "common/newton.glsl"

// Whether the way to a hit of Newton's method is clear: ray points on it against the nearest s of 4 x 4 texels around them. False:
// something may stand before one of them, the ray may have met it first. Points one to `count`, a cell apart where the ray is short.
bool glc_way_is_clear(sampler2D t_bounds, vec2 size, GlcRasterRay ray, GlcSolve solve, int count) {
    vec2 way = abs(solve.u * ray.step.xy);
    int points = min(int(max(way.x, way.y) / 4.0), count);
    float stride = solve.u / float(points + 1);
    float clear = 1.0;
    for (int i = 1; i <= points; ++i) {
        vec3 p = ray.start + float(i) * stride * ray.step;
        vec2 index = floor(clamp(p.xy, vec2(0.0), size - 0.001) / 4.0);
        clear = min(clear, p.z - texelFetch(t_bounds, ivec2(index), 0).r);
    }
    return clear > 0.0;
}
