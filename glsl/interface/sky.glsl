// Radiance beyond the scene: ground, horizon and zenith blended over the elevation.
uniform vec3 u_sky_zenith;
uniform vec3 u_sky_horizon;
uniform vec3 u_sky_ground;

vec3 glc_sky_radiance(vec3 d) {
    float up = clamp(d.y, -1.0, 1.0);
    return mix(u_sky_horizon, up >= 0.0 ? u_sky_zenith : u_sky_ground, sqrt(abs(up)));
}

// Irradiance of that sky on a plane with normal n, unoccluded: E = pi x cosine-weighted mean. Over the upper half the mean of
// sqrt(cos) under the cosine lobe is 4/5 (int of 2 cos^(3/2) d cos); the tilt blends the two halves linearly.
vec3 glc_sky_irradiance(vec3 n) {
    vec3 above = mix(u_sky_horizon, u_sky_zenith, 0.8);
    vec3 below = mix(u_sky_horizon, u_sky_ground, 0.8);
    return 3.14159265 * mix(below, above, 0.5 + 0.5 * n.y);
}
