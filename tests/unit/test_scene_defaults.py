"""Lights, camera and sky for files that have none."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from glcaustics.scene.gltf import load_gltf
from glcaustics.scene.model import Camera, LightKind, Scene
from tests.unit.glb_builder import GLASS, WHITE, build_glb, cube, plane, torus

LAMP = {"type": "point", "intensity": 500.0, "translation": [0.5, 5.0, 0.0]}


def torus_scene(path: Path, floor_m: float = 3.0, size: float = 1.0, lights: tuple = (LAMP,)) -> Scene:
    glass = torus() | {"material": 0}
    glass["positions"] = (glass["positions"] + (0.0, 1.0, 0.0)) * size
    meshes = [glass, plane(floor_m * size) | {"material": 1}]
    placed = [light | {"translation": [x * size for x in light["translation"]]} for light in lights]
    return load_gltf(build_glb(path / "t.glb", meshes, materials=[GLASS, WHITE], lights=placed))


def project(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Coordinates in a square picture, (-1, -1) lower left to (1, 1) upper right; NaN behind the camera."""
    points_vs = (points - camera.position_ws) @ camera.world_from_camera[:3, :3]
    depth = np.where(points_vs[:, 2:] < 0.0, -points_vs[:, 2:], np.nan)
    return points_vs[:, :2] / depth / math.tan(0.5 * camera.yfov_rad)


def test_each_thing_supplied_is_announced(tmp_path: Path) -> None:
    scene = torus_scene(tmp_path, lights=())
    (sun,) = scene.lights
    assert sun.kind is LightKind.DIRECTIONAL and sun.intensity == 100_000.0
    assert np.allclose(np.array(sun.direction_ws) / sun.direction_ws[1], (0.4, 1.0, 0.3))
    assert np.linalg.norm(sun.direction_ws) == pytest.approx(1.0)
    for word in ("no light", "no camera", "no sky"):
        assert sum(word in line for line in scene.announcements) == 1
    assert all("\n" not in line for line in scene.announcements)
    assert not any("no light" in line for line in torus_scene(tmp_path).announcements)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("floor_m", [3.0, 30.0, 3000.0])
def test_the_camera_frames_the_glass_and_its_caustic_however_large_the_floor(
    tmp_path: Path, floor_m: float, size: float
) -> None:
    scene = torus_scene(tmp_path, floor_m, size)
    ring = scene.instances[0].positions_ws()
    seen = project(scene.camera, ring)
    assert np.abs(seen).max() < 1.0
    assert np.ptp(seen, axis=0).max() > 0.6  # and not a speck
    lamp = np.array(scene.lights[0].position_ws)
    shadow = lamp + (ring - lamp) * (lamp[1] / (lamp[1] - ring[:, 1]))[:, None]
    inside = np.abs(project(scene.camera, shadow)).max(axis=1) < 1.0
    assert inside.mean() > 0.95
    assert scene.camera.position_ws[1] > 0.5 * size  # from above
    assert scene.camera.position_ws[2] > 0.0  # in front


def test_the_sky_is_one_to_three_percent_of_the_light(tmp_path: Path) -> None:
    scene = torus_scene(tmp_path)
    illuminance = 500.0 / (0.5**2 + 4.0**2)
    for value in (*scene.sky.zenith, *scene.sky.horizon):
        assert 0.01 < value * math.pi / illuminance < 0.03
    assert np.allclose(torus_scene(tmp_path, size=0.01).sky.horizon, np.array(scene.sky.horizon) * 1e4, rtol=1e-3)


def test_a_camera_in_a_closed_room_stands_inside(tmp_path: Path) -> None:
    room = cube(5.0)
    room["indices"] = np.array(room["indices"])[:, ::-1]
    meshes = [torus() | {"material": 0}, room | {"material": 1}]
    scene = load_gltf(build_glb(tmp_path / "a.glb", meshes, materials=[GLASS, WHITE]))
    assert np.abs(scene.camera.position_ws).max() < 5.0
    assert np.abs(project(scene.camera, scene.instances[0].positions_ws())).max() < 1.0


def test_a_camera_looks_past_a_wall(tmp_path: Path) -> None:
    wall = plane(6.0) | {"material": 1}
    wall["positions"] = wall["positions"][:, [0, 2, 1]] + (0.0, 0.0, 2.5)
    meshes = [torus() | {"material": 0}, wall]
    scene = load_gltf(build_glb(tmp_path / "a.glb", meshes, materials=[GLASS, WHITE]))
    eye, target = scene.camera.position_ws, np.zeros(3)
    t = (2.5 - eye[2]) / (target[2] - eye[2])
    through = eye + t * (target - eye)
    assert not (0.0 < t < 1.0 and np.abs(through[:2]).max() < 6.0)


def test_without_anything_specular_everything_is_framed_but_a_vast_ground(tmp_path: Path) -> None:
    boxes = [cube() | {"name": f"box{i}", "positions": cube()["positions"] + (2.0 * i, 0.5, 0.0)} for i in range(3)]
    scene = load_gltf(build_glb(tmp_path / "a.glb", [*boxes, plane(5000.0)]))
    for box in scene.instances[:3]:
        assert np.abs(project(scene.camera, box.positions_ws())).max() < 1.0
    seen = project(scene.camera, np.concatenate([box.positions_ws() for box in scene.instances[:3]]))
    assert np.ptp(seen, axis=0).max() > 0.6


def test_one_flat_mesh_alone(tmp_path: Path) -> None:
    scene = load_gltf(build_glb(tmp_path / "a.glb", [plane(2.0)]))
    assert np.abs(project(scene.camera, scene.instances[0].positions_ws())).max() < 1.0


def test_a_light_in_the_middle_does_not_blow_up_the_sky(tmp_path: Path) -> None:
    middle = {"type": "point", "intensity": 500.0, "translation": [0.0, 1.0, 0.0]}
    assert 0.0 < torus_scene(tmp_path, lights=(middle,)).sky.horizon[0] < 100.0
