// Depth along the axis of a light's view, from its tangent planes: what a march pixel by pixel reads at each step.
uniform sampler2D t_plane;
layout(location = 0) out float o_depth_m;

void main() {
    o_depth_m = texelFetch(t_plane, ivec2(gl_FragCoord.xy), 0).w;
}
