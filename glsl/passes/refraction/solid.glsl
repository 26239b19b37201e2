// The way through a solid: exits on its back faces and, after total internal reflection, on its front faces too (Wyman 2005,
// with both solved by Newton's method).
uniform sampler2D t_front_plane;
uniform sampler2D t_back_plane;
uniform sampler2D t_back_normal;

const int SOLID_ITERATIONS = 5;

// Where the ray leaves the solid, on the layer that it runs towards. n: unit, against the ray. False: an estimate.
bool solid_exit(vec3 p, vec3 d, out vec3 exit_ws, out vec3 n, out float t) {
    GlcRasterRay ray = eye_ray(p, d);
    bool away = ray.step.z < 0.0;   // s falls: the ray goes away from the eye
    GlcSolve solve;
    if (away) solve = glc_newton(t_back_plane, ray, 1.0, SOLID_ITERATIONS);
    else solve = glc_newton(t_front_plane, ray, -1.0, SOLID_ITERATIONS);
    // An unsolved exit (outlines, mostly) ends at the last point inside.
    float u = solve.status == GLC_SOLVE_HIT ? solve.u : min(solve.u, solve.u_front);
    vec2 uv = clamp((ray.start.xy + u * ray.step.xy) / u_raster_size, vec2(0.0), vec2(1.0));
    vec3 stored = away ? textureLod(t_back_normal, uv, 0.0).xyz : texelFetch(t_specular_normal, ivec2(uv * u_raster_size * 0.99999), 0).xyz;
    n = glc_safe_normalize(stored, -d);
    if (dot(n, d) > 0.0) n = -n;
    t = glc_raster_distance(ray, u);
    exit_ws = p + t * d;
    return solve.status == GLC_SOLVE_HIT;
}

// On entry d is the direction inside. tint takes Fresnel and absorption. Returns false where the light is still held inside after
// one total internal reflection; d is then the direction that it would go on in.
bool solid_through(inout vec3 p, inout vec3 d, float ior, vec3 sigma_a, inout vec3 tint) {
    for (int bounce = 0; bounce < 2; ++bounce) {
        vec3 exit_ws, n, outside;
        float t;
        // The other side of the solid is often hidden after a reflection inside: then the mirrored direction alone goes on.
        if (!solid_exit(p, d, exit_ws, n, t) && bounce > 0) return false;
        tint *= glc_transmittance(sigma_a, t);
        bool leaves = glc_refract(d, n, 1.0 / ior, outside);
        if (leaves) tint *= 1.0 - glc_fresnel_dielectric(-dot(n, d), 1.0 / ior);
        p = exit_ws;
        d = outside;
        if (leaves) return true;
    }
    return false;
}
