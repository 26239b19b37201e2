// One point a photon, added up in the camera's view as irradiance.
uniform sampler2D t_landing;
uniform sampler2D t_flux;
uniform int u_width;        // of the photons' texture
uniform vec2 u_view_size;   // pixels

flat out vec4 v_irradiance;

void main() {
    ivec2 texel = ivec2(gl_VertexID % u_width, gl_VertexID / u_width);
    vec4 landing = texelFetch(t_landing, texel, 0);
    gl_PointSize = 1.0;
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    v_irradiance = vec4(0.0);
    if (landing.w <= 0.0) return;
    v_irradiance = vec4(texelFetch(t_flux, texel, 0).rgb * landing.z, 1.0);
    gl_Position = vec4((landing.xy + 0.5) / u_view_size * 2.0 - 1.0, 0.0, 1.0);
}
