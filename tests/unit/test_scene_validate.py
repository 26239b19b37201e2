"""validate_scene and the limits: each wrong value is named on one line."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from glcaustics.errors import ResourceLimitError, SceneError
from glcaustics.scene import limits
from glcaustics.scene.limits import check_limits, scene_images
from glcaustics.scene.model import Camera, Image, Instance, Light, LightKind, Material, Mesh, Scene, Sky
from glcaustics.scene.validate import validate_scene

MESH = Mesh(
    "m",
    np.array([[0, 0, 0], [1, 0, 0], [0, 0, -1]], np.float32),
    np.tile(np.float32([0, 1, 0]), (3, 1)),
    np.zeros((3, 2), np.float32),
    np.array([[0, 1, 2]], np.uint32),
    False,
)
CAMERA = Camera.look_at((0, 1, 2), (0, 0, 0))


def scene(material: Any = None, mesh: Any = None, light: Any = None, matrix: Any = None, **values: Any) -> Scene:
    instance = Instance("thing", mesh or MESH, material or Material(), np.eye(4) if matrix is None else matrix)
    parts: dict[str, Any] = {
        "instances": (instance,),
        "lights": (light or Light(LightKind.POINT),),
        "camera": CAMERA,
    }
    return Scene("s", **(parts | values))


def spot(**values: Any) -> Light:
    return Light(LightKind.SPOT, "lamp", **values)


BAD = {
    "ior": (scene(Material("g", ior=0.9)), "material 'g': ior 0.9 is below 1"),
    "nan ior": (scene(Material("g", ior=math.nan)), "material 'g': ior nan is not finite"),
    "roughness": (scene(Material("g", roughness=1.5)), "roughness 1.5 is above 1"),
    "metallic": (scene(Material("g", metallic=-0.5)), "metallic -0.5 is below 0"),
    "transmission": (scene(Material("g", transmission=2.0)), "transmission 2.0 is above 1"),
    "colour": (scene(Material("g", base_color=(2.0, 0.0, 0.0))), "base_color (2.0, 0.0, 0.0) is above 1"),
    "emissive": (scene(Material("g", emissive=(0.0, -1.0, 0.0))), "emissive"),
    "attenuation": (scene(Material("g", attenuation_distance_m=0.0)), "attenuation_distance_m 0.0 is not above 0"),
    "dispersion": (scene(Material("g", ior=1.2, dispersion=60.0)), "dispersion 60 the ior of red"),
    "image": (scene(Material("g", base_color_image=Image("i", np.zeros((2, 2)), True))), "image 'i' has shape (2, 2)"),
    "radius": (scene(light=spot(radius_m=-0.1)), "light 'lamp': radius_m -0.1 is below 0"),
    "nan radius": (scene(light=spot(radius_m=math.nan)), "light 'lamp': radius_m nan is not finite"),
    "disc": (
        scene(light=Light(LightKind.DIRECTIONAL, angular_diameter_rad=2.0)),
        "angular_diameter_deg 114.592 is above",
    ),
    "positions": (scene(mesh=replace(MESH, positions_m=np.full((3, 3), np.nan))), "positions_m of vertex 0 is not"),
    "far": (scene(mesh=replace(MESH, positions_m=np.full((3, 3), 1e20))), "beyond 1e+15"),
    "normals": (scene(mesh=replace(MESH, normals=MESH.normals * 2)), "normal of vertex 0 has length 2"),
    "normal count": (scene(mesh=replace(MESH, normals=MESH.normals[:2])), "normals has shape (2, 3)"),
    "index": (scene(mesh=replace(MESH, triangles=np.array([[0, 1, 3]]))), "vertex index 3 is out of range"),
    "negative index": (scene(mesh=replace(MESH, triangles=np.array([[0, 1, -1]]))), "vertex index -1"),
    "no triangles": (scene(mesh=replace(MESH, triangles=np.zeros((0, 3), int))), "triangles have shape (0, 3)"),
    "matrix": (scene(matrix=np.full((4, 4), np.nan)), "object 'thing': its transform is not a finite"),
    "singular": (scene(matrix=np.diag([1.0, 0.0, 1.0, 1.0])), "object 'thing': its transform is singular"),
    "projective": (scene(matrix=np.ones((4, 4))), "last row of its transform"),
    "intensity": (scene(light=spot(intensity=-1.0)), "light 'lamp': intensity -1.0 is below 0"),
    "direction": (scene(light=spot(direction_ws=(0.0, -2.0, 0.0))), "its direction has length 2"),
    "cone": (scene(light=spot(inner_cone_rad=1.0, outer_cone_rad=0.5)), "its cone is 1 to 0.5 rad"),
    "place": (scene(light=spot(position_ws=(math.inf, 0.0, 0.0))), "its position is not finite"),
    "camera axes": (scene(camera=Camera(np.diag([2.0, 1.0, 1.0, 1.0]))), "camera: its axes are not orthonormal"),
    "yfov": (scene(camera=replace(CAMERA, yfov_rad=4.0)), "camera: yfov 4 rad"),
    "ymag": (scene(camera=replace(CAMERA, orthographic=True, ymag_m=0.0)), "camera: ymag_m 0.0 is not above 0"),
    "sky": (scene(sky=Sky(zenith=(0.0, 0.0, -1.0))), "sky: zenith"),
    "exposure": (scene(exposure=0.0), "exposure 0.0 is not above 0"),
    "empty": (scene(instances=()), "the scene has no objects"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_values_are_named(case: str) -> None:
    bad, expected = BAD[case]
    with pytest.raises(SceneError) as caught:
        validate_scene(bad, where="file.toml")
    line = str(caught.value)
    assert expected in line
    assert line.startswith("file.toml: ") and "; " in line and "\n" not in line


def test_good_scenes_pass() -> None:
    tiny = np.diag([1e-6, 1e-6, 1e-6, 1.0])
    for good in (scene(), scene(matrix=tiny), scene(light=spot()), scene(lights=()), scene(Material(ior=1.0))):
        validate_scene(good)


@pytest.mark.parametrize(
    ("name", "limit", "expected"),
    [
        ("MAX_LIGHTS", 0, "lights: 1 is above the limit of 0"),
        ("MAX_INSTANCES", 0, "instances: 1"),
        ("MAX_MESH_VERTICES", 2, "mesh 'm': vertices: 3"),
        ("MAX_SCENE_VERTICES", 2, "vertices of the scene: 3"),
        ("MAX_SCENE_TRIANGLES", 0, "triangles of the scene: 1"),
        ("MAX_IMAGE_SIDE", 7, "image 'i': longest side in texels: 8"),
        ("MAX_SCENE_TEXELS", 31, "image 'i': texels: 32"),
    ],
)
def test_limits(monkeypatch: pytest.MonkeyPatch, name: str, limit: int, expected: str) -> None:
    image = Image("i", np.zeros((4, 8, 3), np.uint8), True)
    checked = scene(Material(base_color_image=image, emissive_image=image))
    check_limits(checked)
    assert scene_images(checked) == (image,)
    monkeypatch.setattr(limits, name, limit)
    with pytest.raises(ResourceLimitError) as caught:
        check_limits(checked, where="a.glb")
    assert str(caught.value).startswith(f"a.glb: {expected}")
    assert "; " in str(caught.value)
