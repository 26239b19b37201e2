"""Scene files: what they may say, and the one-line error for everything else."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as PillowImage

from glcaustics.errors import SceneError
from glcaustics.scene import LightKind, OpticalKind, load_scene
from glcaustics.scene.mesh_tools import face_normals, signed_volume
from glcaustics.scene.toml import load_toml
from glcaustics.scene.toml_objects import SHAPES
from glcaustics.scene.water import surface_of
from tests.unit.toml_file import MINIMAL, write

SHAPE_KEYS = {
    "box": "size_m = [1, 2, 3]",
    "plane": "size_m = [1, 2]",
    "basin": "size_m = [2, 1, 3]\nwall_m = 0.2",
    "frame": "size_m = [2, 3]\nwidth_m = 0.5\nheight_m = 0.1",
    "stairs": "size_m = [1, 1, 2]\nsteps = 4",
    "sphere": "radius_m = 0.5",
    "icosphere": "radius_m = 0.5",
    "cylinder": "radius_m = 0.5\nheight_m = 1",
    "cone": "radius_m = 0.5\nheight_m = 1",
    "torus": "radius_m = 0.5\ntube_radius_m = 0.1",
    "ring": "inner_radius_m = 0.5\nouter_radius_m = 0.6\nheight_m = 0.4",
    "half_cylinder": "inner_radius_m = 0.5\nthickness_m = 0.05\nheight_m = 0.4",
}
VOLUMES_M3 = {
    "box": 6.0,
    "basin": 2.4 * 1.2 * 3.4 - 6.0,
    "frame": (3.0 * 4.0 - 6.0) * 0.1,
    "stairs": 2.0 * 0.25 * 0.25 * 10,
    "sphere": 4 / 3 * math.pi / 8,
    "icosphere": 4 / 3 * math.pi / 8,
    "cylinder": math.pi / 4,
    "cone": math.pi / 12,
    "torus": 2 * math.pi**2 * 0.5 * 0.01,
    "ring": math.pi * (0.36 - 0.25) * 0.4,
    "half_cylinder": 0.5 * math.pi * (0.55**2 - 0.25) * 0.4,
}


def test_a_minimal_scene(tmp_path: Path) -> None:
    scene = load_scene(write(tmp_path, MINIMAL))
    assert scene.name == "test"
    assert len(scene.announcements) == 1 and scene.announcements[0].startswith("the scene has no sky")
    assert scene.lights[0].kind is LightKind.DIRECTIONAL and scene.lights[0].direction_ws == (0.0, -1.0, 0.0)
    assert scene.exposure is None and scene.method is None and scene.quality is None
    np.testing.assert_allclose(scene.camera.position_ws, [0, 1, 3])
    assert scene.camera.yfov_rad == pytest.approx(math.radians(45.0))


def test_everything_a_scene_can_say(tmp_path: Path) -> None:
    PillowImage.new("RGB", (4, 2), (255, 128, 0)).save(tmp_path / "t.png")
    text = """
