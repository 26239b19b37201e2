// Random numbers and low-discrepancy points. Pure functions, no uniforms.
// Sources: Jarzynski & Olano 2020, "Hash Functions for GPU Rendering" (pcg3d); Roberts 2018 (R sequences); Cranley & Patterson 1976;
// Morton 1966 (Z-order).

// Three random 32-bit numbers from three (Jarzynski & Olano 2020): equal ones for equal ones.
uvec3 glc_pcg3d(uvec3 v) {
    v = v * 1664525u + 1013904223u;
    v += v.yzx * v.zxy;
    v ^= v >> 16u;
    v += v.yzx * v.zxy;
    return v;
}

// Three numbers in [0, 1) from 32 random bits each, of which 24 count: never 1 after rounding.
vec3 glc_unit_floats(uvec3 v) {
    return vec3(v >> 8u) * (1.0 / 16777216.0);
}

// Point of a stratum: a fixed random shift of the sequence's element of this frame, so that each stratum runs through a
// low-discrepancy sequence over the frames, and neighbours through different ones (Cranley & Patterson 1976). element: of the
// sequence, in [0, 1)^3; returns in [0, 1)^3.
vec3 glc_stratum_point(uvec2 cell, uint seed, vec3 element) {
    return min(fract(glc_unit_floats(glc_pcg3d(uvec3(cell, seed))) + element), vec3(0.99999994));
}

// Number of a cell along the Z-order curve: the cells of every aligned 2^k x 2^k block have consecutive numbers. Up to 65536 a side.
uint glc_z_order(uvec2 cell) {
    cell = (cell | (cell << 8u)) & 0x00ff00ffu;
    cell = (cell | (cell << 4u)) & 0x0f0f0f0fu;
    cell = (cell | (cell << 2u)) & 0x33333333u;
    cell = (cell | (cell << 1u)) & 0x55555555u;
    return cell.x | (cell.y << 1u);
}

// Points in the unit square, beyond the stratum's own: neighbouring cells cover the square evenly together, and so does one cell over
// the frames. Sequences n alpha (mod 1) in 32-bit integers, exact for any n. pair: 0 to 2, independent of one another.
// alpha: (2 cos 40 deg, 4 cos^2 40 deg), (sqrt 2, sqrt 3), R2.
vec2 glc_cell_point(uvec2 cell, uint frame, uint seed, int pair) {
    uvec2 alpha[3] = uvec2[3](uvec2(2285304365u, 1491626488u), uvec2(1779033704u, 3144134277u), uvec2(3242174889u, 2447445414u));
    uvec3 shift = glc_pcg3d(uvec3(seed, uint(pair), 0x9e3779b9u));
    uvec2 n = glc_z_order(cell) * alpha[pair] + frame * alpha[(pair + 1) % 3] + shift.xy;
    return vec2(n >> 8u) * (1.0 / 16777216.0);
}
