// Random numbers and low-discrepancy points. Pure functions, no uniforms.
// Sources: Jarzynski & Olano 2020, "Hash Functions for GPU Rendering" (pcg3d); Roberts 2018 (R sequences); Cranley & Patterson 1976.

uvec3 glc_pcg3d(uvec3 v) {
    v = v * 1664525u + 1013904223u;
    v += v.yzx * v.zxy;
    v ^= v >> 16u;
    v += v.yzx * v.zxy;
    return v;
}

// In [0, 1), 24 bits: never 1 after rounding.
vec3 glc_unit_floats(uvec3 v) {
    return vec3(v >> 8u) * (1.0 / 16777216.0);
}

// Point of a stratum: a fixed random shift of the sequence's element of this frame, so that each stratum runs through a
// low-discrepancy sequence over the frames, and neighbours through different ones.
vec3 glc_stratum_point(uvec2 cell, uint seed, vec3 element) {
    return min(fract(glc_unit_floats(glc_pcg3d(uvec3(cell, seed))) + element), vec3(0.99999994));
}