[scene]
name = "all"
purpose = "p"
licence = "MIT"
method = "caustic_map"
quality = "high"
exposure = 2e-5
[sky]
zenith = [1, 2, 3]
horizon = [4, 5, 6]
ground = [0, 0, 1]
[camera]
eye = [0, 5, 0]
target = [0, 0, 0]
up = [0, 0, -1]
orthographic = true
ymag_m = 2.5
[[light]]
kind = "point"
name = "bulb"
intensity = 800
position = [1, 2, 3]
color = [1, 0.5, 0.25]
[[light]]
kind = "spot"
radius_m = 0.04
intensity = 5
position = [0, 4, 0]
direction = [0, -1, 1]
inner_cone_deg = 10
outer_cone_deg = 30
[[material]]
name = "m"
base_color = [0.1, 0.2, 0.3]
base_color_image = "t.png"
metallic = 0.2
roughness = 0.4
metallic_roughness_image = "t.png"
emissive = [5, 5, 5]
emissive_image = "t.png"
transmission = 0.9
ior = 1.7
attenuation_color = [0.5, 0.6, 0.7]
attenuation_distance_m = 0.5
dispersion = 0.3
double_sided = true
[[object]]
name = "b"
shape = "box"
size_m = [1, 1, 1]
material = "m"
translate = [1, 2, 3]
rotate_deg = [0, 90, 0]
scale = [2, 1, 1]
uv_scale = [2, 3]
"""
    scene = load_toml(write(tmp_path, text))
    assert (scene.name, scene.purpose, scene.licence) == ("all", "p", "MIT")
    assert (scene.method, scene.quality, scene.exposure) == ("caustic_map", "high", 2e-5)
    assert scene.sky.zenith == (1, 2, 3) and scene.sky.horizon == (4, 5, 6) and scene.sky.ground == (0, 0, 1)
    assert scene.camera.orthographic and scene.camera.ymag_m == 2.5
    bulb, spot = scene.lights
    assert bulb.position_ws == (1, 2, 3) and bulb.intensity == 800 and bulb.color == (1, 0.5, 0.25)
    assert spot.inner_cone_rad == pytest.approx(math.radians(10)) and spot.outer_cone_rad == pytest.approx(math.pi / 6)
    assert np.linalg.norm(spot.direction_ws) == pytest.approx(1.0)
    assert spot.radius_m == 0.04 and spot.has_size and not bulb.has_size
    (box,) = scene.instances
    material = box.material
    assert material.base_color_image is not None and material.base_color_image.srgb
    assert material.base_color_image.pixels.shape == (2, 4, 3)
    assert material.metallic_roughness_image is not None and not material.metallic_roughness_image.srgb
    assert material.ior == 1.7 and material.dispersion == 0.3 and material.attenuation_distance_m == 0.5
    # scaled by 2 along x, then turned by 90 degrees about y: x goes to -z
    np.testing.assert_allclose(box.world_from_object[:3, 0], [0, 0, -2], atol=1e-15)
    np.testing.assert_allclose(np.ptp(box.positions_ws(), axis=0), [1, 1, 2], atol=1e-6)
    np.testing.assert_allclose(np.ptp(box.mesh.uv, axis=0), [2, 3], atol=1e-6)
    assert scene.announcements == ()


@pytest.mark.parametrize("shape", SHAPES)
def test_shapes_are_solid_with_outward_normals(shape: str, tmp_path: Path) -> None:
    text = MINIMAL.replace('shape = "box"\nsize_m = [1, 2, 3]', f'shape = "{shape}"\n{SHAPE_KEYS[shape]}')
    mesh = load_toml(write(tmp_path, text)).instances[0].mesh
    faces = face_normals(mesh.positions_m, mesh.triangles)
    shading = mesh.normals[mesh.triangles]
    assert np.einsum("ti,tci->tc", faces, shading).min() > 0.9
    assert np.abs(np.linalg.norm(mesh.normals, axis=1) - 1.0).max() < 1e-6
    assert mesh.watertight is (shape != "plane")
    if mesh.watertight:
        assert signed_volume(mesh.positions_m, mesh.triangles) == pytest.approx(VOLUMES_M3[shape], rel=0.01)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl"])
def test_mesh_files(suffix: str, tmp_path: Path) -> None:
    import trimesh

    trimesh.creation.icosphere(subdivisions=3, radius=0.5).export(tmp_path / f"ball{suffix}")
    text = MINIMAL.replace('shape = "box"\nsize_m = [1, 2, 3]', f'file = "ball{suffix}"')
    mesh = load_toml(write(tmp_path, text)).instances[0].mesh
    assert mesh.watertight and len(mesh.triangles) == 1280
    outward = mesh.positions_m / np.linalg.norm(mesh.positions_m, axis=1, keepdims=True)
    assert np.abs(mesh.normals - outward).max() < 0.02
    assert signed_volume(mesh.positions_m, mesh.triangles) == pytest.approx(math.pi / 6, rel=0.02)


def test_gltf_as_base_and_as_object(tmp_path: Path) -> None:
    import trimesh

    trimesh.Scene(trimesh.creation.box((1, 1, 1))).export(tmp_path / "box.glb")
    base = load_toml(
        write(tmp_path, '[scene]\ngltf = "box.glb"\n[[light]]\nkind = "point"\nintensity = 7\nposition = [0, 3, 0]')
    )
    assert len(base.instances) == 1 and [light.intensity for light in base.lights] == [7.0]
    assert any("camera" in note for note in base.announcements)
    assert not any("light" in note.split(";")[0] for note in base.announcements)
    text = MINIMAL.replace('shape = "box"\nsize_m = [1, 2, 3]', 'file = "box.glb"\ntranslate = [5, 0, 0]\nscale = 2')
    (part,) = load_toml(write(tmp_path, text)).instances
    np.testing.assert_allclose(part.positions_ws().mean(axis=0), [5, 0, 0], atol=1e-6)
    np.testing.assert_allclose(np.ptp(part.positions_ws(), axis=0), [2, 2, 2], atol=1e-6)


def test_waves_by_either_description(tmp_path: Path) -> None:
    text = (
        MINIMAL
        + """
