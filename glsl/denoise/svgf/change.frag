// By how much the light has changed since the last frame, against the noise of one: what the history is shortened by.
#include "denoise/svgf/common.glsl"

uniform sampler2D t_difference;
uniform sampler2D t_noise;
uniform sampler2D t_doubt;

// How many times its expectation the one difference of the mean of 9 blocks must be, and how many times the resampling's doubt is put down to
// noise, so that it seldom is taken for a change.
const float MEAN = 7.0, DOUBT = 4.0;
// An error that neighbours share passes the filter over space, noise does not: it counts as much more as that takes of the noise, about.
const float GAIN = 16.0;

layout(location = 0) out float o_change;    // squared error of the history by the change / variance of a frame's pixel

// A mean of squares is known to its standard error, and a few bright pixels make that as large as the mean.
float significant(float excess, float standard_error) {
    return excess * smoothstep(1.5, 2.5, excess / max(standard_error, 1e-30));
}

void main() {
    o_change = 0.0;
    ivec2 block = ivec2(gl_FragCoord.xy), last = textureSize(t_difference, 0) - 1;
    vec4 difference = vec4(0.0), noise = vec4(0.0), near = vec4(0.0);
    vec3 blocks = vec3(0.0);
    vec2 doubt = vec2(0.0);
    float near_doubt = 0.0;
    vec2 error = vec2(0.0);     // of the sums of squares, by pixels and by blocks
    for (int i = 0; i < 25; ++i) {
        ivec2 offset = ivec2(i % 5, i / 5) - 2, at = block + offset;
        if (any(lessThan(at, ivec2(0))) || any(greaterThan(at, last))) continue;
        vec4 d = texelFetch(t_difference, at, 0);
        if (d.w <= 0.0) continue;
        bool inner = max(abs(offset.x), abs(offset.y)) < 2;
        vec2 q = texelFetch(t_doubt, at, 0).xy;
        vec4 n = texelFetch(t_noise, at, 0);
        float squared = d.x * d.x / d.w;
        blocks += vec3(squared, 1.0, q.x * q.x / d.w);
        error = vec2(svgf_hypotenuse(error.x, n.y), svgf_hypotenuse(error.y, squared));
        doubt += q;
        difference += d;
        noise += n;
        if (inner) { near += d; near_doubt += q.x; }
    }
    if (difference.w < 8.0 || difference.y <= 0.0) return;
    // Variance of one pixel in one frame. Over time a change counts as noise, over space fine detail does: the lesser is nearer to it.
    float over_space = noise.x / difference.w;
    float one = noise.w > 0.5 * difference.w ? min(noise.z / noise.w, over_space) : over_space;
    one = max(one, 1e-4 * difference.y / difference.w);
    float both = one * (1.0 + difference.z / difference.w);    // of new - old, if the light stands still
    // Besides: what resampling alone may have done, by pixels and by what their errors have in common.
    float by_pixels = significant((difference.y - DOUBT * doubt.y) / difference.w - both, error.x / difference.w);
    // Of means, in units of a pixel's variance.
    float by_blocks = significant((blocks.x - DOUBT * blocks.z) / blocks.y - both, error.y / blocks.y);
    float by_mean = near.w > 8.0 ? near.x * near.x / near.w - MEAN * both - DOUBT * near_doubt * near_doubt / near.w : 0.0;
    float change = max(max(by_pixels, by_blocks), max(by_mean, 0.0)) * GAIN / one;
    o_change = change < 1e6 ? change : 1e6;     // also for NaN
}
