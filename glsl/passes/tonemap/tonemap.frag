// AgX tone mapping (Sobotka 2022; polynomial fit of the base contrast by Wrensch 2023, mean error 3.7e-6 of the log range),
// then the sRGB transfer function (IEC 61966-2-1).
uniform sampler2D t_radiance;
uniform float u_exposure;

in vec2 v_uv;
layout(location = 0) out vec4 o_color;

const mat3 AGX_INSET = mat3(0.842479062253094, 0.0423282422610123, 0.0423756549057051,
                            0.0784335999999992, 0.878468636469772, 0.0784336,
                            0.0792237451477643, 0.0791661274605434, 0.879142973793104);
const mat3 AGX_OUTSET = mat3(1.19687900512017, -0.0528968517574562, -0.0529716355144438,
                             -0.0980208811401368, 1.15190312990417, -0.0980434501171241,
                             -0.0990297440797205, -0.0989611768448433, 1.15107367264116);
const float AGX_MIN_EV = -12.47393;
const float AGX_MAX_EV = 4.026069;

vec3 agx_contrast(vec3 x) {
    vec3 x2 = x * x, x4 = x2 * x2;
    return 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
}

vec3 agx(vec3 radiance) {
    vec3 log_value = clamp(log2(max(AGX_INSET * radiance, 1e-10)), AGX_MIN_EV, AGX_MAX_EV);
    vec3 value = agx_contrast((log_value - AGX_MIN_EV) / (AGX_MAX_EV - AGX_MIN_EV));
    // The "punchy" look: a little more contrast and saturation.
    float luma = dot(value, vec3(0.2126, 0.7152, 0.0722));
    value = pow(max(value, 0.0), vec3(LOOK_POWER));
    value = mix(vec3(pow(max(luma, 0.0), LOOK_POWER)), value, LOOK_SATURATION);
    return pow(max(AGX_OUTSET * value, 0.0), vec3(2.2));
}

vec3 srgb_from_linear(vec3 c) {
    return mix(c * 12.92, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), c));
}

void main() {
    vec3 radiance = texelFetch(t_radiance, ivec2(gl_FragCoord.xy), 0).rgb;
    o_color = vec4(srgb_from_linear(clamp(agx(radiance * u_exposure), 0.0, 1.0)), 1.0);
}
