// One light (KHR_lights_punctual) with an optional size. Lux for directional lights, candela for point and spot.
uniform vec4 u_light;              // w = 0: xyz = direction of travel; w = 1: xyz = position, metres
uniform vec3 u_light_intensity;    // colour x intensity
uniform vec3 u_light_axis_ws;      // spot: direction of its axis
uniform vec2 u_light_cone;         // spot: scale and offset of the angular fall-off (glTF); (0, 1) without a cone
uniform float u_light_size;        // point, spot: radius of the sphere, metres; directional: sine of half the angular diameter

// Direction of travel at p from a point of the light's even disc or sphere; d: from its centre. xi in [0, 1)^2. Even over the disc as
// it lies projected on a plane across d: with a surface's normal n, dot(n, new) / (dot(n, d) dot(new, d)) times the centre's flux is
// exactly what a disc of even radiance or such a sphere sends through the same piece of surface (mean 1 where all of it is above).
vec3 glc_light_jitter(vec3 p_ws, vec3 d, vec2 xi) {
    float s = u_light_size;
    if (u_light.w != 0.0) s = min(s * inversesqrt(max(dot(p_ws - u_light.xyz, p_ws - u_light.xyz), 1e-30)), 0.99);
    vec3 helper = abs(d.z) < 0.7 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0);
    vec3 t = normalize(cross(helper, d));
    float r = s * sqrt(xi.x), phi = 6.28318530717959 * xi.y;
    return d * sqrt(1.0 - r * r) + (t * cos(phi) + cross(d, t) * sin(phi)) * r;
}

// Angular fall-off of a spot, 1 for other lights. d: direction of travel.
float glc_light_cone(vec3 d) {
    float a = clamp(dot(d, u_light_axis_ws) * u_light_cone.x + u_light_cone.y, 0.0, 1.0);
    return a * a;
}

// Irradiance on a plane at p perpendicular to the light; d: direction of travel at p.
vec3 glc_light_perpendicular_irradiance(vec3 p_ws, out vec3 d) {
    if (u_light.w == 0.0) {
        d = u_light.xyz;
        return u_light_intensity;
    }
    vec3 v = p_ws - u_light.xyz;
    float d2 = max(dot(v, v), 1e-30);
    d = v * inversesqrt(d2);
    return u_light_intensity * glc_light_cone(d) / d2;
}