[[water]]
size_m = [4, 2]
resolution = [20, 10]
center_m = [1, 0.5, 0]
amplitude_scale = 2.0
wave = [
  { k = [3.0, 4.0], amplitude_m = 0.01, phase_rad = 0.25 },
  { wavelength_m = 0.5, direction_deg = 90, curvature_per_m = 1.5, steepness = 0.2 },
  { k = [1.0, 0.0], amplitude_m = 0.01, omega_rad_per_s = 0.5 },
]
"""
    )
    (water,) = load_toml(write(tmp_path, text)).waters
    one, two, three = surface_of(water).waves  # type: ignore[attr-defined]
    assert (one.amplitude_m, one.kx, one.kz, one.phase) == (0.02, 3.0, 4.0, 0.25)
    assert one.omega == pytest.approx(math.sqrt(9.80665 * 5.0)) and three.omega == 0.5
    k = 2 * math.pi / 0.5
    assert two.amplitude_m == pytest.approx(3.0 / k**2) and two.kz == pytest.approx(k) and abs(two.kx) < 1e-12
    assert two.steepness == 0.2 and water.animated
    np.testing.assert_allclose(water.world_from_object[:3, 3], [1, 0.5, 0])


def test_water_from_a_height_map(tmp_path: Path) -> None:
    ramp = np.tile(np.linspace(0, 65535, 9).astype(np.uint16), (5, 1))
    PillowImage.fromarray(ramp).save(tmp_path / "h.png")
    text = MINIMAL + '[[water]]\nsize_m = [4, 2]\nresolution = [9, 5]\nheightmap = "h.png"\nheight_scale_m = 0.4\n'
    scene = load_toml(write(tmp_path, text))
    instance = scene.instances_at(0.0)[-1]
    assert instance.optical_kind is OpticalKind.INTERFACE and not scene.waters[0].animated
    x, y, _ = instance.positions_ws().T
    np.testing.assert_allclose(y, 0.1 * x, atol=1e-5)
    np.testing.assert_allclose(instance.mesh.normals[:, 0] / instance.mesh.normals[:, 1], -0.1, atol=1e-4)


def test_camera_path_is_smooth_and_passes_through_its_keys(tmp_path: Path) -> None:
    keys = """
[camera]
yfov_deg = 50
[[camera.key]]
time_s = 0
eye = [0, 1, 3]
target = [0, 0, 0]
[[camera.key]]
time_s = 1
eye = [2, 1, 3]
target = [0, 0.5, 0]
yfov_deg = 30
[[camera.key]]
time_s = 3
eye = [3, 2, 0]
target = [0, 0, 0]
"""
    scene = load_toml(write(tmp_path, MINIMAL.replace("[camera]\neye = [0, 1, 3]\ntarget = [0, 0, 0]\n", keys)))
    for time_s, eye in ((-1, [0, 1, 3]), (0, [0, 1, 3]), (1, [2, 1, 3]), (3, [3, 2, 0]), (9, [3, 2, 0])):
        np.testing.assert_allclose(scene.view_at(time_s).position_ws, eye, atol=1e-12)
    assert scene.view_at(1.0).yfov_rad == pytest.approx(math.radians(30))
    h = 1e-5
    before = (scene.view_at(1.0).position_ws - scene.view_at(1.0 - h).position_ws) / h
    after = (scene.view_at(1.0 + h).position_ws - scene.view_at(1.0).position_ws) / h
    np.testing.assert_allclose(before, after, atol=1e-3)
    assert np.linalg.norm(after) > 0.5


def test_overrides_reach_every_table_and_are_checked_like_the_file(tmp_path: Path) -> None:
    path = write(tmp_path, MINIMAL)
    scene = load_scene(path, overrides={"light[0].direction": (1, 0, 0), "object[0].size_m": [4, 4, 4]})
    assert scene.lights[0].direction_ws == (1, 0, 0)
    assert np.ptp(scene.instances[0].positions_ws(), axis=0).tolist() == [4, 4, 4]
    for key in (
        "light[1].direction",
        "light[0].directoin",
        "light.direction",
        "wather[0].size_m",
        "light[0].direction.x",
    ):
        with pytest.raises(SceneError, match="test.toml"):
            load_scene(path, overrides={key: (1, 0, 0)})


def test_darkness_can_be_meant(tmp_path: Path) -> None:
    lit = MINIMAL[MINIMAL.index("[[light]]") : MINIMAL.index("[[object]]")]
    supplied = load_toml(write(tmp_path, MINIMAL.replace(lit, "")))
    assert len(supplied.lights) == 1 and any("no light" in note for note in supplied.announcements)
    dark = load_toml(write(tmp_path, "light = []\n" + MINIMAL.replace(lit, "")))
    assert dark.lights == () and not any("no light" in note for note in dark.announcements)


def test_a_transmissive_material_is_smooth_unless_it_says_otherwise(tmp_path: Path) -> None:
    materials = "".join(
        f'[[material]]\nname = "m{i}"\n{keys}\n[[object]]\nshape = "box"\nsize_m = [1, 1, 1]\nmaterial = "m{i}"\n'
        for i, keys in enumerate(("transmission = 1.0", "transmission = 1.0\nroughness = 0.2", "transmission = 0.4"))
    )
    path = tmp_path / "a.toml"
    path.write_text(materials)
    assert [i.material.roughness for i in load_scene(path).instances] == [0.0, 0.2, 1.0]
