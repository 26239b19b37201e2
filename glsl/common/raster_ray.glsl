// A ray and the surfaces of a camera's G-buffer in raster space: pixels in xy and an affine depth s in z. In raster space rays
// are straight lines walked at constant speed, and planes are affine: s = c + g . px. So one division intersects a ray with a
// tangent plane, and projects the result too. Pure functions, no uniforms.
//   perspective: s = 1 / depth     orthographic: s = -depth     (larger s is nearer; depth along the view axis, metres)
// Source of the perspective-correct step: McGuire & Mara 2014, sec. 3 (there for 1/w and q/w).

struct GlcRasterRay {
    vec3 start;        // px, px, s at the ray's origin
    vec3 step;         // to its end: the point at u in [0, 1] is start + u step
    float length_m;    // distance from origin to end, world space, metres
    vec2 w;            // homogeneous w at origin and end
    float u_screen;    // where the ray leaves the picture, in [0, 1]
};

// From a pixel with affine depth s, start = (px, s) and w its homogeneous w (depth in metres; 1 when orthographic).
// raster_from_world: rows give X, Y, S, W of a world point with px = XY / W, s = S / W (see `Raster` in passes/raster.py).
GlcRasterRay glc_raster_ray_from(mat4 raster_from_world, vec2 size, vec3 start, float w, vec3 d_ws, float length_m) {
    vec4 dq = raster_from_world * vec4(d_ws, 0.0);
    // Towards the eye the ray ends before the eye's plane, where raster space has no end.
    if (w + length_m * dq.w < 0.02 * w) length_m = -0.98 * w / dq.w;
    GlcRasterRay ray;
    ray.length_m = length_m;
    ray.w = vec2(w, w + length_m * dq.w);
    ray.start = start;
    ray.step = length_m * (dq.xyz - ray.start * dq.w) / ray.w.y;
    vec2 room = mix(ray.start.xy, size - ray.start.xy, greaterThan(ray.step.xy, vec2(0.0)));
    vec2 speed = max(abs(ray.step.xy), vec2(1e-6));
    bool sideways = room.x * speed.y < room.y * speed.x;
    ray.u_screen = clamp(sideways ? room.x / speed.x : room.y / speed.y, 0.0, 1.0);
    return ray;
}

// From a world point (metres), along a unit direction of world space, length_m metres long; otherwise the same.
GlcRasterRay glc_raster_ray(mat4 raster_from_world, vec2 size, vec3 origin_ws, vec3 d_ws, float length_m) {
    vec4 q = raster_from_world * vec4(origin_ws, 1.0);
    return glc_raster_ray_from(raster_from_world, size, q.xyz / q.w, q.w, d_ws, length_m);
}

// Metres along the ray at u.
float glc_raster_distance(GlcRasterRay ray, float u) {
    return ray.length_m * u * ray.w.x / mix(ray.w.y, ray.w.x, u);
}

// u at so many metres along the ray: the inverse of that.
float glc_raster_at(GlcRasterRay ray, float distance_m) {
    return distance_m * ray.w.y / max(ray.length_m * ray.w.x - distance_m * (ray.w.x - ray.w.y), 1e-30);
}

// A stored plane is (g.x, g.y, c, depth_m), depth 0 where nothing is stored. x: numerator, y: denominator of u at the
// intersection; y < 0 where the ray goes from in front of the surface (eye's side) to behind it; f(u) = u y - x is then the
// signed gap, > 0 in front.
vec2 glc_raster_plane(GlcRasterRay ray, vec4 plane) {
    float c = plane.w > 0.0 ? plane.z : -1e30;
    return vec2(c + dot(plane.xy, ray.start.xy) - ray.start.z, ray.step.z - dot(plane.xy, ray.step.xy));
}
