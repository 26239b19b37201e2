// Distance at which a ray leaves an axis-aligned box, metres; 0 if it never meets it. Pure, no uniforms. o: origin, metres; d: unit
// direction; box_min, box_max: metres, all in one space. Source: slabs, Kay & Kajiya 1986.
float glc_box_exit(vec3 o, vec3 d, vec3 box_min, vec3 box_max) {
    vec3 inv = 1.0 / mix(d, vec3(1e-20), equal(d, vec3(0.0)));
    vec3 a = (box_min - o) * inv, b = (box_max - o) * inv;
    vec3 lo = min(a, b), hi = max(a, b);
    float t_enter = max(max(lo.x, lo.y), lo.z), t_exit = min(min(hi.x, hi.y), hi.z);
    return t_exit >= max(t_enter, 0.0) ? t_exit : 0.0;
}
