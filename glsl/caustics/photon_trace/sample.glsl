// Where a photon starts: a point of the light's view of the specular surfaces, stratified over the view (Meenrattanakorn & Lambers
// 2022, sec. 3.1, take blue noise). Each photon stands for the flux of its stratum, so that any number of photons carries the same.
#include "common/sampling.glsl"
#include "interface/caster_view.glsl"

uniform sampler2D t_caster_position;
uniform sampler2D t_caster_normal;
uniform ivec2 u_photon_grid;    // strata; for a cube multiples of 3 and 2, so that none crosses a face's border
uniform vec3 u_sequence;        // this frame's element of a 3-d low-discrepancy sequence
uniform uint u_seed;

#if ADAPTIVE
uniform sampler2D t_strata;     // cumulative shares of the blocks (strata.frag)

// The block of a row of t_strata that a number in [0, 1) falls into, and where in it. xy: position in [0, 1), density.
vec2 photon_block(float xi, int row, bool over_rows) {
    int block = 0;
    vec2 share = vec2(0.0, 1.0);
    for (int stride = BLOCKS / 2; stride > 0; stride /= 2) {
        int last = block + stride - 1;
        float upper = texelFetch(t_strata, over_rows ? ivec2(BLOCKS, last) : ivec2(last, row), 0).r;
        bool beyond = xi >= upper;
        block += beyond ? stride : 0;
        share = beyond ? vec2(upper, share.y) : vec2(share.x, upper);
    }
    float width = max(share.y - share.x, 1e-12);
    return vec2((float(block) + clamp((xi - share.x) / width, 0.0, 0.99999)) / float(BLOCKS), width * float(BLOCKS));
}
#endif

// Moves a point of the unit square of the strata onto the view's. Returns how many photons start there, 1 = as if even.
float photon_warp(inout vec2 uv) {
#if ADAPTIVE
    vec2 y = photon_block(uv.y, 0, true);
    vec2 x = photon_block(uv.x, int(y.x * float(BLOCKS)), false);
    uv = vec2(x.x, y.x);
    return x.y * y.y;
#else
    return 1.0;
#endif
}

struct PhotonStart {
    vec3 position_ws;
    vec3 normal_ws;     // the mesh's own
    float side;         // > 0: the light is on the front
    int object;         // -1: nothing specular here
};

// Bilinear between texel centres where the four texels hold one smooth piece of one object, else the nearest texel.
PhotonStart photon_start(vec2 at) {
    vec2 base = floor(at - 0.5), f = at - 0.5 - base;
    vec2 lower = vec2(0.0), upper = u_caster_size - 1.0;
#if CASTER_FACES == 6
    vec2 tile = u_caster_size / vec2(3.0, 2.0);
    lower = floor(at / tile) * tile;
    upper = lower + tile - 1.0;
#endif
    bool smooth_piece = all(greaterThanEqual(base, lower)) && all(lessThan(base, upper));
    vec4 q[4], m[4];
    for (int i = 0; i < 4; ++i) {
        ivec2 texel = ivec2(clamp(base + vec2(i & 1, i >> 1), lower, upper));
        q[i] = texelFetch(t_caster_position, texel, 0);
        m[i] = texelFetch(t_caster_normal, texel, 0);
    }
    bvec2 right = greaterThanEqual(f, vec2(0.5));
    vec4 position = right.y ? (right.x ? q[3] : q[2]) : (right.x ? q[1] : q[0]);
    vec4 normal = right.y ? (right.x ? m[3] : m[2]) : (right.x ? m[1] : m[0]);
    float reach = 2.0 * glc_texel_width(glc_caster_view(), position.xyz);
    vec4 weights = vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
    vec3 p = vec3(0.0), n = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        bool same = q[i].w == position.w && m[i].w * normal.w > 0.0 && abs(dot(q[i].xyz - position.xyz, normal.xyz)) < reach;
        smooth_piece = smooth_piece && same;
        p += weights[i] * q[i].xyz;
        n += weights[i] * m[i].xyz;
    }
    if (!smooth_piece) { p = position.xyz; n = normal.xyz; }
    return PhotonStart(p, smooth_piece ? glc_safe_normalize(n, normal.xyz) : n, normal.w, int(position.w + 0.5) - 1);
}
