// One vertex a texel of the casters' light view, moved to where its light lands (Shah et al. 2007, sec. III C).
uniform sampler2D t_splat;
uniform sampler2D t_conic;
uniform sampler2D t_flux;
uniform int u_width;        // of the grid, texels
uniform vec2 u_map_size;    // texels

flat out vec2 v_centre;
flat out vec3 v_conic;
flat out vec3 v_flux;
flat out vec4 v_tile;       // xy: lower corner, zw: upper corner, texels

void main() {
    ivec2 texel = ivec2(gl_VertexID % u_width, gl_VertexID / u_width);
    vec4 splat = texelFetch(t_splat, texel, 0);
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = 1.0;
    v_centre = splat.xy;
    v_conic = vec3(1.0, 0.0, 1.0);
    v_flux = vec3(0.0);
    v_tile = vec4(0.0, 0.0, u_map_size);
    if (splat.z <= 0.0) return;
    vec4 conic = texelFetch(t_conic, texel, 0);
    v_conic = conic.xyz;
    v_flux = texelFetch(t_flux, texel, 0).rgb * conic.w;
    gl_Position = vec4(splat.xy / u_map_size * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = 2.0 * splat.z + 1.0;
#if RECEIVER_FACES == 6
    vec2 tile = u_map_size / vec2(3.0, 2.0);
    int face = int(splat.w + 0.5);
    v_tile.xy = vec2(face % 3, face / 3) * tile;
    v_tile.zw = v_tile.xy + tile;
#endif
}
