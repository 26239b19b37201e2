"""Light in solids of more than one layer, in several solids, and in solids that something opaque stands in.

A bar over a block, one mesh: beside the bar light enters the block, and leaves it where the light's view shows the bar
first: one pair of front and back faces has no way out for it, a second has one. What goes through the bar goes through
the block as well.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

import glcaustics as glc
from glcaustics.bench.scene_export import beam_scene
from glcaustics.caustics import landing
from glcaustics.optics.fresnel import transmittance_dielectric
from glcaustics.optics.pixels import box_filter
from glcaustics.optics.receivers import PlaneGrid
from glcaustics.optics.reference import BeamSettings, reference_map, relative_rms
from glcaustics.renderer import Frame
from glcaustics.scene.model import Instance, Mesh, Scene
from tests.gpu.feature_scenes import BACKEND, GLASS, box_mesh, from_above, plane, scene_of, sun, translation
from tests.gpu.physics_meshes import icosphere, make_mesh

pytestmark = pytest.mark.gpu
THETA_DEG, HALF, PIXELS = 45.0, 1.6, 160


def together(*parts: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Mesh:
    """Boxes (size, centre) in metres as one mesh."""
    points, normals, triangles, first = [], [], [], 0
    for size, centre in parts:
        mesh = box_mesh("part", size)
        points.append(mesh.positions_m + centre)
        normals.append(mesh.normals)
        triangles.append(mesh.triangles.astype(np.int64) + first)
        first += len(points[-1])
    return make_mesh("parts", np.concatenate(points), np.concatenate(normals), np.concatenate(triangles), True)


def bar_over_a_block() -> Scene:
    mesh = together(((2.0, 0.6, 2.0), (0.0, 0.35, 0.0)), ((0.1, 0.1, 1.6), (-0.3, 1.0, 0.0)))
    return scene_of([plane("floor", 4.0), Instance("glass", mesh, GLASS)], [sun(THETA_DEG)], from_above(HALF))


def shown(scene: Scene, method: str) -> Frame:
    with glc.Renderer(
        scene, (PIXELS, PIXELS), method, "medium", BACKEND, aovs=("caustic_irradiance",),
        specular_view=False, options={"reflect": False, "internal_bounces": 0},
    ) as renderer:  # fmt: skip
        return renderer.render()


def trapped(frame: Frame) -> float:
    """Share of the flux that found no way out."""
    (solve,) = frame.stats["solves"]
    return solve["flux_lost_by_cause"].get("no_exit_found", 0.0) / solve["flux"]


@cache
def truth(make: Callable[[], Scene], half_m: float) -> np.ndarray:
    """Irradiance (40, 40) of light refracted up to four times on the floor, row by z, by beams."""
    settings, grid = BeamSettings(cells=128, max_events=4, reflect=False), PlaneGrid.floor(half_m, 0.0, PIXELS)
    return box_filter(reference_map(beam_scene(make()), grid, settings, check_step=False).mean[..., 1], (40, 40))


def relative_rmse(frame: Frame, reference: np.ndarray) -> tuple[float, float]:
    """Of the image in 40 x 40 bins, and the ratio of the flux."""
    image = box_filter(frame.aov["caustic_irradiance"][..., 1].astype(np.float64), (40, 40))
    return relative_rms(image, reference), float(image.sum() / reference.sum())


@pytest.mark.parametrize("method", ["displaced_mesh", "caustic_map"])
def test_light_goes_on_through_another_layer(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The bar's light goes through the block too: four refractions. Beams say where it lands, and how much."""
    scene = bar_over_a_block()
    two = shown(scene, method)
    with monkeypatch.context() as patch:
        patch.setattr(landing, "LAYERED_SHARE", 2.0)
        one = shown(scene, method)
    reference = truth(bar_over_a_block, HALF)
    before, _ = relative_rmse(one, reference)
    error, flux = relative_rmse(two, reference)
    print(f"\n{method}: trapped {trapped(one):.4f} -> {trapped(two):.4f}; {before:.3f} -> {error:.3f}, flux {flux:.4f}")
    assert trapped(one) > 0.03 and trapped(two) < 0.1 * trapped(one)
    assert error < 0.1 < before
    assert flux == pytest.approx(1.0, abs=0.01)


def two_balls() -> Scene:
    """One ball in the light that the other throws; the lower one is larger than the upper one's light."""
    upper = Instance("upper", icosphere("upper", 0.3, 8), GLASS, translation(0.25, 1.3, 0.0))
    lower = Instance("lower", icosphere("lower", 0.35, 8), GLASS, translation(0.0, 0.45, 0.0))
    return scene_of([plane("floor", 4.0), upper, lower], [sun(15.0)], from_above(1.0))


@pytest.mark.parametrize("method", ["displaced_mesh", "caustic_map"])
def test_light_of_one_solid_goes_through_the_other(method: str) -> None:
    frame = shown(two_balls(), method)
    error, flux = relative_rmse(frame, truth(two_balls, 1.0))
    print(f"\n{method}: RMSE {error:.3f}, flux {flux:.4f}")
    assert error < 0.15
    assert flux == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("method", ["displaced_mesh", "caustic_map"])
def test_light_ends_on_what_stands_in_the_solid(method: str) -> None:
    """A glass block sunk into the floor, under light straight from above: (1 - R) E on the floor inside of it."""
    block = Instance("block", box_mesh("block", (1.0, 0.6, 1.0)), GLASS, translation(0.0, 0.1, 0.0))
    frame = shown(scene_of([plane("floor", 4.0), block], [sun(0.0)], from_above(1.0)), method)
    image = frame.aov["caustic_irradiance"][..., 1]
    middle = image[PIXELS // 2 - 20 : PIXELS // 2 + 20, PIXELS // 2 - 20 : PIXELS // 2 + 20]
    expected = float(transmittance_dielectric(np.asarray(1.0), 1.0, GLASS.ior))
    np.testing.assert_allclose(middle, expected, rtol=0.01)


def test_a_plain_solid_pays_for_no_second_layer() -> None:
    ball = scene_of(
        [plane("floor", 4.0), Instance("cube", box_mesh("cube", (1, 1, 1)), GLASS)], [sun(0.0)], from_above(1.0)
    )
    with glc.Renderer(ball, (16, 16), "displaced_mesh", "draft", BACKEND) as renderer:
        renderer.render()
        names = [step.name for step in renderer.plan.steps]
    assert not [name for name in names if "front2" in name or "back2" in name]
