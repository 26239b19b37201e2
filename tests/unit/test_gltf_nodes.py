"""glTF's hierarchy, punctual lights and cameras."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from glcaustics.errors import SceneError
from glcaustics.scene.gltf import load_gltf, read_gltf
from glcaustics.scene.model import LightKind
from tests.unit.glb_builder import build_glb, builder, cube, plane, torus

HALF_TURN_X = [math.sin(math.pi / 4), 0.0, 0.0, math.cos(math.pi / 4)]  # 90 degrees about x: -z becomes +y


def test_hierarchy_of_trs_and_matrix(tmp_path: Path) -> None:
    matrix = np.array([[0, 0, 1, 4], [0, 1, 0, 5], [-1, 0, 0, 6], [0, 0, 0, 1]], float)  # 90 degrees about y
    nodes = [
        {"name": "root", "translation": [1, 2, 3], "scale": [2, 2, 2], "children": [1]},
        {"name": "arm", "matrix": matrix.T.ravel().tolist(), "children": [2]},
        {"name": "leaf", "mesh": 0, "rotation": [2 * x for x in HALF_TURN_X]},  # quaternions are normalised
    ]
    (instance,) = load_gltf(build_glb(tmp_path / "a.glb", [torus()], nodes=nodes)).instances
    root = np.diag([2.0, 2.0, 2.0, 1.0])
    root[:3, 3] = 1, 2, 3
    leaf = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float)
    assert np.allclose(instance.world_from_object, root @ matrix @ leaf)
    assert instance.name == "leaf"


def test_a_very_deep_hierarchy(tmp_path: Path) -> None:
    nodes = [{"children": [i + 1], "translation": [0.5, 0, 0]} for i in range(3000)] + [{"mesh": 0}]
    (instance,) = load_gltf(build_glb(tmp_path / "a.glb", [torus()], nodes=nodes)).instances
    assert instance.world_from_object[0, 3] == pytest.approx(1500.0)


def test_only_the_files_scene_is_shown(tmp_path: Path) -> None:
    build = builder([torus(), plane()])
    build.root["scenes"], build.root["scene"] = [{"nodes": [0]}, {"nodes": [1], "name": "b"}], 1
    scene = load_gltf(build.write(tmp_path / "a.glb"))
    assert [i.name for i in scene.instances] == ["floor"]
    assert "the file has 2 scenes; 'b' is shown" in scene.announcements
    del build.root["scenes"], build.root["scene"]
    assert len(load_gltf(build.write(tmp_path / "b.glb")).instances) == 2


def test_scale_zero_hides_a_node_but_a_flat_mesh_stays(tmp_path: Path) -> None:
    nodes = [{"mesh": 0}, {"mesh": 1, "scale": [0, 0, 0], "name": "gone"}, {"mesh": 0, "scale": [2, 0, 2]}]
    scene = load_gltf(build_glb(tmp_path / "a.glb", [plane(1.0, height_m=0.5), cube()], nodes=nodes))
    assert [i.mesh.name for i in scene.instances] == ["floor", "floor"]
    assert "node 'gone' is left out, as its scale flattens it to nothing" in scene.announcements
    points = scene.instances[1].positions_ws()
    assert np.allclose(points.min(0), (-2, 0, -2), atol=1e-6) and np.allclose(points.max(0), (2, 0, 2), atol=1e-6)
    assert np.linalg.det(scene.instances[1].world_from_object[:3, :3]) > 0.0


def test_point_directional_and_spot_lights(tmp_path: Path) -> None:
    cone = {"innerConeAngle": 0.1, "outerConeAngle": 0.4}
    lights = [
        {"type": "point", "name": "bulb", "intensity": 80.0, "color": [1, 0.5, 0.25], "translation": [1, 2, 3]},
        {"type": "directional", "intensity": 1000.0, "rotation": HALF_TURN_X},
        {"type": "spot", "intensity": 50.0, "spot": cone, "translation": [0, 4, 0], "scale": [3, 3, 3]},
        {"type": "spot"},
    ]
    bulb, sun, spot, plain = load_gltf(build_glb(tmp_path / "a.glb", [torus()], lights=lights)).lights
    assert (bulb.kind, bulb.name, bulb.intensity) == (LightKind.POINT, "bulb", 80.0)
    assert (bulb.color, bulb.position_ws) == ((1.0, 0.5, 0.25), (1.0, 2.0, 3.0))
    assert np.allclose(sun.direction_ws, (0, 1, 0)) and sun.intensity == 1000.0
    assert np.allclose(spot.direction_ws, (0, 0, -1)) and spot.position_ws == (0.0, 4.0, 0.0)
    assert (spot.inner_cone_rad, spot.outer_cone_rad) == (0.1, 0.4)
    assert (plain.intensity, plain.inner_cone_rad, plain.outer_cone_rad) == (1.0, 0.0, math.pi / 4)


def test_sizes_of_lights_come_from_extras_of_the_light_or_its_node(tmp_path: Path) -> None:
    lights = [
        {"type": "point", "extras": {"radius_m": 0.05}, "scale": [3, 3, 3]},
        {"type": "directional", "extras": {"angular_diameter_deg": 0.53}},
        {"type": "spot", "name": "odd", "spot": {}, "extras": {"angular_diameter_deg": 2, "note": "kept by nobody"}},
        {"type": "point", "extras": "any JSON is allowed"},
    ]
    build = builder([torus()], lights=lights)
    owner = next(n for n in build.root["nodes"] if n.get("extensions", {}).get("KHR_lights_punctual") == {"light": 3})
    owner["extras"] = {"radius_m": 0.25}
    scene = load_gltf(build.write(tmp_path / "a.glb"))
    assert [light.radius_m for light in scene.lights] == [0.05, 0.0, 0.0, 0.25], "a scaled node does not scale it"
    assert scene.lights[1].angular_diameter_rad == pytest.approx(math.radians(0.53))
    assert [light.has_size for light in scene.lights] == [True, True, False, True]
    said = "light 'odd': its angular_diameter_deg is left out, as a spot light has radius_m"
    assert said in scene.announcements


def test_a_wrong_size_is_one_line(tmp_path: Path) -> None:
    lights = [{"type": "point", "extras": {"radius_m": -1.0}}]
    with pytest.raises(SceneError, match=r"lights\[0\]\.extras: 'radius_m' is -1.0, not a finite number from 0"):
        load_gltf(build_glb(tmp_path / "a.glb", [torus()], lights=lights))


def test_dark_lights_and_ranges_are_announced(tmp_path: Path) -> None:
    lights = [{"type": "point", "name": "off", "intensity": 0.0}, {"type": "point", "name": "near", "range": 3.0}]
    scene = load_gltf(build_glb(tmp_path / "a.glb", [torus()], lights=lights))
    assert [light.name for light in scene.lights] == ["near"]
    assert "light 'off' is dark and left out" in scene.announcements
    assert any("light 'near': its range" in line for line in scene.announcements)


def test_cameras(tmp_path: Path) -> None:
    perspective = {
        "type": "perspective",
        "perspective": {"yfov": 0.6, "znear": 0.1},
        "translation": [0, 1, 5],
        "scale": [2, 2, 2],
    }
    orthographic = {
        "type": "orthographic",
        "name": "top",
        "orthographic": {"xmag": 3.0, "ymag": 2.0, "znear": 0.1, "zfar": 9.0},
        "rotation": [-HALF_TURN_X[0], 0, 0, HALF_TURN_X[3]],
    }
    scene = load_gltf(build_glb(tmp_path / "a.glb", [torus()], cameras=[perspective]))
    assert scene.camera.yfov_rad == 0.6 and not scene.camera.orthographic
    assert np.allclose(scene.camera.world_from_camera[:3, :3], np.eye(3))  # the node's scale is no part of it
    assert np.allclose(scene.camera.position_ws, (0, 1, 5))
    assert not any("no camera" in line for line in scene.announcements)
    top = load_gltf(build_glb(tmp_path / "b.glb", [torus()], cameras=[orthographic])).camera
    assert top.orthographic and top.ymag_m == 2.0
    assert np.allclose(-top.world_from_camera[:3, 2], (0, -1, 0))
    two = load_gltf(build_glb(tmp_path / "c.glb", [torus()], cameras=[perspective, orthographic]))
    assert any("the file has 2 cameras; the first one" in line for line in two.announcements)


def test_read_gltf_adds_nothing(tmp_path: Path) -> None:
    contents = read_gltf(build_glb(tmp_path / "a.glb", [torus()]))
    assert contents.lights == () and contents.camera is None and len(contents.instances) == 1


def test_copyright_becomes_the_licence(tmp_path: Path) -> None:
    build = builder([torus()])
    build.root["asset"]["copyright"] = "CC0"
    scene = load_gltf(build.write(tmp_path / "ring.glb"))
    assert (scene.licence, scene.name) == ("CC0", "ring")
