"""Direct light: exact irradiance of the three kinds of light, shadow edges in their place, neither acne nor leaks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from glcaustics.scene.model import Camera, Instance, Light, LightKind, Scene
from glcaustics.scene.transform import scaled
from tests.gpu.feature_scenes import WHITE, box, from_above, grid_xz, lamp, plane, scene_of, shoot, sun, translation
from tests.gpu.physics_meshes import icosphere

pytestmark = pytest.mark.gpu
HALF, PIXELS = 2.0, 128


def direct(scene: Scene, size: tuple[int, int] = (PIXELS, PIXELS), **arguments: object) -> np.ndarray:
    """Green direct irradiance (H, W) float64."""
    frame = shoot(scene, size, method="none", aovs=("direct_irradiance",), **arguments)
    return frame.aov["direct_irradiance"][..., 1].astype(np.float64)


def spot(inner_deg: float, outer_deg: float) -> Light:
    return Light(
        LightKind.SPOT,
        intensity=7.0,
        position_ws=(0.3, 1.5, -0.2),
        direction_ws=(0.0, -1.0, 0.0),
        inner_cone_rad=math.radians(inner_deg),
        outer_cone_rad=math.radians(outer_deg),
    )


def cone_falloff(cosine: np.ndarray, light: Light) -> np.ndarray:
    """KHR_lights_punctual: saturate((cos - cos_outer) / (cos_inner - cos_outer))^2."""
    outer, inner = math.cos(light.outer_cone_rad), math.cos(light.inner_cone_rad)
    return np.clip((cosine - outer) / (inner - outer), 0.0, 1.0) ** 2


@pytest.mark.parametrize("theta", [0.0, pytest.param(30.0, marks=pytest.mark.smoke), 75.0])
def test_directional_light(theta: float) -> None:
    image = direct(scene_of([plane("floor", 3.0)], [sun(theta, 5.0)], from_above(HALF)))
    np.testing.assert_allclose(image, 5.0 * math.cos(math.radians(theta)), rtol=1e-4)


def test_point_light() -> None:
    x, z = grid_xz(HALF, PIXELS)
    image = direct(scene_of([plane("floor", 3.0)], [lamp((0.3, 1.5, -0.2), 7.0)], from_above(HALF)))
    d2 = (x - 0.3) ** 2 + 1.5**2 + (z + 0.2) ** 2
    np.testing.assert_allclose(image, 7.0 * 1.5 / d2**1.5, rtol=1e-3)


@pytest.mark.parametrize("cone", [(10.0, 25.0), (0.0, 40.0), (60.0, 80.0)])
def test_spot_light_with_gltf_fall_off(cone: tuple[float, float]) -> None:
    x, z = grid_xz(HALF, PIXELS)
    light = spot(*cone)
    image = direct(scene_of([plane("floor", 3.0)], [light], from_above(HALF)))
    d2 = (x - 0.3) ** 2 + 1.5**2 + (z + 0.2) ** 2
    truth = 7.0 * 1.5 / d2**1.5 * cone_falloff(1.5 / np.sqrt(d2), light)
    np.testing.assert_allclose(image, truth, rtol=2e-3, atol=1e-4 * truth.max())
    assert image.sum() == pytest.approx(truth.sum(), rel=5e-4)


@pytest.mark.parametrize("scale", [1.0, 0.001, 1000.0])
@pytest.mark.parametrize("kind", ["directional", "point", "cube"])
def test_shadow_edge_is_in_its_place(kind: str, scale: float) -> None:
    """A box of half size 0.5 floats with its underside 0.4 above the floor; the umbra's area and edge are known."""
    blocker = box("box", (1.0, 0.2, 1.0), (0.0, 0.5, 0.0))
    instances = [plane("floor", 4.0), blocker]
    if kind == "directional":
        light, low, high = sun(35.0), 0.4, 0.6
        tangent = math.tan(math.radians(35.0))
        x0, x1 = -0.5 + low * tangent, 0.5 + high * tangent
    else:
        light, top = lamp((0.0, 2.0, 0.0)), 0.6
        x1 = 0.5 * 2.0 / (2.0 - top)
        x0 = -x1
        if kind == "cube":  # a blocker behind the light asks for all six faces
            instances.append(box("above", (0.2, 0.2, 0.2), (0.0, 3.0, 0.0)))
    camera = from_above(HALF) if kind != "cube" else Camera.look_at((0, 1.9, 0.001), (0, 0, 0), yfov_rad=1.6)
    scene = scaled(scene_of(instances, [light], camera), scale)
    if kind == "cube":
        frame = shoot(scene, (160, 160), method="none", aovs=("direct_irradiance", "position_ws"))
        position = frame.aov["position_ws"] / scale
        on_floor = np.abs(position[..., 1]) < 1e-3
        distance = np.maximum(np.abs(position[..., 0]), np.abs(position[..., 2]))
        value = frame.aov["direct_irradiance"][..., 1]
        assert (value[on_floor & (distance < x1 - 0.05)] == 0.0).all()
        assert (value[on_floor & (distance > x1 + 0.05)] > 0.0).all()
        return
    x, _ = grid_xz(HALF, 256)
    frame = shoot(scene, (256, 256), method="none", aovs=("direct_irradiance", "position_ws"))
    value = frame.aov["direct_irradiance"][..., 1].astype(np.float64)
    lit = value / value.max()
    row = lit[128]  # z ~ 0
    heights = frame.aov["position_ws"][128, :, 1] / scale
    at = x[0]
    floor = np.abs(heights) < 1e-3
    inside = floor & (at > x0 + 0.03) & (at < x1 - 0.03)
    outside = floor & ((at < x0 - 0.03) | (at > x1 + 0.03)) & (np.abs(at) < 1.9)
    assert inside.sum() > 8 and outside.sum() > 40
    assert row[inside].max() < 1e-3
    expected = np.ones_like(at) if kind == "directional" else (4.0 / (4.0 + at**2)) ** 1.5
    np.testing.assert_allclose(row[outside] / expected[outside], (row / expected)[outside].max(), rtol=2e-3)


