// Planes as they are from behind: with the affine depth s and the ray's own turned about, what faces away from the eye is met from its
// front by the same search (behind.frag). A texel wider than they are: a ray that enters through the outline itself crosses them there.
uniform sampler2D t_plane;
layout(location = 0) out vec4 o_plane;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), last = textureSize(t_plane, 0) - 1;
    vec4 plane = texelFetch(t_plane, pixel, 0);
    for (int i = 0; i < 4; ++i) {
        ivec2 beside = (i & 1) * 2 - 1 > 0 ? ivec2((i >> 1) * 2 - 1, 0) : ivec2(0, (i >> 1) * 2 - 1);
        if (plane.w == 0.0) plane = texelFetch(t_plane, clamp(pixel + beside, ivec2(0), last), 0);
    }
    o_plane = vec4(-plane.xyz, plane.w);
}
