// The camera. What a host engine replaces by its own view uniforms.
uniform mat4 u_world_from_camera;
uniform vec4 u_camera_lens;   // xy: tangents of the half angles (perspective) or half sizes in metres (orthographic); z: 1 = orthographic
uniform vec2 u_camera_jitter; // uv: sub-pixel shift of the picture, contained in the matrix too (anti-aliasing)

// World position of a pixel. depth_m: distance along the view axis.
vec3 glc_camera_position_ws(vec2 uv, float depth_m) {
    vec2 xy = ((uv - u_camera_jitter) * 2.0 - 1.0) * u_camera_lens.xy * (u_camera_lens.z == 0.0 ? depth_m : 1.0);
    return (u_world_from_camera * vec4(xy, -depth_m, 1.0)).xyz;
}

// Unit direction of the eye ray through a pixel (away from the eye).
vec3 glc_camera_ray_ws(vec2 uv) {
    vec3 d = u_camera_lens.z == 0.0 ? vec3(((uv - u_camera_jitter) * 2.0 - 1.0) * u_camera_lens.xy, -1.0) : vec3(0.0, 0.0, -1.0);
    return normalize((u_world_from_camera * vec4(d, 0.0)).xyz);
}
