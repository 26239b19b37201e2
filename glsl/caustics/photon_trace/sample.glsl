// Where a photon starts: a point of the light's view of the specular surfaces, stratified over the view (Meenrattanakorn & Lambers
// 2022, sec. 3.1, take blue noise). Each photon stands for the flux of its stratum, so that any number of photons carries the same.
#include "common/sampling.glsl"
#include "interface/caster_view.glsl"

uniform sampler2D t_caster_position;
uniform sampler2D t_caster_normal;
uniform ivec2 u_photon_grid;    // strata; for a cube multiples of 3 and 2, so that none crosses a face's border
uniform vec3 u_sequence;        // this frame's element of a 3-d low-discrepancy sequence
uniform uint u_seed;

struct PhotonStart {
    vec3 position_ws;
    vec3 normal_ws;     // the mesh's own
    float side;         // > 0: the light is on the front
    int object;         // -1: nothing specular here
};

// Bilinear between texel centres where the four texels hold one smooth piece of one object, else the nearest texel.
PhotonStart photon_start(vec2 at) {
    ivec2 nearest = ivec2(at);
    vec4 position = texelFetch(t_caster_position, nearest, 0);
    vec4 normal = texelFetch(t_caster_normal, nearest, 0);
    PhotonStart start = PhotonStart(position.xyz, normal.xyz, normal.w, int(position.w + 0.5) - 1);
    if (start.object < 0) return start;
    float width = glc_texel_width(glc_caster_view(), position.xyz);
    ivec2 lower = ivec2(0), upper = ivec2(u_caster_size) - 1;
#if CASTER_FACES == 6
    ivec2 tile = ivec2(u_caster_size) / ivec2(3, 2);
    lower = nearest / tile * tile;
    upper = lower + tile - 1;
#endif
    vec2 base = floor(at - 0.5), f = at - 0.5 - base;
    vec4 weights = vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
    vec3 p = vec3(0.0), n = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        ivec2 texel = ivec2(base) + ivec2(i & 1, i >> 1);
        if (any(lessThan(texel, lower)) || any(greaterThan(texel, upper))) return start;
        vec4 q = texelFetch(t_caster_position, texel, 0), m = texelFetch(t_caster_normal, texel, 0);
        bool same = q.w == position.w && m.w * normal.w > 0.0 && abs(dot(q.xyz - position.xyz, normal.xyz)) < 2.0 * width;
        if (!same) return start;
        p += weights[i] * q.xyz;
        n += weights[i] * m.xyz;
    }
    start.position_ws = p;
    start.normal_ws = glc_safe_normalize(n, normal.xyz);
    return start;
}
