// Variance of the accumulated mean: over time where the history has some frames, over space where it has not (Schied et al. 2017, sec. 4.2).
// Pooled over neighbours on one surface: single pixels of a sparse estimate do not know their own variance. Where the method tells how
// many samples a pixel holds, it is no more than that of independent ones, and a pixel's share of it goes by the samples that it gets, as
// their number's variance does (Poisson): a focus of many photons is no noise, nor is the dark beside it as noisy as the focus.
#include "denoise/svgf/geometry.glsl"

uniform sampler2D t_color;
uniform sampler2D t_moments;
uniform sampler2D t_noisy;     // this frame; w: samples in the pixel, 0 where the method does not tell

layout(location = 0) out vec4 o_estimate;  // rgb: mean; w: variance of its luminance
layout(location = 1) out float o_guide;    // luminance, smoothed over 3 x 3 pixels

const float UNSEEN = 0.1;   // samples that may yet come to a pixel where none has

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), size = textureSize(t_color, 0);
    vec4 color = texelFetch(t_color, pixel, 0);
    o_estimate = vec4(color.rgb, 0.0);
    o_guide = 0.0;
    SvgfSurface here = svgf_surface(pixel);
    if (here.depth_m <= 0.0) return;
    float over_time = 0.0, weight = 0.0;
    vec2 narrow = vec2(0.0);
    // Over space: the mixed difference of quads of pixels, which knows nothing of light that is constant or runs along one axis.
    // A plain variance would take the caustic itself for noise and blur it.
    float over_space = 0.0, quads = 0.0;
    vec2 counted = vec2(0.0);   // sums over samples of this frame: of their squares; of them
    float level = 0.0;          // of the mean
    vec2 above[5];
    for (int y = 0; y < 5; ++y) {
        vec2 left = vec2(0.0);
        for (int x = 0; x < 5; ++x) {
            ivec2 at = pixel + ivec2(x, y) - 2;
            bool inside = all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, size));
            vec2 one = vec2(0.0);
            if (inside) {
                float w = svgf_same_surface(here, svgf_surface(at), 2.0);
                vec4 other = texelFetch(t_color, at, 0);
                vec2 moments = texelFetch(t_moments, at, 0).rg;
                one = vec2(svgf_luminance(other.rgb), w);
                over_time += w * max(moments.y - moments.x * moments.x, 0.0) / max(other.w - 1.0, 1.0);
                weight += w;
                level += w * one.x;
                vec4 noisy = texelFetch(t_noisy, at, 0);
                float lone = svgf_luminance(noisy.rgb);
                if (svgf_is_finite(noisy) && noisy.w > 0.0) counted += w * vec2(lone * lone / noisy.w, lone);
                int off_x = abs(x - 2), off_y = abs(y - 2);
                if (max(off_x, off_y) < 2) narrow += w / float((1 + off_x) * (1 + off_y)) * vec2(one.x, 1.0);
            }
            if (x > 0 && y > 0) {
                float w = one.y * left.y * above[x].y * above[x - 1].y;
                float mixed = one.x - left.x - above[x].x + above[x - 1].x;
                over_space += w * 0.25 * mixed * mixed;
                quads += w;
            }
            if (x > 0) above[x - 1] = left;
            left = one;
        }
        above[4] = left;
    }
    weight = max(weight, 1e-6);
    over_time /= weight;
    over_space /= max(quads, 1e-6);
    o_guide = narrow.x / max(narrow.y, 1e-6);
    float variance = mix(over_space, over_time, smoothstep(2.0, 5.0, color.w));
    float frames = max(color.w, 1.0), one_sample = counted.y > 0.0 ? counted.x / counted.y : 0.0;   // what it brings to a pixel
    float independent = one_sample * max(level / weight, 0.0) / frames;
    if (independent > 0.0)
        variance = min(variance / independent, 1.0) * one_sample * (max(o_guide, 0.0) + UNSEEN * one_sample / frames) / frames;
    o_estimate.w = variance;
}
