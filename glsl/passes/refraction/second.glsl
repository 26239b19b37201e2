// The second depth layer (gbuffer2, shade2): its planes and its picture are the first layer's wherever nothing stands behind that, so
// one march over it sees every surface as if what stands before it were not there.
uniform sampler2D t_radiance2;
uniform sampler2D t_plane2;
#if USE_MARCH
uniform sampler2D t_bounds2;
#endif
#if HAS_CAUSTICS_VIEW
uniform sampler2D t_caustics2;
#endif

const int SECOND_ITERATIONS = 8;   // of Newton's method, where nothing marches

// For rays that were behind some surface on their way: others are in front of all that the second layer holds. Of both layers, the
// surface that the ray meets first counts. status: GLC_VIEW_SECOND where only the second layer holds it.
void look_behind(GlcRasterRay ray, int steps, inout GlcSolve solve, inout float status) {
#if USE_MARCH
    GlcSolve behind = glc_march_hierarchical(t_bounds2, t_plane2, ray, steps);
#else
    GlcSolve behind = glc_newton(t_plane2, ray, 1.0, SECOND_ITERATIONS);
#endif
    behind.iterations += solve.iterations;
    if (behind.status != GLC_SOLVE_HIT || (solve.status == GLC_SOLVE_HIT && solve.u <= behind.u)) return;
    bool second = texelFetch(t_plane2, ivec2(behind.texel), 0).w != texelFetch(t_plane, ivec2(behind.texel), 0).w;
    if (!second && solve.status == GLC_SOLVE_HIT) return;
    solve = behind;
    if (second) status = GLC_VIEW_SECOND;
}

// As seen_hit, in the second layer's picture.
Seen seen_second(GlcRasterRay ray, GlcSolve solve) {
    vec3 end = ray.start + solve.u * ray.step;
    float depth_m = ORTHOGRAPHIC == 1 ? -end.z : 1.0 / end.z;
    vec2 uv = end.xy / u_raster_size;
    vec4 filtered = textureLod(t_radiance2, uv, 0.0);
    bool mixes = abs(filtered.a - depth_m) > 0.02 * abs(depth_m);
    if (mixes) filtered = texelFetch(t_radiance2, ivec2(solve.texel), 0);
    Seen seen = Seen(filtered.rgb, vec3(0.0), glc_raster_distance(ray, solve.u), uv, solve.error_px, float(solve.iterations), GLC_VIEW_SECOND);
#if HAS_CAUSTICS_VIEW
    seen.caustics = mixes ? texelFetch(t_caustics2, ivec2(solve.texel), 0).rgb : textureLod(t_caustics2, uv, 0.0).rgb;
#endif
    return seen;
}
