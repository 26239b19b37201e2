// Temporal anti-aliasing: the camera is shifted by parts of a pixel from frame to frame, and the picture is the mean over the frames,
// followed along the motion of the first surface that the eye meets (Karis 2014, "High-Quality Temporal Supersampling"). What the
// surroundings of the pixel contradict is clipped (Salvi 2016, "An Excursion in Temporal Supersampling"). All means are taken of
// c / (1 + luminance x exposure), about as the tone mapper shows them, or single highlights would alias for ever.
#include "interface/camera.glsl"

uniform sampler2D t_radiance;
uniform sampler2D t_before;         // rgb: mean; w: frames in it, 0 = none
uniform sampler2D t_depth_m;
uniform sampler2D t_motion;
#if HAS_SPECULAR
uniform sampler2D t_specular_depth_m;
uniform sampler2D t_specular_motion;
#endif
uniform mat4 u_previous_clip_from_world;
uniform vec2 u_previous_jitter;     // uv
uniform float u_exposure;
uniform float u_max_frames;

in vec2 v_uv;
layout(location = 0) out vec4 o_radiance;

const float AT_REST = 0.3;          // squared change of the smoothed picture by the camera's shifts alone, variances of its surroundings
const float GAMMA = 1.25;           // half width of the box of likely colours, standard deviations (Salvi 2016)

bool is_finite(vec4 v) {
    return all(lessThan(abs(v), vec4(1e30)));   // false for NaN too
}

// To YCoCg of what is shown of a radiance, and back.
vec3 shown(vec3 c) {
    c *= u_exposure / (1.0 + u_exposure * dot(c, vec3(0.25, 0.5, 0.25)));
    return vec3(dot(c, vec3(0.25, 0.5, 0.25)), 0.5 * (c.r - c.b), dot(c, vec3(-0.25, 0.5, -0.25)));
}

vec3 radiance_of(vec3 y) {
    vec3 c = vec3(y.x + y.y - y.z, y.x + y.z, y.x - y.y - y.z);
    return max(c, 0.0) / (u_exposure * max(1.0 - y.x, 1e-6));
}

// Where the surface of this pixel stood in the last frame, relative to now, without either frame's shift. Of the nearest surface around,
// so that an edge moves with what it is the edge of.
vec2 motion_uv(ivec2 pixel) {
    ivec2 last = textureSize(t_depth_m, 0) - 1, nearest = pixel;
    float nearest_m = 1e30;
    for (int i = 0; i < 9; ++i) {
        ivec2 at = clamp(pixel + ivec2(i % 3, i / 3) - 1, ivec2(0), last);
        float depth_m = texelFetch(t_depth_m, at, 0).r;
#if HAS_SPECULAR
        float specular_m = texelFetch(t_specular_depth_m, at, 0).r;
        if (specular_m > 0.0) depth_m = specular_m;
#endif
        if (depth_m > 0.0 && depth_m < nearest_m) { nearest_m = depth_m; nearest = at; }
    }
    if (nearest_m == 1e30) {    // the sky turns with the camera
        vec4 clip = u_previous_clip_from_world * vec4(glc_camera_ray_ws(v_uv), 0.0);
        if (u_camera_lens.z == 1.0 || clip.w <= 0.0) return vec2(0.0);
        return v_uv - u_camera_jitter - (clip.xy / clip.w * 0.5 + 0.5 - u_previous_jitter);
    }
    vec2 motion = texelFetch(t_motion, nearest, 0).xy;
#if HAS_SPECULAR
    if (texelFetch(t_specular_depth_m, nearest, 0).r > 0.0) motion = texelFetch(t_specular_motion, nearest, 0).xy;
#endif
    return motion - (u_camera_jitter - u_previous_jitter);
}

