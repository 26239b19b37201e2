"""The displaced mesh on `peer-pool`: error, order, energy, folds, and what its drawing costs.

The eye looks straight down, past the water; each picture is box filtered to 512 x 512 bins over |x|, |z| < 1 m and
divided by its mean over |x|, |z| < 0.75 m. Truths: without folds, Newton's method on the analytic light map (no noise);
with folds, float64 beams.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

import glcaustics as glc
from glcaustics.optics.beams import HeightField, beam_irradiance, peer_pool_field
from glcaustics.optics.fresnel import fresnel_dielectric
from glcaustics.optics.pixels import box_filter
from glcaustics.passes.context import PassContext
from glcaustics.scene.model import Camera, Scene
from tests.gpu.feature_scenes import BACKEND

pytestmark = pytest.mark.gpu

FloatArray = npt.NDArray[np.float64]
BINS, INNER, IOR = 512, 64, 1.333
SLANTED = (0.2, -1.0, 0.1)
METHOD = "displaced_mesh"


def scene_at(strength: float) -> Scene:
    scene = glc.load_scene("peer-pool", {"water[0].amplitude_scale": strength, "light[0].direction": list(SLANTED)})
    above = Camera.look_at((0.0, 2.0, 0.0), (0.0, -1.0, 0.0), orthographic=True, ymag_m=1.0)
    return replace(scene, camera=above)


@cache
def rendered(strength: float, mesh: int, map_size: int) -> FloatArray:
    """Irradiance (512, 512), W/m^2."""
    options = {"caster_size": mesh, "map_size": map_size}
    with glc.Renderer(
        scene_at(strength), (1024, 1024), METHOD, "high", BACKEND,
        aovs=("caustic_irradiance",), specular_view=False, options=options,
    ) as renderer:  # fmt: skip
        frame = renderer.render()
    assert np.isfinite(frame.aov["caustic_irradiance"]).all()
    return box_filter(frame.aov["caustic_irradiance"][..., 1], (BINS, BINS))


def inner(image: FloatArray) -> FloatArray:
    """|x|, |z| < 0.75 m."""
    return image[INNER:-INNER, INNER:-INNER]


def errors(image: FloatArray, truth: FloatArray) -> tuple[float, float]:
    """Relative RMSE and MAE of the inner parts, each divided by its mean."""
    difference = image / image.mean() - truth / truth.mean()
    return float(np.sqrt(np.mean(difference**2))), float(np.abs(difference).mean())


def land(field: HeightField, x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Floor point (x, z) of the light that enters at (x, z), and its flux for each horizontal square metre, W/m^2."""
    lx, ly, lz = np.asarray(SLANTED) / np.linalg.norm(SLANTED)
    slope_x, slope_z = field.gradient(x, z)
    facing = lx * slope_x - ly + lz * slope_z
    length = np.sqrt(1.0 + slope_x**2 + slope_z**2)
    cos_i = facing / length
    along = (cos_i / IOR - np.sqrt(1.0 - (1.0 - cos_i**2) / IOR**2)) / length
    down = (1.0 + field.height_m(x, z)) / -(ly / IOR + along)
    flux = facing * (1.0 - fresnel_dielectric(cos_i, 1.0, IOR))
    return x + down * (lx / IOR - along * slope_x), z + down * (lz / IOR - along * slope_z), flux


@cache
def truth_without_folds() -> FloatArray:
    """Irradiance (384, 384) of the inner part at strength 1: every floor point has one entry point."""
    field, samples, step = peer_pool_field(1.0), 5, 1e-5
    count = (BINS - 2 * INNER) * samples
    at = ((np.arange(count) + 0.5) / count * 2.0 - 1.0) * 0.75
    total = np.zeros((count, count))
    for rows in np.array_split(np.arange(count), 32):  # a few rows at a time stay in the cache
        goal_x, goal_z = np.meshgrid(at, at[rows])
        x, z = goal_x - 0.15 * SLANTED[0], goal_z - 0.15 * SLANTED[2]
        for _ in range(14):
            fx, fz, flux = land(field, x, z)
            ax, az, _flux = land(field, x + step, z)
            bx, bz, _flux = land(field, x, z + step)
            xx, zx, xz, zz = (ax - fx) / step, (az - fz) / step, (bx - fx) / step, (bz - fz) / step
            det = xx * zz - xz * zx
            rx, rz = goal_x - fx, goal_z - fz
            if max(np.abs(rx).max(), np.abs(rz).max()) < 1e-9:
                break
            ux, uz = (zz * rx - xz * rz) / det, (xx * rz - zx * rx) / det
            shrink = np.maximum(np.hypot(ux, uz) / 0.03, 1.0)
            x, z = x + ux / shrink, z + uz / shrink
        assert max(np.abs(rx).max(), np.abs(rz).max()) < 1e-6 and det.min() > 0.0
        total[rows] = flux / det
    return box_filter(total, (BINS - 2 * INNER,) * 2)


@pytest.mark.parametrize(("mesh", "map_size", "limit"), [(128, 512, 0.035), (256, 1024, 0.010)])
def test_error_without_folds(mesh: int, map_size: int, limit: float) -> None:
    rmse, mae = errors(inner(rendered(1.0, mesh, map_size)), truth_without_folds())
    print(f"\ns=1 slanted, mesh {mesh}^2, map {map_size}^2: relative RMSE {rmse:.4f}, MAE {mae:.4f}")
    assert rmse <= limit


