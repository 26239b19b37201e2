// Variance of the accumulated mean: over time where the history has some frames, over space where it has not (Schied et al. 2017, sec. 4.2).
// Pooled over neighbours on one surface: single pixels of a sparse estimate do not know their own variance.
#include "denoise/svgf/geometry.glsl"

uniform sampler2D t_color;
uniform sampler2D t_moments;

layout(location = 0) out vec4 o_estimate;  // rgb: mean; w: variance of its luminance

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), size = textureSize(t_color, 0);
    vec4 color = texelFetch(t_color, pixel, 0);
    o_estimate = vec4(color.rgb, 0.0);
    SvgfSurface here = svgf_surface(pixel);
    if (here.depth_m <= 0.0) return;
    float over_time = 0.0, weight = 0.0;
    vec2 over_space = vec2(0.0);
    for (int i = 0; i < 25; ++i) {
        ivec2 at = pixel + ivec2(i % 5, i / 5) - 2;
        if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size))) continue;
        float w = svgf_same_surface(here, svgf_surface(at), 2.0);
        vec4 other = texelFetch(t_color, at, 0);
        vec2 moments = texelFetch(t_moments, at, 0).rg;
        float luminance = svgf_luminance(other.rgb);
        over_time += w * max(moments.y - moments.x * moments.x, 0.0) / max(other.w - 1.0, 1.0);
        over_space += w * vec2(luminance, luminance * luminance);
        weight += w;
    }
    over_time /= max(weight, 1e-6);
    over_space /= max(weight, 1e-6);
    float spatial = max(over_space.y - over_space.x * over_space.x, 0.0);
    o_estimate.w = mix(spatial, over_time, smoothstep(2.0, 5.0, color.w));
}
