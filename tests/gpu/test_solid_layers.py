"""Light in solids of more than one layer: a bar over a block, one mesh. Beside the bar light enters the block, and
leaves it where the light's view shows the bar first: one pair of front and back faces has no way out for it, a second
has one.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import glcaustics as glc
from glcaustics.caustics import light_solve
from glcaustics.optics.fresnel import transmittance_dielectric
from glcaustics.renderer import Frame
from glcaustics.scene.model import Instance, Mesh, Scene
from tests.gpu.feature_scenes import BACKEND, GLASS, box_mesh, from_above, plane, scene_of, sun
from tests.gpu.physics_meshes import make_mesh

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


def shown(method: str) -> Frame:
    with glc.Renderer(
        bar_over_a_block(), (PIXELS, PIXELS), method, "medium", BACKEND, aovs=("caustic_irradiance",),
        specular_view=False, options={"reflect": False, "internal_bounces": 0},
    ) as renderer:  # fmt: skip
        return renderer.render()


def trapped(frame: Frame) -> float:
    """Share of the flux that found no way out."""
    (solve,) = frame.stats["solves"]
    return solve["flux_lost_by_cause"].get("no_exit_found", 0.0) / solve["flux"]


@pytest.mark.parametrize("method", ["displaced_mesh", "caustic_map"])
def test_light_leaves_behind_another_layer(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    two = shown(method)
    with monkeypatch.context() as patch:
        patch.setattr(light_solve, "TRAPPED_SHARE", 2.0)
        one = shown(method)
    cos_i = math.cos(math.radians(THETA_DEG))
    expected = cos_i * float(transmittance_dielectric(np.asarray(cos_i), 1.0, GLASS.ior)) ** 2
    with_two, with_one = (f.aov["caustic_irradiance"][..., 1].astype(np.float64) for f in (two, one))
    new = with_two - with_one
    # A stripe along the bar, away from its ends, is what was missing.
    rows = new[PIXELS // 2 - 15 : PIXELS // 2 + 15].mean(axis=0)
    core = rows > 0.9 * expected
    median = float(np.median(rows[core]))  # the stripe's borders are a texel of the light's view
    print(f"\n{method}: trapped {trapped(one):.4f} -> {trapped(two):.4f}; stripe {median / expected:.4f} of E")
    assert trapped(one) > 0.03
    assert trapped(two) < 0.1 * trapped(one)
    assert core.sum() * 2.0 * HALF / PIXELS > 0.1
    assert median == pytest.approx(expected, rel=0.01)


def test_a_plain_solid_pays_for_no_second_layer() -> None:
    ball = scene_of(
        [plane("floor", 4.0), Instance("cube", box_mesh("cube", (1, 1, 1)), GLASS)], [sun(0.0)], from_above(1.0)
    )
    with glc.Renderer(ball, (16, 16), "displaced_mesh", "draft", BACKEND) as renderer:
        renderer.render()
        names = [step.name for step in renderer.plan.steps]
    assert not [name for name in names if "front2" in name or "back2" in name]