def test_error_falls_at_a_steady_order() -> None:
    pairs = ((64, 256), (128, 512), (256, 1024))
    rows = [errors(inner(rendered(1.0, mesh, size)), truth_without_folds()) for mesh, size in pairs]
    orders = [[math.log2(a / b) for a, b in zip(c, f, strict=True)] for c, f in zip(rows, rows[1:], strict=False)]
    print(
        f"\nmesh, map halved together: (RMSE, MAE) {np.round(rows, 4).tolist()}, orders {np.round(orders, 2).tolist()}"
    )
    assert min(min(pair) for pair in orders) >= 1.2


def test_energy_of_the_whole_water() -> None:
    edges = np.linspace(-1.6, 1.6, 3)
    beams = beam_irradiance(
        peer_pool_field(1.0), light_direction_ws=SLANTED, depth_m=1.0, x_range_m=(-1, 1), z_range_m=(-1, 1),
        x_edges_m=edges, z_edges_m=edges, beams_per_side=512,
    )  # fmt: skip
    wide = replace(scene_at(1.0), camera=Camera.look_at((0, 2, 0), (0, -1, 0), orthographic=True, ymag_m=1.6))
    for mesh, map_size in ((128, 512), (256, 1024)):
        with glc.Renderer(
            wide, (1024, 1024), METHOD, "high", BACKEND, aovs=("caustic_irradiance",), specular_view=False,
            options={"caster_size": mesh, "map_size": map_size},
        ) as renderer:  # fmt: skip
            landed = float(renderer.render().aov["caustic_irradiance"][..., 1].astype(np.float64).mean()) * 3.2**2
        print(f"\nmesh {mesh}^2, map {map_size}^2: {landed / beams.flux_landed_w:.5f} of the flux")
        assert landed == pytest.approx(beams.flux_landed_w, rel=0.005)


def test_folds() -> None:
    edges = np.linspace(-1.0, 1.0, BINS + 1)
    beams = beam_irradiance(
        peer_pool_field(2.0), light_direction_ws=SLANTED, depth_m=1.0, x_range_m=(-1, 1), z_range_m=(-1, 1),
        x_edges_m=edges, z_edges_m=edges, beams_per_side=5120,
    )  # fmt: skip
    for mesh in (256, 512):
        rmse, mae = errors(inner(rendered(2.0, mesh, 1024)), inner(beams.irradiance))
        print(
            f"\ns=2 slanted, mesh {mesh}^2, map 1024^2: MAE {mae:.4f}, relative RMSE {rmse:.4f} (beams' noise included)"
        )
        assert mae <= 0.08


TRIVIAL_VERTEX = """#version 330 core
uniform sampler2D t_vertex;
uniform sampler2D t_cell;
uniform int u_width;
uniform vec2 u_map_size;
void main() {
    int cell = gl_VertexID / 6, corner = gl_VertexID - 6 * cell;
    int index = corner < 3 ? corner : (corner == 3 ? 1 : (corner == 4 ? 3 : 2));
    ivec2 texel = ivec2(cell % (u_width - 1), cell / (u_width - 1));
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    if (texelFetch(t_cell, texel, 0).x <= 0.0) return;  // the same triangles as the mesh
    gl_Position = vec4(texelFetch(t_vertex, texel + ivec2(index & 1, index >> 1), 0).xy / u_map_size * 2.0, 0.0, 1.0);
}
"""
TRIVIAL_FRAGMENT = "#version 330 core\nout vec4 o;\nvoid main() { o = vec4(1.0); }\n"


@pytest.mark.long
def test_drawing_costs_little_more_than_a_trivial_shader() -> None:
    """Same mesh, same target, additive; interleaved, processor time, the least of many, since a busy machine slows."""
    options = {"caster_size": 256, "map_size": 1024}
    with glc.Renderer(
        scene_at(1.0), (64, 64), METHOD, "high", BACKEND, specular_view=False, options=options
    ) as renderer:
        renderer.render()
        device, runner, setup = renderer.device, renderer._runner, renderer._setup
        assert runner is not None
        ctx, frame = device.ctx, renderer._sequence.state(renderer.scene, 0.0)
        steps = runner.plan.steps
        last = next(i for i, step in enumerate(steps) if ".draw." in step.name)
        branch = renderer._method._branches[0][0]  # type: ignore[union-attr]
        trivial = ctx.program(vertex_shader=TRIVIAL_VERTEX, fragment_shader=TRIVIAL_FRAGMENT)
        size, grid = setup.lights[0].receivers[branch.view].view.size, setup.lights[0].caster.size  # type: ignore[union-attr]
        trivial["t_cell"] = 1
        trivial["u_width"], trivial["u_map_size"] = grid[0], size
        target, empty = ctx.framebuffer([ctx.texture(size, 4, dtype="f4")]), ctx.vertex_array(trivial, [])
        times: dict[str, list[float]] = {"draw": [], "trivial": []}
        for _ in range(25):
            for step in steps[: last + 1]:
                ctx.finish()
                start = time.process_time()
                step.decl.execute(PassContext(step, device, setup, frame, runner._textures, runner._framebuffers))
                ctx.finish()
            times["draw"].append(time.process_time() - start)
            runner.texture(branch.resource("vertex")).use(0)
            runner.texture(branch.resource("cell")).use(1)
            ctx.enable_only(ctx.BLEND)
            ctx.blend_func = ctx.ONE, ctx.ONE
            start = time.process_time()
            target.use()
            target.clear()
            empty.render(vertices=6 * (grid[0] - 1) * (grid[1] - 1))
            ctx.finish()
            times["trivial"].append(time.process_time() - start)
    draw, plain = (1e3 * min(times[name]) for name in ("draw", "trivial"))
    print(f"\nmesh 256^2 -> 1024^2: draw {draw:.1f} ms, trivial shader {plain:.1f} ms, ratio {draw / plain:.2f}")
    assert draw <= 1.5 * plain
