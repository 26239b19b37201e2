// The object table: four texels a drawn instance, row = object index. What a host engine replaces by its own material fetch.
//   texel 0: base colour rgb, optical kind    texel 1: index of refraction of r, g, b; roughness
//   texel 2: absorption sigma_a rgb (1/m), transmission    texel 3: emissive radiance rgb, metallic
uniform sampler2D t_objects;

#define GLC_DIFFUSE 0
#define GLC_MIRROR 1
#define GLC_SOLID 2
#define GLC_INTERFACE 3

struct GlcObject {
    vec3 base_color;
    int kind;
    vec3 ior;
    float roughness;
    vec3 sigma_a;
    float transmission;
};

GlcObject glc_object(int index) {
    vec4 a = texelFetch(t_objects, ivec2(0, index), 0);
    vec4 b = texelFetch(t_objects, ivec2(1, index), 0);
    vec4 c = texelFetch(t_objects, ivec2(2, index), 0);
    return GlcObject(a.rgb, int(a.w + 0.5), b.rgb, b.w, c.rgb, c.w);
}
