// From texels of the receiver view to those of a map whose texels crowd where the caustic is sharp; see caustics/map_warp.py.
uniform sampler2D t_warp;   // rows 0, 1: the segments of x and y; rows 2, 3: widths of the map's columns and rows, texels of the view

float warp_axis(float at, int axis, float segments_per_texel, out float rate) {
    float place = (at * segments_per_texel + 0.5) * float(WARP);
    float segment = clamp(floor(place), 0.0, float(WARP) - 1.0);
    vec4 s = texelFetch(t_warp, ivec2(int(segment), axis), 0);
    float t = place - segment, inside = clamp(t, 0.0, 1.0);  // beyond the window it goes on straight
    rate = s.y + s.z * inside;
    return s.x + s.w * ((s.y + 0.5 * s.z * inside) * inside + (t - inside) * rate);
}

// Both count from the middle. `rate`: texels of the map in one of the view.
vec2 warp(vec2 at, vec2 view_size, out vec2 rate) {
    return vec2(warp_axis(at.x, 0, 1.0 / view_size.x, rate.x), warp_axis(at.y, 1, 1.0 / view_size.y, rate.y));
}

// Texels of the view in one of the map.
float warped_area(ivec2 texel) {
    return texelFetch(t_warp, ivec2(texel.x, 2), 0).r * texelFetch(t_warp, ivec2(texel.y, 3), 0).r;
}
