// Landing points in texels of the caustic map, where all that follows is measured: the map holds flux per texel, so area is
// counted in texels and no cosine enters, whatever the light and the receiver.
#include "interface/receiver_view.glsl"

uniform sampler2D t_landing;
uniform sampler2D t_caster_position;
uniform sampler2D t_caster_normal;
uniform float u_turn;   // how much a ray turns with the normal: 2 reflected, about a half refracted

layout(location = 0) out vec4 o_projected;  // xy: texels, see grid.glsl; z: 8 x key + face, key 0: none lands; w: see below

void main() {
    o_projected = vec4(0.0);
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 landing = texelFetch(t_landing, texel, 0);
    if (landing.w <= 0.0) return;
    GlcView view = glc_receiver_view();
    int face = glc_view_face(view, landing.xyz);
    vec4 caster = texelFetch(t_caster_position, texel, 0);
    // A sliver one texel wide has no neighbour to measure against: its normal's change over the texel says how far it spreads.
    float bend = abs(texelFetch(t_caster_normal, texel, 0).w) - 1.0;
    float spread = u_turn * bend * length(landing.xyz - caster.xyz) / max(glc_texel_width(view, landing.xyz), 1e-30);
#if RECEIVER_FACES == 1
    // From the middle of the map: half the rounding, which differences of neighbours would magnify.
    vec4 clip = view.clip_from_world * vec4(landing.xyz, 1.0);
    vec2 place = clip.xy / clip.w * (0.5 * view.size);
#else
    vec2 place = glc_view_project_on(view, landing.xyz, face).xy;
#endif
    float key = 64.0 * caster.w + floor(0.5 * (landing.w - 1.0));  // one sheet: the same object, and the same path through solids
    o_projected = vec4(place, 8.0 * key + float(face), spread);
}
