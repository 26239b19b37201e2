// What the photons of each block of a light's view brought to the picture: mean square of their irradiance at the pixels that they fell
// on, as it would be with even strata, blended with that of the last frames. Reads a lattice of the photons that started there.
uniform sampler2D t_landing;
uniform sampler2D t_flux;
uniform sampler2D t_strata;
uniform sampler2D t_previous;
layout(location = 0) out float o_contribution;

const int LATTICE = 8;       // photons a side of it
const float NEWEST = 0.5;    // weight of this frame

void main() {
    ivec2 block = ivec2(gl_FragCoord.xy);
    vec2 upper = vec2(texelFetch(t_strata, block, 0).r, texelFetch(t_strata, ivec2(BLOCKS, block.y), 0).r);
    vec2 lower = vec2(block.x > 0 ? texelFetch(t_strata, block - ivec2(1, 0), 0).r : 0.0,
                      block.y > 0 ? texelFetch(t_strata, ivec2(BLOCKS, block.y - 1), 0).r : 0.0);
    vec2 share = upper - lower;
    float density = max(share.x * share.y, 0.0) * float(BLOCKS * BLOCKS);
    vec2 size = vec2(textureSize(t_landing, 0));
    float sum = 0.0;
    for (int k = 0; k < LATTICE * LATTICE; ++k) {
        vec2 at = mix(lower, upper, (vec2(k % LATTICE, k / LATTICE) + 0.5) / float(LATTICE));
        ivec2 photon = ivec2(min(at * size, size - 1.0));
        vec4 landing = texelFetch(t_landing, photon, 0);
        float brought = dot(texelFetch(t_flux, photon, 0).rgb, vec3(0.2126, 0.7152, 0.0722)) * density * landing.z;
        sum += landing.w > 0.0 ? brought * brought : 0.0;
    }
    o_contribution = mix(texelFetch(t_previous, block, 0).r, sum / float(LATTICE * LATTICE), NEWEST);
}