@pytest.mark.parametrize("scale", [1.0, 0.001, 1000.0])
@pytest.mark.parametrize("theta", [5.0, 45.0, 70.0, 85.0])
def test_no_acne_on_a_lit_plane_and_ball(theta: float, scale: float) -> None:
    """A tilted slab and a ball in sunlight: E is E_perp cos wherever nothing is in the way."""
    ball = Instance("ball", icosphere("ball", 0.5, 24), WHITE, translation(-0.8, 0.6, 0.0))
    # the slab stands on its own, casts on nothing but itself
    slab = box("slab", (1.2, 0.1, 1.2), (0.9, 0.6, 0.0))
    light = sun(theta)
    scene = scaled(scene_of([slab, ball], [light], from_above(1.6)), scale)
    frame = shoot(scene, (160, 160), method="none", aovs=("direct_irradiance", "normal_ws", "position_ws"))
    normal = frame.aov["normal_ws"].astype(np.float64)
    position = frame.aov["position_ws"].astype(np.float64) / scale
    cosine = -normal @ np.asarray(light.direction_ws)
    there = (np.abs(normal).sum(axis=2) > 0) & (cosine > 0.05)
    on_ball = there & (position[..., 0] < 0.0)
    along = np.asarray(light.direction_ws)  # the ball's shadow may fall on the slab: leave that stripe out
    centre = np.array([-0.8, 0.6, 0.0])
    off = position - centre
    off -= (off @ along)[..., None] * along
    on_slab = there & (position[..., 0] > 0.0) & (np.linalg.norm(off, axis=2) > 0.56)
    # the ball's own facets shade each other beyond cos = 0.05 of the smooth normal; inside of that nothing may
    value = frame.aov["direct_irradiance"][..., 1].astype(np.float64)
    for where, least in ((on_ball & (cosine > 0.1), 300), (on_slab, 1000 if theta < 80 else 400)):
        assert where.sum() > least
        np.testing.assert_allclose(value[where], cosine[where], atol=0.01)


@pytest.mark.parametrize("scale", [pytest.param(1.0, marks=pytest.mark.smoke), 0.001, 1000.0])
@pytest.mark.parametrize("kind", ["directional", "point"])
def test_no_light_leaks_under_a_box(kind: str, scale: float) -> None:
    """A box stands on the floor: right behind its base the floor is dark, as close as the picture resolves."""
    light = sun(45.0) if kind == "directional" else lamp((-3.0, 3.0, 0.0), 9.0)
    camera = Camera.look_at((3.0, 1.2, 0.0), (0.5, 0.0, 0.0), yfov_rad=math.radians(30.0))
    instances = [plane("floor", 4.0), box("box", (1.0, 1.0, 1.0), (0.0, 0.5, 0.0))]
    scene = scaled(scene_of(instances, [light], camera), scale)
    frame = shoot(scene, (256, 160), method="none", aovs=("direct_irradiance", "position_ws"))
    position = frame.aov["position_ws"].astype(np.float64) / scale
    value = frame.aov["direct_irradiance"][..., 1].astype(np.float64) / frame.aov["direct_irradiance"].max()
    floor = np.abs(position[..., 1]) < 2e-3
    behind = floor & (position[..., 0] > 0.503) & (position[..., 0] < 1.2) & (np.abs(position[..., 2]) < 0.4)
    face = (np.abs(position[..., 0] - 0.5) < 2e-3) & (np.abs(position[..., 2]) < 0.45)
    assert behind.sum() > 500 and face.sum() > 300
    assert value[behind].max() < 1e-3
    assert value[face].max() == 0.0


def test_black_or_missing_lights_leave_darkness() -> None:
    floor = plane("floor", 3.0)
    for lights in ([], [sun(0.0, 0.0)], [Light(LightKind.POINT, color=(0.0, 0.0, 0.0), position_ws=(0, 1, 0))]):
        assert not direct(scene_of([floor], lights, from_above(HALF)), (16, 16)).any()
