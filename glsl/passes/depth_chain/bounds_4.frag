// Largest and smallest affine depth s over 4 x 4 texels of the planes, each plane taken to its texel's corners.
uniform sampler2D t_plane;
layout(location = 0) out vec2 o_bounds;

void main() {
    ivec2 first = 4 * ivec2(gl_FragCoord.xy), last = textureSize(t_plane, 0) - 1;
    vec2 bounds = vec2(-1e30, 1e30);
    for (int y = 0; y < 4; ++y) {
        for (int x = 0; x < 4; ++x) {
            ivec2 texel = min(first + ivec2(x, y), last);
            vec4 plane = texelFetch(t_plane, texel, 0);
            float s = plane.w > 0.0 ? plane.z + dot(plane.xy, vec2(texel) + 0.5) : -1e30;
            float reach = 0.5 * (abs(plane.x) + abs(plane.y));
            bounds = vec2(max(bounds.x, s + reach), min(bounds.y, s - reach));
        }
    }
    o_bounds = bounds;
}
