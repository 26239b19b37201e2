#include "common/optics.glsl"
#include "common/intersect_box.glsl"
#include "interface/camera.glsl"

// The dense medium that the eye is in (glcaustics/passes/eye_medium.py): it absorbs between the eye and the first surface.
uniform vec3 u_eye_sigma_a;      // 1/m
uniform float u_eye_ior;
uniform float u_eye_solid;       // object index + 1 of the closed solid that the eye is in; 0: below an open surface

// Beer-Lambert from the eye to the first surface, depth_m along the view axis; 0 where there is none: then the medium is taken to
// end with the scene's box. An orthographic camera looks from its own plane.
vec3 glc_eye_transmittance(vec2 uv, float depth_m, vec3 box_min, vec3 box_max) {
    vec3 start_ws = glc_camera_position_ws(uv, 0.0);
    float way_m = length(glc_camera_position_ws(uv, max(depth_m, 0.0)) - start_ws);
    if (depth_m <= 0.0) way_m = glc_box_exit(start_ws, glc_camera_ray_ws(uv), box_min, box_max);
    return glc_transmittance(u_eye_sigma_a, way_m);
}
