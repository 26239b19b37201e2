// Makes up for the look-up: bilinear interpolation between samples of f blurs by h^2 f'' / 12 in the mean, along each axis. As an
// exchange between pairs of texels, so that no flux is made or lost, and limited, so that an edge gets no rim and nothing turns
// negative: a texel gives away at most two thirds of its flux.
uniform sampler2D t_raw;

layout(location = 0) out vec4 o_flux;  // flux per texel, W or lm

const float LIMIT = 2.0;  // times the smaller one of a pair

vec3 exchange(vec3 here, ivec2 there, ivec2 lower, ivec2 upper) {
    if (any(lessThan(there, lower)) || any(greaterThanEqual(there, upper))) return vec3(0.0);
    vec3 other = max(texelFetch(t_raw, there, 0).rgb, 0.0);
    vec3 most = LIMIT * min(here, other);
    return clamp(here - other, -most, most);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(t_raw, 0);
#if RECEIVER_FACES == 6
    ivec2 tile = size / ivec2(3, 2);
    ivec2 lower = texel / tile * tile, upper = lower + tile;
#else
    ivec2 lower = ivec2(0), upper = size;
#endif
    vec3 here = max(texelFetch(t_raw, texel, 0).rgb, 0.0);
    vec3 sum = exchange(here, texel + ivec2(1, 0), lower, upper) + exchange(here, texel - ivec2(1, 0), lower, upper)
             + exchange(here, texel + ivec2(0, 1), lower, upper) + exchange(here, texel - ivec2(0, 1), lower, upper);
    o_flux = vec4(here + sum / 12.0, 0.0);
}
