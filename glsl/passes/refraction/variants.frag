// One way of solving rays over a G-buffer, for tests and the bench (glcaustics/bench/solver_variants.py), not for the frame.
// VARIANT: 0 stored planes (what the frame does), 1 stored normals, 2 depth alone, 3 curvature, 4 filtered, 5 pixel by pixel.
#include "common/newton_variants.glsl"
#include "common/ray_march.glsl"
#include "interface/raster.glsl"

uniform sampler2D t_origin;      // xyz: the ray's origin, world space, metres
uniform sampler2D t_direction;   // xyz: unit direction, world space; w: length, metres, 0 = no ray
#if VARIANT == 1 || VARIANT == 2 || VARIANT == 5
uniform sampler2D t_depth_m;
#endif
#if VARIANT != 1 && VARIANT != 2
uniform sampler2D t_plane;
#endif
#if VARIANT == 1
uniform sampler2D t_normal;
uniform mat3 u_ray_from_px;
#elif VARIANT == 4
uniform sampler2D t_plane_mips;
uniform float u_width;           // of the filter, gaps
#endif
uniform int u_iterations;

layout(location = 0) out vec4 o_solve;   // pixel coordinates of the estimate, status, texel look-ups

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 d = texelFetch(t_direction, at, 0);
    o_solve = vec4(0.0);
    if (d.w <= 0.0) return;
    GlcRasterRay ray = glc_raster_ray(u_raster_from_world, u_raster_size, texelFetch(t_origin, at, 0).xyz, d.xyz, d.w);
#if VARIANT == 0
    GlcSolve solve = glc_newton(t_plane, ray, 1.0, u_iterations);
#elif VARIANT == 1
    GlcSolve solve = glc_newton_normals(t_depth_m, t_normal, u_ray_from_px, ORTHOGRAPHIC == 1, ray, u_iterations);
#elif VARIANT == 2
    GlcSolve solve = glc_newton_depth(t_depth_m, ORTHOGRAPHIC == 1, ray, u_iterations);
#elif VARIANT == 3
    GlcSolve solve = glc_newton_curved(t_plane, ray, u_iterations);
#elif VARIANT == 4
    GlcSolve solve = glc_newton_filtered(t_plane, t_plane_mips, ray, u_width, u_iterations);
#else
    GlcSolve solve = glc_march_dda(t_depth_m, t_plane, ORTHOGRAPHIC == 1, ray, u_iterations);
#endif
    o_solve = vec4(ray.start.xy + solve.u * ray.step.xy, float(solve.status), float(solve.iterations));
}
