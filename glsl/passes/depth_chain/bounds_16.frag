// Largest and smallest affine depth s over 4 x 4 texels of the finer bounds.
uniform sampler2D t_bounds_4;
layout(location = 0) out vec2 o_bounds;

void main() {
    ivec2 first = 4 * ivec2(gl_FragCoord.xy), last = textureSize(t_bounds_4, 0) - 1;
    vec2 bounds = vec2(-1e30, 1e30);
    for (int y = 0; y < 4; ++y) {
        for (int x = 0; x < 4; ++x) {
            vec2 finer = texelFetch(t_bounds_4, min(first + ivec2(x, y), last), 0).rg;
            bounds = vec2(max(bounds.x, finer.x), min(bounds.y, finer.y));
        }
    }
    o_bounds = bounds;
}
