"""scaled(scene, factor): every length grows, every radiance stays."""

from __future__ import annotations

import math

import numpy as np
import pytest

from glcaustics.errors import SceneError
from glcaustics.scene.model import Camera, Instance, Light, LightKind, Material, Mesh, Scene, Sky, WaterBody
from glcaustics.scene.transform import scaled
from glcaustics.scene.validate import validate_scene

TRIANGLE = Mesh(
    "triangle",
    np.array([[0, 0, 0], [1, 0, 0], [0, 0, -1]], np.float32),
    np.tile(np.float32([0, 1, 0]), (3, 1)),
    np.zeros((3, 2), np.float32),
    np.array([[0, 1, 2]], np.uint32),
    False,
)


def example() -> Scene:
    matrix = np.array([[0, 0, 2, 1], [0, 3, 0, 2], [-1, 0, 0, 3], [0, 0, 0, 1]], float)
    glass = Material("glass", transmission=1.0, attenuation_color=(0.5, 0.7, 0.9), attenuation_distance_m=0.4)
    return Scene(
        "example",
        (Instance("a", TRIANGLE, glass, matrix), Instance("b", TRIANGLE, glass), Instance("c", TRIANGLE, Material())),
        (
            Light(LightKind.DIRECTIONAL, intensity=5.0, angular_diameter_rad=0.01),
            Light(LightKind.POINT, intensity=7.0, position_ws=(1.0, 2.0, 3.0), radius_m=0.2),
            Light(LightKind.SPOT, intensity=9.0, position_ws=(0.0, 4.0, 0.0), outer_cone_rad=0.5),
        ),
        Camera.look_at((1, 2, 3), (0, 0, 0), orthographic=True, ymag_m=1.5),
        waters=(WaterBody("sea", glass, lambda time_s: TRIANGLE, np.eye(4)),),
        sky=Sky((1.0, 1.0, 1.0)),
        camera_at=lambda time_s: Camera.look_at((time_s, 2, 3), (0, 0, 0)),
        exposure=0.5,
    )


@pytest.mark.parametrize("factor", [0.001, 1000.0])
def test_lengths_grow_and_irradiance_stays(factor: float) -> None:
    before = example()
    after = scaled(before, factor)
    validate_scene(after)
    for old, new in zip(before.instances_at(0.0), after.instances_at(0.0), strict=True):
        assert np.allclose(new.positions_ws(), factor * old.positions_ws(), rtol=1e-12)
        assert np.allclose(new.material.sigma_a * factor, old.material.sigma_a)
    target = np.array([0.3, -0.2, 0.1])
    for old, new in zip(before.lights, after.lights, strict=True):
        assert np.allclose(new.position_ws, factor * np.array(old.position_ws))
        assert new.radius_m == pytest.approx(factor * old.radius_m)
        assert new.angular_diameter_rad == old.angular_diameter_rad
        if old.kind is LightKind.DIRECTIONAL:
            assert new.intensity == old.intensity
            continue
        old_irradiance = old.intensity / np.sum((target - old.position_ws) ** 2)
        new_irradiance = new.intensity / np.sum((factor * target - new.position_ws) ** 2)
        assert new_irradiance == pytest.approx(old_irradiance)
        assert new.outer_cone_rad == old.outer_cone_rad
    assert after.sky == before.sky and after.exposure == before.exposure


@pytest.mark.parametrize("factor", [0.001, 1000.0])
def test_cameras_move_but_keep_their_axes(factor: float) -> None:
    before, after = example(), scaled(example(), factor)
    assert after.camera.ymag_m == pytest.approx(factor * 1.5)
    for time_s in (0.0, 2.0):
        old, new = before.view_at(time_s), after.view_at(time_s)
        assert np.allclose(new.position_ws, factor * old.position_ws)
        assert np.array_equal(new.world_from_camera[:3, :3], old.world_from_camera[:3, :3])
        assert new.yfov_rad == old.yfov_rad
    assert np.allclose(after.camera.position_ws, factor * before.camera.position_ws)


def test_sharing_is_kept_and_the_original_is_not_changed() -> None:
    before = example()
    after = scaled(before, 10.0)
    assert after.instances[0].material is after.instances[1].material is after.waters[0].material
    assert after.instances[0].mesh is TRIANGLE
    assert before.instances[0].material.attenuation_distance_m == 0.4
    assert before.lights[1].intensity == 7.0
    assert math.isinf(after.instances[2].material.attenuation_distance_m)


def test_there_and_back() -> None:
    back = scaled(scaled(example(), 1000.0), 0.001)
    assert back.lights[1].intensity == pytest.approx(7.0)
    assert np.allclose(back.instances[0].world_from_object, example().instances[0].world_from_object)


@pytest.mark.parametrize("factor", [0.0, -1.0, math.inf, math.nan])
def test_a_bad_factor_is_refused(factor: float) -> None:
    with pytest.raises(SceneError, match="example: scale factor .* is not above 0; give a positive number"):
        scaled(example(), factor)