// Cubic (Catmull, Rom 1974) by five bilinear look-ups, the corners left out (Jimenez 2016, "Filmic SMAA").
vec4 history(vec2 uv) {
    vec2 size = vec2(textureSize(t_before, 0));
    vec2 at = uv * size, center = floor(at - 0.5) + 0.5, f = at - center;
    vec2 w0 = f * (-0.5 + f * (1.0 - 0.5 * f)), w1 = 1.0 + f * f * (-2.5 + 1.5 * f);
    vec2 w3 = f * f * (-0.5 + 0.5 * f), w12 = 1.0 - w0 - w3;
    vec2 low = (center - 1.0) / size, high = (center + 2.0) / size, middle = (center + (w12 - w1) / w12) / size;
    vec4 sum = texture(t_before, middle) * (w12.x * w12.y);
    sum += texture(t_before, vec2(middle.x, low.y)) * (w12.x * w0.y) + texture(t_before, vec2(low.x, middle.y)) * (w0.x * w12.y);
    sum += texture(t_before, vec2(high.x, middle.y)) * (w3.x * w12.y) + texture(t_before, vec2(middle.x, high.y)) * (w12.x * w3.y);
    return sum / (w12.x * w12.y + w12.x * (w0.y + w3.y) + w12.y * (w0.x + w3.x));
}

// The same picture smoothed over 3 x 3 pixels (binomial), as it is shown.
vec3 smooth_history(vec2 uv) {
    vec2 half_px = 0.5 / vec2(textureSize(t_before, 0));
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) sum += shown(max(texture(t_before, uv + half_px * (2.0 * vec2(i & 1, i >> 1) - 1.0)).rgb, 0.0));
    return 0.25 * sum;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), last = textureSize(t_radiance, 0) - 1;
    vec3 mean = vec3(0.0), square = vec3(0.0), here = vec3(0.0), smoothed = vec3(0.0);
    float count = 0.0, weight = 0.0, has_here = 0.0;
    for (int i = 0; i < 9; ++i) {
        vec4 at = vec4(texelFetch(t_radiance, clamp(pixel + ivec2(i % 3, i / 3) - 1, ivec2(0), last), 0).rgb, 0.0);
        if (!is_finite(at)) continue;
        vec3 color = shown(max(at.rgb, 0.0));
        mean += color;
        square += color * color;
        count += 1.0;
        float w = (i % 3 == 1 ? 2.0 : 1.0) * (i / 3 == 1 ? 2.0 : 1.0);
        smoothed += w * color;
        weight += w;
        if (i == 4) { here = color; has_here = 1.0; }
    }
    mean /= max(count, 1.0);
    vec3 variance = max(square / max(count, 1.0) - mean * mean, 0.0);
    vec3 half_width = GAMMA * sqrt(variance) + 1e-4 * mean.x;
    if (has_here == 0.0) here = mean;
    vec2 uv = v_uv - motion_uv(pixel);
    vec4 before = vec4(0.0);
    if (all(greaterThanEqual(uv, vec2(0.0))) && all(lessThanEqual(uv, vec2(1.0)))) before = history(uv);
    // A history that is not finite is none. Frames of neighbours without a history drag the number below one.
    if (!is_finite(before) || before.w < 0.5) before = vec4(0.0);
    vec3 old = shown(max(before.rgb, 0.0));
    vec3 off = old - mean, over = abs(off) / max(half_width, vec3(1e-12));
    old = mean + off / max(max(over.x, max(over.y, over.z)), 1.0);
    // Light that moves over the surface, or is seen through one that moves, is not where the motion says. The smoothed picture tells it
    // from aliasing, and the history is then worth fewer frames.
    float change = smoothed.x / max(weight, 1.0) - smooth_history(uv - u_camera_jitter).x;
    float moved = max(change * change / max(variance.x + 1e-8 * mean.x * mean.x, 1e-24) - AT_REST, 0.0);
    float frames = min(1.0 + before.w / (1.0 + before.w * min(moved, 1e6)), u_max_frames);
    o_radiance = vec4(radiance_of(mix(old, here, 1.0 / frames)), frames);
}
