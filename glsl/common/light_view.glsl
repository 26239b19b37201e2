#include "common/optics.glsl"

// Views from a light: one orthographic or perspective frustum, or six 90-degree faces in a 3x2 atlas (cube map of a
// point light; moderngl attaches no cube faces). Pure functions over a GlcView, no uniforms. Points p_ws: world space, metres.
// Sources: perspective views of a lamp, Williams 1978; the solid angle of a texel (cos^3 off the axis), Pharr et al. 2023.

struct GlcView {
    mat4 clip_from_world;  // the single frustum; unused by a cube
    vec4 light;            // w = 0: xyz = direction the light travels along; w = 1: xyz = light position, metres
    vec2 size;             // texels of the whole texture (of the atlas)
    float texel_measure;   // directional: m^2 of a texel; else tangent-plane area of a texel at unit distance (sr at the axis)
    vec3 forward_ws;       // axis of a single perspective frustum
    int faces;             // 1, or 6
};

// Right, up and forward axis (world space, unit) of a cube face: +X -X +Y -Y +Z -Z.
void glc_cube_axes(int face, out vec3 right, out vec3 up, out vec3 forward) {
    float s = (face & 1) == 0 ? 1.0 : -1.0;
    if (face < 2) { forward = vec3(s, 0, 0); up = vec3(0, 1, 0); }
    else if (face < 4) { forward = vec3(0, s, 0); up = vec3(0, 0, -s); }
    else { forward = vec3(0, 0, s); up = vec3(0, 1, 0); }
    right = cross(forward, up);
}

// The face that a direction d (world space, any length but zero) leaves through.
int glc_cube_face(vec3 d) {
    vec3 a = abs(d);
    if (a.x >= a.y && a.x >= a.z) return d.x >= 0.0 ? 0 : 1;
    if (a.y >= a.z) return d.y >= 0.0 ? 2 : 3;
    return d.z >= 0.0 ? 4 : 5;
}

// The face that sees a world point; 0 of a single frustum.
int glc_view_face(GlcView view, vec3 p_ws) {
    return view.faces == 1 ? 0 : glc_cube_face(p_ws - view.light.xyz);
}

// Texel coordinates (not uv) of a world point on a given face; z > 0 where the point is in front of the light.
vec3 glc_view_project_on(GlcView view, vec3 p_ws, int face) {
    if (view.faces == 1) {
        vec4 clip = view.clip_from_world * vec4(p_ws, 1.0);
        float w = clip.w > 0.0 ? clip.w : 1.0;
        return vec3((clip.xy / w * 0.5 + 0.5) * view.size, clip.w);
    }
    vec3 right, up, forward;
    glc_cube_axes(face, right, up, forward);
    vec3 d = p_ws - view.light.xyz;
    float depth = dot(d, forward);
    vec2 tan_xy = vec2(dot(d, right), dot(d, up)) / (depth > 0.0 ? depth : 1.0);
    vec2 tile_size = view.size / vec2(3.0, 2.0);
    return vec3((vec2(face % 3, face / 3) + tan_xy * 0.5 + 0.5) * tile_size, depth);
}

// Texel coordinates of a world point in the face that sees it; z > 0 where the point is in front of the light.
vec3 glc_view_project(GlcView view, vec3 p_ws) {
    int face = glc_view_face(view, p_ws);
    vec3 projected = glc_view_project_on(view, p_ws, face);
    if (view.faces == 6) {   // a point on the very border of a face rounds into the tile beside it, which shows something else
        vec2 tile_size = view.size / vec2(3.0, 2.0);
        vec2 lower = vec2(face % 3, face / 3) * tile_size;
        projected.xy = clamp(projected.xy, lower, lower + tile_size - 0.01);
    }
    return projected;
}

// Whether the view holds what glc_view_project returned.
bool glc_view_inside(GlcView view, vec3 projected) {
    return projected.z > 0.0 && all(greaterThanEqual(projected.xy, vec2(0.0))) && all(lessThan(projected.xy, view.size));
}

// Distance along the light's rays, metres: along its direction, or from its position.
float glc_light_distance(GlcView view, vec3 p_ws) {
    return view.light.w == 0.0 ? dot(view.light.xyz, p_ws) : length(p_ws - view.light.xyz);
}

// Unit direction the light travels in at p.
vec3 glc_light_direction(GlcView view, vec3 p_ws) {
    return view.light.w == 0.0 ? view.light.xyz : glc_safe_normalize(p_ws - view.light.xyz, vec3(0.0, -1.0, 0.0));
}

// Axis (world space, unit) of the frustum or face that sees p.
vec3 glc_view_forward(GlcView view, vec3 p_ws) {
    if (view.faces == 1) return view.forward_ws;
    vec3 right, up, forward;
    glc_cube_axes(glc_view_face(view, p_ws), right, up, forward);
    return forward;
}

// Cross-section of the beam through one texel at p, perpendicular to the light, m^2. Directional: the same everywhere;
// point and spot: (solid angle of the texel) x distance^2, the solid angle being area x cos^3 off the axis.
float glc_texel_cross_section(GlcView view, vec3 p_ws) {
    if (view.light.w == 0.0) return view.texel_measure;
    vec3 d = p_ws - view.light.xyz;
    float d2 = max(dot(d, d), 1e-30);
    float cos_axis = max(dot(d, glc_view_forward(view, p_ws)) * inversesqrt(d2), 1e-3);
    return view.texel_measure * cos_axis * cos_axis * cos_axis * d2;
}

// Solid angle of the texel that sees p (point and spot lights), sr.
float glc_texel_solid_angle(GlcView view, vec3 p_ws) {
    vec3 d = glc_safe_normalize(p_ws - view.light.xyz, view.forward_ws);
    float cos_axis = max(dot(d, glc_view_forward(view, p_ws)), 1e-3);
    return view.texel_measure * cos_axis * cos_axis * cos_axis;
}

// Width of a texel at p, metres: the unit of every tolerance, so that nothing depends on the scene's scale.
float glc_texel_width(GlcView view, vec3 p_ws) {
    return sqrt(glc_texel_cross_section(view, p_ws));
}
