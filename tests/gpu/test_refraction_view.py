"""The eye's view through the renderer: solvers as options, what the graph then holds, the shares of solved pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import glcaustics as glc
from glcaustics.bench.convergence import look_at, seeded_cameras
from glcaustics.bench.eye_rays import eye_convergence
from glcaustics.errors import UsageError
from glcaustics.passes.refraction import SOLVERS
from glcaustics.renderer import plan_frame
from tests.gpu.feature_scenes import BACKEND, plane, scene_of, sheet, sun

SIZE = (320, 180)
AOVS = ("solve_status", "solve_hit", "solve_iterations")


def render(name: str, solver: str, **options: int) -> glc.renderer.Frame:
    chosen = {"refraction": solver, **options}
    with glc.Renderer(glc.load_scene(name), SIZE, "none", backend=BACKEND, aovs=AOVS, options=chosen) as made:
        return made.render()


@pytest.mark.parametrize("solver", sorted(SOLVERS))
@pytest.mark.parametrize("scene", ["pool", "glass-sphere", "metal-ring"])
def test_every_solver_renders_every_kind_of_object(scene: str, solver: str) -> None:
    frame = render(scene, solver)
    assert np.isfinite(frame.image).all() and (frame.image >= 0.0).all()
    status = frame.aov["solve_status"]
    assert np.isin(status, np.arange(8)).all() and (status > 0).any()
    assert np.isfinite(frame.aov["solve_hit"]).all()
    ways = {
        "newton": {1},
        "dda": {5},
        "hierarchical": {5},
        "sousa": {3},
        "cascade": {1} if scene != "metal-ring" else {5},
    }
    if not (scene == "metal-ring" and solver in ("newton", "sousa")):  # without a march mirrors show the sky
        assert ways[solver] <= set(np.unique(status).astype(int))


def test_unknown_solver_is_one_line() -> None:
    with pytest.raises(UsageError, match="refraction is 'hiz'.*cascade"):
        glc.Renderer(glc.load_scene("pool"), SIZE, options={"refraction": "hiz"}, backend=BACKEND)


def passes_of(solver: str) -> set[str]:
    with glc.Renderer(glc.load_scene("pool"), SIZE, "none", backend=BACKEND, options={"refraction": solver}) as made:
        return {step.name for step in made.plan.steps}


def test_depth_chain_exists_only_where_something_marches_over_it() -> None:
    chain = {"depth_chain.4", "depth_chain.levels"}
    for solver in SOLVERS:
        assert bool(chain & passes_of(solver)) == (solver in ("cascade", "hierarchical")), solver


def test_planes_are_written_only_where_they_are_read() -> None:
    def planes(scene: str) -> bool:
        plan = plan_frame(glc.load_scene(scene), SIZE, "none")
        return any("gbuffer.plane" in step.live_writes for step in plan.steps)

    assert planes("pool") and not planes("dry-room")


def test_shares_of_solved_pixels_in_the_pool() -> None:
    """The marks on seeded views: 99 % within 3 iterations, cascade 99.5 % of what pixel-exact marching solves."""
    scene = glc.load_scene("pool")
    for found in eye_convergence(scene, seeded_cameras(scene, 3), (480, 270), (1, 2, 3, 4), backend=BACKEND):
        assert found.pixels > 5000 and found.resolvable > 0.4
        assert found.within_1px[2] >= 0.99
        assert found.within_1px[0] < found.within_1px[1] < found.within_1px[2]
        assert found.reported[3] >= 0.985 and found.wrong[3] < 0.01
        assert found.cascade >= 0.995 and found.hierarchical >= 0.995


def test_cascade_agrees_with_pixel_exact_marching() -> None:
    a, b = render("pool", "cascade"), render("pool", "dda", reflection_steps=4096)
    both = np.isin(a.aov["solve_status"], (1, 5)) & (b.aov["solve_status"] == 5)
    assert both.sum() > 10000
    difference = np.abs(a.image - b.image).mean(axis=-1)[both] / b.image.mean(axis=-1)[both]
    assert np.median(difference) < 0.01 and np.percentile(difference, 95) < 0.1


def test_what_the_camera_does_not_see_is_continued_alike_by_both_marches() -> None:
    """Rays that end behind the pool's near rim: the surface that they saw last, to the sample. Where a march knew that
    only to a cell, the rim showed stripes, while all that counts solved pixels stayed as it was.
    """
    pictures = {}
    for solver in ("dda", "cascade"):
        frame = render("pool", solver, refraction_steps=16384)
        pictures[solver] = frame.ldr.astype(int)
        hidden = frame.aov["solve_status"] == 7
    assert hidden.sum() > 200
    apart = np.abs(pictures["dda"] - pictures["cascade"]).max(axis=-1)[hidden]
    print("behind the rim, more than 8 of 255 apart:", (apart > 8).mean())
    assert (apart > 8).mean() < 0.05


def test_from_under_water_snells_window_is_where_it_must_be() -> None:
    """Looking straight up: beyond the critical angle the surface is a mirror (4), within it one sees out."""
    base = glc.load_scene("pool").view_at(0.0)
    scene = scene_of([plane("floor", 5.0, -2.0), sheet("water", 5.0, 0.0)], [sun()], base)
    eye = np.array([0.0, -1.0, 0.0])
    camera = replace(base, world_from_camera=look_at(eye, eye + [1e-4, 1.0, 0.0]), yfov_rad=np.radians(110.0))
    with glc.Renderer(
        replace(scene, camera=camera), (200, 200), "none", backend=BACKEND, aovs=("solve_status",)
    ) as made:
        status = made.render().aov["solve_status"]
    y, x = np.mgrid[0:200, 0:200] + 0.5
    tangent = np.hypot(x - 100, y - 100) / 100 * np.tan(np.radians(55.0))
    critical = np.tan(np.arcsin(1 / 1.333))
    assert (status[tangent < 0.97 * critical] == 2).all()
    assert (status[tangent > 1.03 * critical] == 4).all()


def test_reflections_seeded_by_the_last_frame_show_what_marched_ones_show() -> None:
    """The second frame of a still view, and one of moved waves, against frames without a past."""
    scene = glc.load_scene("pool")
    still = replace(scene, camera=seeded_cameras(scene, 3)[2], camera_at=None)  # grazing

    def off(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
        difference = np.abs(a.astype(np.float64) - b).max(axis=-1)
        return float((difference > 1e-2 * b.mean()).mean()), float((a.mean() - b.mean()) / b.mean())

    seeded = {"reflection_history": True}
    with glc.Renderer(still, SIZE, "none", backend=BACKEND, options=seeded) as made:
        first, second, moved = (made.render(t).image for t in (0.0, 0.0, 0.05))
        texture = made._runner.texture("view.reflection_m")  # type: ignore[union-attr]
        metres = np.frombuffer(texture.read(), np.float32)
    with glc.Renderer(still, SIZE, "none", backend=BACKEND) as fresh:
        alone = fresh.render(0.05).image
    assert np.isfinite(metres).all() and (metres >= 0.0).all() and (metres > 0.0).mean() > 0.005
    for a, b in ((second, first), (moved, alone)):
        changed, shift = off(a, b)
        assert changed < 2e-3 and abs(shift) < 2e-4
    assert off(moved, first)[0] > 0.05, "the waves have moved"
