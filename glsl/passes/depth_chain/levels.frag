// One level of the chain: largest and smallest affine depth s over STEP x STEP of the finest level's cells.
uniform sampler2D t_bounds_4;
uniform ivec2 u_origin;   // of the level in the texture, texels
layout(location = 0) out vec2 o_bounds;

void main() {
    ivec2 first = STEP * (ivec2(gl_FragCoord.xy) - u_origin), last = textureSize(t_bounds_4, 0) - 1;
    vec2 bounds = vec2(-1e30, 1e30);
    for (int y = 0; y < STEP; ++y) {
        for (int x = 0; x < STEP; ++x) {
            vec2 finer = texelFetch(t_bounds_4, min(first + ivec2(x, y), last), 0).rg;
            bounds = vec2(max(bounds.x, finer.x), min(bounds.y, finer.y));
        }
    }
    o_bounds = bounds;
}
