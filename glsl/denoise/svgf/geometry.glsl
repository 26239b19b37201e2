#include "denoise/svgf/common.glsl"
#include "interface/camera.glsl"

uniform sampler2D t_depth_m;
uniform sampler2D t_normal_ws;

struct SvgfSurface {
    float depth_m;      // 0: nothing there
    vec3 position_ws;
    vec3 normal_ws;
};

SvgfSurface svgf_surface(ivec2 pixel) {
    vec2 size = vec2(textureSize(t_depth_m, 0));
    float depth_m = texelFetch(t_depth_m, pixel, 0).r;
    return SvgfSurface(depth_m, glc_camera_position_ws((vec2(pixel) + 0.5) / size, depth_m), texelFetch(t_normal_ws, pixel, 0).xyz);
}

float svgf_pixel_width(float depth_m) {
    return 2.0 * u_camera_lens.y / float(textureSize(t_depth_m, 0).y) * (u_camera_lens.z == 0.0 ? depth_m : 1.0);
}

// How much two pixels `reach` pixels apart show one surface, in [0, 1]. Symmetric.
float svgf_same_surface(SvgfSurface a, SvgfSurface b, float reach) {
    if (a.depth_m <= 0.0 || b.depth_m <= 0.0) return 0.0;
    vec3 off = a.position_ws - b.position_ws;
    float beside = abs(dot(off, a.normal_ws)) + abs(dot(off, b.normal_ws));
    float cosine = max(dot(a.normal_ws, b.normal_ws), 0.0);
    float c4 = cosine * cosine; c4 *= c4;
    float c16 = c4 * c4; c16 *= c16;
    return c16 * c16 * exp(-beside / (0.5 * reach * svgf_pixel_width(max(a.depth_m, b.depth_m))));
}
