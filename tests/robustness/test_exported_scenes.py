"""Files as modellers export them, rendered with no option: finite, and where there is a truth, near it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import glcaustics as glc
from glcaustics.optics.fresnel import transmittance_dielectric
from glcaustics.optics.pixels import box_filter
from glcaustics.optics.refract import refract
from glcaustics.renderer import Frame
from glcaustics.scene.model import OpticalKind, Scene
from tests.gpu.feature_scenes import BACKEND, from_above, lamp, plane, scene_of, sheet
from tests.robustness.exported_scenes import EXPORTED, SLANTED, ball, knot, write

pytestmark = pytest.mark.gpu
SIZE = 160
PHOTONS_TOO = ("tumbler on a floor", "knot")
AS_AT_MEDIUM = {"internal_bounces": 16, "march_steps": 24}  # how far light is followed; fewer samples lose as little


def lost_of(frame: Frame) -> float:
    """Share of the light that meets specular surfaces."""
    solves = frame.stats["solves"]
    return float(sum(s["flux_lost"] for s in solves) / sum(s["flux"] for s in solves))


def seen_from_above(path: Path, half_m: float, method: str = "auto") -> Frame:
    """The irradiance of the floor, without what is specular in the way."""
    scene = replace(glc.load_scene(path), camera=from_above(half_m, height_m=4.0))
    with glc.Renderer(
        scene, (SIZE, SIZE), method, "medium", BACKEND, aovs=("caustic_irradiance",), specular_view=False
    ) as renderer:
        return renderer.render(time=0.0)


def irradiance(frame: Frame) -> np.ndarray:
    """(40, 40), green."""
    return box_filter(frame.aov["caustic_irradiance"][..., 1].astype(np.float64), (40, 40))


@pytest.mark.parametrize("name", EXPORTED)
def test_it_is_finite_and_little_light_is_lost(name: str, tmp_path: Path) -> None:
    scene = glc.load_scene(EXPORTED[name](tmp_path / "a.glb"))
    methods = ["auto", "photon_trace"] if name in PHOTONS_TOO else ["auto"]
    for method in methods:
        with glc.Renderer(scene, (48, 36), method, "draft", BACKEND, options=AS_AT_MEDIUM) as renderer:
            frame = renderer.render(time=0.0)
        assert np.isfinite(frame.image).all() and frame.image.max() > 0.0
        lost = lost_of(frame)
        print(f"{name}, {method}: lost {lost:.4f}")
        assert lost < 0.1


def test_a_tilted_sheet_lights_the_floor_behind_it(tmp_path: Path) -> None:
    """Its plane cuts the floor's two triangles; parallel light falls evenly: E T cos(in) / cos(out) cos(floor)."""
    frame = seen_from_above(EXPORTED["tilted sheet"](tmp_path / "a.glb"), 2.0)
    tilt = math.radians(35.0)
    normal, down = np.array([[-math.sin(tilt), math.cos(tilt), 0.0]]), np.array([[0.0, -1.0, 0.0]])
    bent, _ = refract(down, normal, np.ones(1), np.full(1, 1.5))
    share = float(transmittance_dielectric(np.asarray(math.cos(tilt)), 1.0, 1.5))
    expected = share * math.cos(tilt) / -float((bent @ normal.T).item()) * -float(bent[0, 1])
    centre = bent[0] / -bent[0, 1]  # where the sheet's middle, 1 m up, lights the floor
    column, row = round((centre[0] + 2.0) / 4.0 * SIZE), round((centre[2] + 2.0) / 4.0 * SIZE)
    lit = frame.aov["caustic_irradiance"][row - 8 : row + 8, column - 8 : column + 8, 1]
    np.testing.assert_allclose(lit, expected, rtol=0.02)


@pytest.mark.parametrize("name", ["ball sunk into the floor", "ball in a ball's light"])
def test_photons_go_where_the_light_map_has_its_light(name: str, tmp_path: Path) -> None:
    """Onto the floor within a ball, and through a second ball.

    With one pair of faces and no end inside: 0.055 of the light in the one, a relative error of 3 in the other."""
    path = EXPORTED[name](tmp_path / "a.glb")
    mesh, photons = (irradiance(seen_from_above(path, 0.8, method)) for method in ("displaced_mesh", "photon_trace"))
    error = np.sqrt(((photons - mesh) ** 2).mean()) / mesh.mean()
    print(f"{name}: photons against the mesh {error:.3f}, flux {photons.sum() / mesh.sum():.4f}")
    assert photons.sum() == pytest.approx(mesh.sum(), rel=0.01)
    assert error < 0.1


def test_slivers_of_a_sheet_add_no_light(tmp_path: Path) -> None:
    """In a warped map a long narrow triangle covers far more than its landing points span; its flux stays its own."""
    path = write(tmp_path / "a.glb", (knot(0.13), {"translation": [0.0, 0.5, 0.0]}))
    mesh, splats = (irradiance(seen_from_above(path, 1.6, method)) for method in ("displaced_mesh", "caustic_map"))
    error = np.sqrt(((mesh - splats) ** 2).mean()) / splats.mean()
    print(f"knot: mesh against splats {error:.3f}, flux {mesh.sum() / splats.sum():.4f}")
    assert error < 0.1
    assert mesh.sum() == pytest.approx(splats.sum(), rel=0.01)


def test_a_ball_that_lacks_three_triangles_is_a_ball(tmp_path: Path) -> None:
    path = EXPORTED["ball with a hole"](tmp_path / "a.glb")
    scene = glc.load_scene(path)
    assert scene.instances[0].optical_kind is OpticalKind.SOLID
    assert any("all but closed" in line for line in scene.announcements)
    whole = write(tmp_path / "b.glb", (ball(0.4), {"translation": [0.0, 0.6, 0.0]}))
    with_hole, without = (irradiance(seen_from_above(p, 0.8)) for p in (path, whole))
    assert with_hole.sum() == pytest.approx(without.sum(), rel=0.02)


def lost_share(scene: Scene, **options: bool) -> float:
    with glc.Renderer(scene, (32, 24), "displaced_mesh", "low", BACKEND, options=options) as renderer:
        return lost_of(renderer.render(time=0.0))


def test_total_reflection_under_water_is_lost_only_if_nobody_follows_it() -> None:
    """Seen from a lamp 0.3 m below, a sheet of half 1 m lies mostly beyond the critical angle."""
    room = [plane("floor", 2.0, -0.6), plane("roof", 2.0, 1.0, up=False), sheet("water", 1.0, 0.0)]
    scene = scene_of(room, [lamp((0.0, -0.3, 0.0))], from_above(2.0))
    followed, not_followed = lost_share(scene), lost_share(scene, reflect=False)
    print(f"lost {followed:.4f}, without reflections {not_followed:.4f}")
    assert followed < 0.01 < 0.1 < not_followed


def test_the_limb_of_a_coarse_ball_loses_no_light(tmp_path: Path) -> None:
    """With smooth normals those at its silhouette point away from the light that its triangles see."""
    path = write(tmp_path / "a.glb", (ball(0.4, 10), {"translation": [0.0, 0.6, 0.0]}), sun_rotation=SLANTED)
    assert lost_share(glc.load_scene(path)) < 0.02
