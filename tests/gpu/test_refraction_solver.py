"""The eye rays' solvers, each as one GLSL function, against float64 ray casting of analytic height fields.

The G-buffer's planes come from the closed form in float64, texel by texel: the solver alone is tested.
Camera at the origin, looking down -z; surfaces are depths over the picture, as in `common/raster_ray.glsl`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from glcaustics.gpu import Device, Program, ShaderLoader, glsl_root
from glcaustics.passes.camera import CameraState
from glcaustics.passes.raster import raster_from_world
from glcaustics.scene.model import Camera

FloatArray = npt.NDArray[np.float64]
Surface = Callable[[FloatArray], FloatArray]  # of points (..., 3): 0 on the surface, > 0 towards the eye

SIZE = (192, 128)
TAN_Y = 0.5
HIT, OFFSCREEN, DISCONTINUITY, DIVERGED, NOTHING, HIDDEN = 1, 2, 3, 4, 5, 6
NEWTON, DDA, HIERARCHICAL, RESTARTING = 0, 1, 2, 3

SHADER = """
#include "common/ray_march.glsl"
uniform sampler2D t_origin;
uniform sampler2D t_direction;
uniform sampler2D t_plane;
uniform sampler2D t_depth;
uniform sampler2D t_bounds;
uniform mat4 u_raster_from_world;
uniform vec2 u_size;
uniform int u_solver;
uniform int u_iterations;
layout(location = 0) out vec4 o_solve;   // metres, error, status, look-ups
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 d = texelFetch(t_direction, at, 0);
    GlcRasterRay ray = glc_raster_ray(u_raster_from_world, u_size, texelFetch(t_origin, at, 0).xyz, d.xyz, d.w);
    GlcSolve solve;
    if (u_solver == 0) solve = glc_newton(t_plane, ray, 1.0, u_iterations);
    else if (u_solver == 3) solve = glc_newton_from(t_plane, ray, 1.0, 0.0, true, u_iterations);
    else if (u_solver == 1) solve = glc_march_dda(t_depth, t_plane, false, ray, u_iterations);
    else solve = glc_march_hierarchical(t_bounds, t_plane, ray, u_iterations);
    o_solve = vec4(glc_raster_distance(ray, solve.u), solve.error_px, float(solve.status), float(solve.iterations));
}
"""


class Bench:
    """Solves a batch of rays over one surface's planes."""

    def __init__(self, device: Device, folder: Path) -> None:
        self.device = device
        for name in ("common", "interface"):
            (folder / name).symlink_to(glsl_root() / name)
        (folder / "x.frag").write_text(SHADER)
        self.program = Program(device.ctx, ShaderLoader(folder).load("x", None), "x", ())
        view = Camera(world_from_camera=np.eye(4), yfov_rad=2.0 * np.arctan(TAN_Y))
        self.camera = CameraState.make(view, SIZE, np.array([[-9.0, -9.0, -20.0], [9.0, 9.0, -0.1]]))

    def solve(
        self, depth: FloatArray, planes: FloatArray, origin: FloatArray, ray: FloatArray, solver: int, count: int
    ):
        """depth (H, W), planes (H, W, 4), origin (H, W, 3), ray (H, W, 4): direction and length. Returns (H, W, 4)."""
        device = self.device

        def upload(data: FloatArray, format: str) -> object:
            data = np.ascontiguousarray(data, np.float32)
            return device.texture((data.shape[1], data.shape[0]), format, data=data)

        four = np.concatenate([origin, np.ones_like(origin[..., :1])], axis=-1)
        fine = bounds(depth, planes)
        made = {
            "t_plane": upload(planes, "rgba32f"),
            "t_depth": upload(depth[..., None], "r32f"),
            "t_origin": upload(four, "rgba32f"),
            "t_direction": upload(ray, "rgba32f"),
            "t_bounds": upload(levels(fine), "rg32f"),
        }
        out = device.texture((origin.shape[1], origin.shape[0]), "rgba32f")
        framebuffer = device.framebuffer([out])
        self.program.set(
            **made,
            u_raster_from_world=raster_from_world(self.camera, SIZE),
            u_size=tuple(map(float, SIZE)),
            u_solver=solver,
            u_iterations=count,
        )
        device.draw_fullscreen(self.program, framebuffer)
        result = device.read(out).astype(np.float64)
        framebuffer.release()
        for texture in (*made.values(), out):
            texture.release()
        return result


@pytest.fixture
def bench(device: Device, tmp_path: Path) -> Iterator[Bench]:
    made = Bench(device, tmp_path)
    yield made
    made.program.release()


