// One punctual light (KHR_lights_punctual). Lux for directional lights, candela for point and spot.
uniform vec4 u_light;              // w = 0: xyz = direction of travel; w = 1: xyz = position, metres
uniform vec3 u_light_intensity;    // colour x intensity
uniform vec3 u_light_axis_ws;      // spot: direction of its axis
uniform vec2 u_light_cone;         // spot: scale and offset of the angular fall-off (glTF); (0, 1) without a cone

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
