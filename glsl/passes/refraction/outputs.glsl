// What the eye's view is written to; only what some pass or AOV reads exists.
#if HAS_RADIANCE
layout(location = LOCATION_RADIANCE) out vec4 o_radiance;
#endif
#if HAS_CAUSTICS_VIEW
layout(location = LOCATION_CAUSTICS_VIEW) out vec4 o_caustics;   // E_c at the first non-specular surface of the eye's path
#endif
#if HAS_STATUS
layout(location = LOCATION_STATUS) out float o_status;           // GLC_VIEW_*
#endif
#if HAS_TODO
layout(location = LOCATION_TODO) out float o_todo;               // GLC_TODO_*
#endif
#if HAS_REFLECTION_M
layout(location = LOCATION_REFLECTION_M) out float o_reflection_m;   // metres to where the reflected ray was solved; 0: it was not
#endif
#if HAS_BEHIND
layout(location = LOCATION_BEHIND) out float o_behind;           // 1: a second specular surface may be met, see behind.frag
#endif
#if HAS_SOLVE
layout(location = LOCATION_SOLVE) out vec4 o_solve;              // uv of the hit, error in pixels, texel look-ups
#endif

// What the cascade's last stage must finish: also the mask's depth (todo.frag).
#define GLC_TODO_NOTHING 0.0
#define GLC_TODO_REFLECTION 0.5
#define GLC_TODO_ALL 1.0

// The way each pixel went; renderer.AOVS documents the same numbers.
#define GLC_VIEW_OPAQUE 0.0
#define GLC_VIEW_NEWTON 1.0
#define GLC_VIEW_SKY 2.0
#define GLC_VIEW_FALLBACK 3.0
#define GLC_VIEW_TIR 4.0
#define GLC_VIEW_MARCHED 5.0
#define GLC_VIEW_OFFSCREEN 6.0
#define GLC_VIEW_HIDDEN 7.0
#define GLC_VIEW_SECOND 8.0

// What is seen somewhere. distance_m: of the way there, behind the interface.
struct Seen {
    vec3 radiance;
    vec3 caustics;
    float distance_m;
    vec2 uv;
    float error_px;
    float iterations;
    float status;
};

void write_view(Seen seen, float todo, float alpha, float reflection_m) {
#if HAS_RADIANCE
    o_radiance = vec4(seen.radiance, alpha);
#endif
#if HAS_TODO
    o_todo = todo;
#endif
#if HAS_REFLECTION_M
    o_reflection_m = reflection_m;
#endif
#if HAS_CAUSTICS_VIEW
    o_caustics = vec4(seen.caustics, 1.0);
#endif
#if HAS_STATUS
    o_status = seen.status;
#endif
#if HAS_SOLVE
    o_solve = vec4(seen.uv, seen.error_px, seen.iterations);
#endif
}