def pool(fine: FloatArray) -> FloatArray:
    """(H, W, 2) bounds to a quarter of the size."""
    h, w = -(-fine.shape[0] // 4) * 4, -(-fine.shape[1] // 4) * 4
    padded = np.pad(fine, ((0, h - fine.shape[0]), (0, w - fine.shape[1]), (0, 0)), mode="edge")
    blocks = padded.reshape(h // 4, 4, w // 4, 4, 2)
    return np.stack([blocks[..., 0].max(axis=(1, 3)), blocks[..., 1].min(axis=(1, 3))], axis=-1)


def levels(fine: FloatArray) -> FloatArray:
    """The three levels in one texture, as `glc_bounds_texel` finds them."""
    middle = pool(fine)
    coarse = pool(middle)
    height = max(fine.shape[0], middle.shape[0] + coarse.shape[0])
    made = np.zeros((height, fine.shape[1] + middle.shape[1], 2))
    made[: fine.shape[0], : fine.shape[1]] = fine
    made[: middle.shape[0], fine.shape[1] :] = middle
    made[middle.shape[0] : middle.shape[0] + coarse.shape[0], fine.shape[1] : fine.shape[1] + coarse.shape[1]] = coarse
    return made


def bounds(depth: FloatArray, planes: FloatArray) -> FloatArray:
    s = np.where(depth > 0, 1.0 / np.where(depth > 0, depth, 1.0), -1e30)
    reach = 0.5 * np.abs(planes[..., :2]).sum(axis=-1)
    return pool(np.stack([s + reach, s - reach], axis=-1))


def texel_rays() -> tuple[FloatArray, FloatArray]:
    """Pixel centres (H, W, 2), and the eye's direction with unit depth (H, W, 3). Row 0 at the bottom, as in GL."""
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    aspect = SIZE[0] / SIZE[1]
    ray = np.stack([(2 * x / SIZE[0] - 1) * TAN_Y * aspect, (2 * y / SIZE[1] - 1) * TAN_Y, -np.ones_like(x)], axis=-1)
    return np.stack([x, y], axis=-1), ray


def cast(f: Surface, o: FloatArray, d: FloatArray, length: float, steps: int = 600) -> FloatArray:
    """First root of f along o + t d, f > 0 at the start: scan and bisection in float64. inf where there is none."""
    found = np.full(o.shape[:-1], np.inf)
    lo = np.zeros(o.shape[:-1])
    for t in np.linspace(0.0, length, steps)[1:]:
        crossed = (f(o + t * d) <= 0.0) & ~np.isfinite(found)
        found = np.where(crossed, t, found)
        lo = np.where(np.isfinite(found), lo, t)
    hi = np.where(np.isfinite(found), found, 0.0)
    for _ in range(50):
        mid = 0.5 * (lo + hi)
        inside = f(o + mid[..., None] * d) <= 0.0
        lo, hi = np.where(inside, lo, mid), np.where(inside, mid, hi)
    return np.where(np.isfinite(found), hi, np.inf)


def gbuffer(f: Surface, far: float = 15.0) -> tuple[FloatArray, FloatArray]:
    """Depth (H, W) and planes (H, W, 4) of the surface f = 0, gradients by central differences of exact depths."""
    px, ray = texel_rays()
    depth = cast(f, np.zeros_like(ray), ray, far)
    hit = np.isfinite(depth)
    h = 1e-4
    point = np.where(hit[..., None], ray * np.where(hit, depth, 1.0)[..., None], ray)
    normal = np.stack([(f(point + h * e) - f(point - h * e)) / (2 * h) for e in np.eye(3)], axis=-1)
    # n . x = n . p with x = ray / s: s = n . ray / (n . p), affine in the pixel.
    k = normal / np.sum(normal * point, axis=-1, keepdims=True)
    g = np.stack([k[..., 0] * 2 * TAN_Y * SIZE[0] / SIZE[1] / SIZE[0], k[..., 1] * 2 * TAN_Y / SIZE[1]], axis=-1)
    c = np.sum(k * ray, axis=-1) - np.sum(g * px, axis=-1)
    depth = np.where(hit, depth, 0.0)
    planes = np.concatenate([g, c[..., None], depth[..., None]], axis=-1)
    return depth, np.where(hit[..., None], planes, 0.0)


def window_rays(bend: float, seed: int = 3, depth_m: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Rays that start a metre before the eye and are bent by up to `bend` radians: origins, unit directions."""
    _, ray = texel_rays()
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, 4)
    origin = ray * depth_m
    d = ray / np.linalg.norm(ray, axis=-1, keepdims=True)
    d = d + bend * np.stack(
        [np.sin(9 * ray[..., 1] + phase[0]), np.sin(11 * ray[..., 0] + phase[1]), 0 * d[..., 0]], axis=-1
    )
    return origin, d / np.linalg.norm(d, axis=-1, keepdims=True)


def plane(p: FloatArray) -> FloatArray:
    return p[..., 2] + 4.0 + 0.5 * p[..., 1] - 0.3 * p[..., 0]


def sines(p: FloatArray) -> FloatArray:
    return p[..., 2] + 4.0 - 0.08 * np.sin(2.5 * p[..., 0] + 0.4) * np.cos(2.0 * p[..., 1])


def ball(p: FloatArray) -> FloatArray:
    """A big ball: its near side fills the picture."""
    return np.linalg.norm(p - [0.2, 0.1, -9.0], axis=-1) - 5.5


def step(p: FloatArray) -> FloatArray:
    """A wall at 4 m, and before its left half another one at 2.5 m."""
    return np.minimum(p[..., 2] + 4.0, np.maximum(p[..., 2] + 2.5, p[..., 0]))


def px_of(point: FloatArray) -> FloatArray:
    """(..., 2) pixel coordinates of points before the camera."""
    uv = point[..., :2] / -point[..., 2:] / [TAN_Y * SIZE[0] / SIZE[1], TAN_Y] * 0.5 + 0.5
    return uv * SIZE


def on_screen(px: FloatArray, margin: float = 2.0) -> npt.NDArray[np.bool_]:
    return np.all((px > margin) & (px < np.array(SIZE) - margin), axis=-1)


def with_length(d: FloatArray, length: float) -> FloatArray:
    return np.concatenate([d, np.full_like(d[..., :1], length)], axis=-1)


@pytest.mark.parametrize("solver", [NEWTON, DDA, HIERARCHICAL])
@pytest.mark.parametrize("surface", [plane, sines, ball])
def test_solvers_find_what_float64_ray_casting_finds(bench: Bench, solver: int, surface: Surface) -> None:
    depth, planes = gbuffer(surface)
    origin, d = window_rays(0.12)
    found = bench.solve(depth, planes, origin, with_length(d, 9.0), solver, 8 if solver == NEWTON else 4096)
    truth = cast(surface, origin, d, 9.0)
    exact = px_of(origin + np.where(np.isfinite(truth), truth, 1.0)[..., None] * d)
    resolvable = np.isfinite(truth) & on_screen(exact)
    solved = resolvable & (found[..., 2] == HIT)
    assert resolvable.mean() > 0.8
    assert solved.sum() >= 0.998 * resolvable.sum()
    off = np.abs(px_of(origin + found[..., :1] * d) - exact).max(axis=-1)[solved]
    assert np.percentile(off, 99.9) < 0.25 and off.max() < 1.0
    if surface is plane:
        assert off.max() < 2e-3  # the tangent plane is the surface


def test_one_step_is_exact_on_a_plane(bench: Bench) -> None:
    """The second look-up only confirms the first step's result."""
    depth, planes = gbuffer(plane)
    origin, d = window_rays(0.12)
    found = bench.solve(depth, planes, origin, with_length(d, 9.0), NEWTON, 2)
    truth = cast(plane, origin, d, 9.0)
    resolvable = on_screen(px_of(origin + truth[..., None] * d))
    assert (found[..., 2] == HIT)[resolvable].all()
    assert np.abs(found[..., 0] / truth - 1.0)[resolvable].max() < 1e-5


def test_convergence_is_quadratic(bench: Bench) -> None:
    """On a coarse bend every step at least squares the error, down to the texels' grain."""
    depth, planes = gbuffer(ball)
    origin, d = window_rays(0.2)
    truth = cast(ball, origin, d, 9.0)
    exact = px_of(origin + np.where(np.isfinite(truth), truth, 1.0)[..., None] * d)
    inside = np.isfinite(truth) & on_screen(exact, 8.0)
    start = np.abs(px_of(origin) - exact).max(axis=-1)
    errors = [start[inside]]
    for count in (1, 2, 3):
        found = bench.solve(depth, planes, origin, with_length(d, 9.0), NEWTON, count)
        errors.append(np.abs(px_of(origin + found[..., :1] * d) - exact).max(axis=-1)[inside])
    rms = [float(np.sqrt(np.mean(e**2))) for e in errors]
    assert rms[0] > 5.0, "the rays must start some pixels away"
    factors = [b / a**2 for a, b in zip(rms[:2], rms[1:3], strict=True)]
    assert rms[1] < 0.35 * rms[0] and rms[2] < 0.2 * rms[1] and max(factors) < 0.1
    assert rms[3] < 0.05


@pytest.mark.parametrize("solver", [NEWTON, DDA, HIERARCHICAL])
def test_rays_that_leave_the_picture_say_so(bench: Bench, solver: int) -> None:
    depth, planes = gbuffer(plane)
    _, ray = texel_rays()
    origin = ray * 1.0
    d = np.broadcast_to(np.array([0.9, 0.0, -0.436]), origin.shape)
    found = bench.solve(depth, planes, origin, with_length(d, 30.0), solver, 8 if solver == NEWTON else 4096)
    truth = cast(plane, origin, d, 30.0, 3000)
    exact = px_of(origin + np.where(np.isfinite(truth), truth, 1.0)[..., None] * d)
    outside = np.isfinite(truth) & ~on_screen(exact, -2.0)
    assert outside.mean() > 0.5
    assert (found[..., 2] == OFFSCREEN)[outside].all()


@pytest.mark.parametrize("solver", [DDA, HIERARCHICAL])
def test_rays_that_end_before_any_surface_meet_nothing(bench: Bench, solver: int) -> None:
    depth, planes = gbuffer(plane)
    origin, d = window_rays(0.1)
    found = bench.solve(depth, planes, origin, with_length(d, 0.5), solver, 4096)
    inside = on_screen(px_of(origin + 0.5 * d))
    assert (found[..., 2] == NOTHING)[inside].all()


def test_newton_never_takes_what_stands_before_the_ray(bench: Bench) -> None:
    """Rays that pass behind the near wall: neither a ghost of it, nor a false claim; marching calls them hidden."""
    depth, planes = gbuffer(step)
    _, ray = texel_rays()
    origin = ray * 3.2  # behind the near wall's depth, where only the far wall is seen
    origin = np.where((origin[..., :1] > 0.3), origin, [0.9, 0.0, -3.2])
    d = np.broadcast_to(np.array([-0.8, 0.0, -0.6]), origin.shape)
    truth_t = (4.0 + origin[..., 2]) / 0.6
    where = origin + truth_t[..., None] * d
    # The eye sees the far wall at that point only where the near wall does not cover it.
    covered = where[..., 0] / -where[..., 2] * 2.5 < -0.02
    clear = where[..., 0] / -where[..., 2] * 2.5 > 0.05
    for solver, count in ((NEWTON, 8), (DDA, 4096), (HIERARCHICAL, 4096)):
        found = bench.solve(depth, planes, origin, with_length(d, 1.5), solver, count)
        solved = found[..., 2] == HIT
        assert covered.mean() > 0.1 and clear.mean() > 0.1
        assert not solved[covered].any()
        assert (np.abs(found[..., 0] - truth_t)[solved] < 0.02).all()
        if solver != NEWTON:
            assert solved[clear].mean() > 0.99
            assert np.isin(found[..., 2][covered], (HIDDEN, OFFSCREEN)).all()
        else:
            assert np.isin(found[..., 2][covered], (DISCONTINUITY, DIVERGED, OFFSCREEN)).all()


@pytest.mark.parametrize("solver", [NEWTON, DDA, HIERARCHICAL])
def test_an_empty_buffer_gives_no_hit_and_no_nan(bench: Bench, solver: int) -> None:
    origin, d = window_rays(0.3)
    nothing = np.zeros((SIZE[1], SIZE[0]))
    found = bench.solve(nothing, np.zeros((*nothing.shape, 4)), origin, with_length(d, 9.0), solver, 64)
    assert np.isfinite(found).all() and (found[..., 2] != HIT).all()


def slats(p: FloatArray) -> FloatArray:
    """A wavy wall at 4 m, and a metre before it thin slats, 8 cm wide, every quarter metre."""
    across = np.abs(np.mod(p[..., 0], 0.25) - 0.125) - 0.04
    return np.minimum(
        p[..., 2] + 4.0 - 0.1 * np.sin(5.0 * p[..., 0]), np.maximum(np.abs(p[..., 2] + 3.05) - 0.05, across)
    )


def test_restarts_find_surfaces_beyond_what_the_ray_passes_behind(bench: Bench) -> None:
    """Rays between slats and wall: of what pixel-exact marching finds, restarts find more, and nothing else."""
    depth, planes = gbuffer(slats)
    _, ray = texel_rays()
    origin = ray * 3.2
    d = np.broadcast_to(np.array([0.66, 0.1, -0.745]), origin.shape)
    ends = {
        solver: bench.solve(depth, planes, origin, with_length(d, 1.5), solver, count)
        for solver, count in ((NEWTON, 8), (RESTARTING, 8), (DDA, 4096))
    }
    exact = ends[DDA]
    resolvable = (exact[..., 2] == HIT) & (depth > 3.5)  # pixels that look between the slats

    def share(solver: int) -> float:
        found = ends[solver]
        return float(((found[..., 2] == HIT) & (np.abs(found[..., 0] - exact[..., 0]) < 0.03))[resolvable].mean())

    assert resolvable.mean() > 0.2
    assert share(RESTARTING) > share(NEWTON) + 0.02
    truth = cast(lambda p: np.maximum(slats(p), p[..., 2] + 3.15), origin, d, 1.5)  # the wall alone
    wrong = (ends[RESTARTING][..., 2] == HIT) & (np.abs(ends[RESTARTING][..., 0] - truth) > 0.03)
    assert wrong[resolvable].mean() < 0.01
