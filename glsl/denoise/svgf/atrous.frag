// One pass of the a-trous filter (Dammertz et al. 2010; variance-guided: Schied et al. 2017, sec. 4.3), in conservative form: neighbours
// exchange c_q - c_p times a weight that is the same from both sides, so that the sum over the picture stays as it was. Normalised
// weights would let bright single samples give more than their dark neighbours take. The first pass tells light apart by a smoothed
// luminance, since single pixels of a sparse estimate look like nothing around them, unless two pixels differ by more than their noise.
#include "denoise/svgf/geometry.glsl"

uniform sampler2D t_source;    // rgb: mean; w: variance of its luminance
#if GUIDED
uniform sampler2D t_guide;     // luminance, smoothed
#endif
uniform int u_step;            // pixels

layout(location = 0) out vec4 o_color;

const float SIGMA_LUMINANCE = 2.0, NOISE = 2.0;   // standard deviations

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), size = textureSize(t_source, 0);
    vec4 center = texelFetch(t_source, pixel, 0);
    o_color = center;
    SvgfSurface here = svgf_surface(pixel);
    if (here.depth_m <= 0.0) return;
#if GUIDED
    float luminance = texelFetch(t_guide, pixel, 0).r;
#else
    float luminance = svgf_luminance(center.rgb);
#endif
    vec3 gained = vec3(0.0);
    float given = 0.0, variance = 0.0;
    for (int i = 0; i < 9; ++i) {
        if (i == 4) continue;
        ivec2 offset = ivec2(i % 3, i / 3) - 1, at = pixel + u_step * offset;
        if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size))) continue;
        vec4 other = texelFetch(t_source, at, 0);
        float deviation = sqrt(0.5 * (center.w + other.w));
#if GUIDED
        float beyond_noise = abs(svgf_luminance(other.rgb - center.rgb)) - NOISE * sqrt(center.w + other.w);
        float difference = max(abs(texelFetch(t_guide, at, 0).r - luminance), beyond_noise);
#else
        float difference = abs(svgf_luminance(other.rgb) - luminance);
#endif
        if (difference > 16.0 * deviation) continue;
        float w = (abs(offset.x) + abs(offset.y) == 1 ? 0.125 : 0.0625) * exp(-difference / max(SIGMA_LUMINANCE * deviation, 1e-30));
        w *= svgf_same_surface(here, svgf_surface(at), float(u_step) * 1.5);
        gained += w * (other.rgb - center.rgb);
        given += w;
        variance += w * w * other.w;
    }
    o_color = vec4(center.rgb + gained, variance + (1.0 - given) * (1.0 - given) * center.w);
}
