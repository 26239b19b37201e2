"""glTF materials, their extensions, images and texture coordinates."""

from __future__ import annotations

import base64
import io
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from glcaustics.scene.gltf import load_gltf
from glcaustics.scene.model import Instance, OpticalKind, Scene
from tests.unit.glb_builder import GLASS, WHITE, build_glb, builder, plane, png, torus

CHECKER = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [9, 9, 9]]], np.uint8)


def load(tmp_path: Path, material: dict, mesh: dict | None = None, **parts: object) -> tuple[Instance, Scene]:
    path = build_glb(tmp_path / "m.glb", [(mesh or plane()) | {"material": 0}], materials=[material], **parts)
    scene = load_gltf(path)
    return scene.instances[0], scene


def test_all_factors_and_extensions(tmp_path: Path) -> None:
    instance, _ = load(
        tmp_path,
        {
            "name": "green glass",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 1.0],
                "metallicFactor": 0.25,
                "roughnessFactor": 0.05,
            },
            "emissiveFactor": [0.5, 0.25, 0.0],
            "doubleSided": True,
            "extensions": {
                "KHR_materials_transmission": {"transmissionFactor": 0.9},
                "KHR_materials_ior": {"ior": 1.33},
                "KHR_materials_volume": {
                    "thicknessFactor": 1.0,
                    "attenuationColor": [0.5, 0.9, 0.6],
                    "attenuationDistance": 2.0,
                },
                "KHR_materials_dispersion": {"dispersion": 0.4},
                "KHR_materials_emissive_strength": {"emissiveStrength": 8.0},
            },
        },
        torus(),
    )
    m = instance.material
    assert (m.name, m.base_color, m.metallic, m.roughness) == ("green glass", (0.1, 0.2, 0.3), 0.25, 0.05)
    assert (m.emissive, m.transmission, m.ior, m.dispersion) == ((4.0, 2.0, 0.0), 0.9, 1.33, 0.4)
    assert np.allclose(np.exp(-2.0 * m.sigma_a), (0.5, 0.9, 0.6))
    assert m.double_sided
    assert instance.optical_kind is OpticalKind.SOLID


def test_defaults_of_the_extensions(tmp_path: Path) -> None:
    instance, _ = load(tmp_path, {"pbrMetallicRoughness": {"metallicFactor": 0.0}})
    m = instance.material
    assert (m.ior, m.transmission, m.dispersion, m.roughness) == (1.5, 0.0, 0.0, 1.0)
    assert math.isinf(m.attenuation_distance_m)
    assert m.base_color == (1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("pbr", "metallic"),
    [
        ({"baseColorFactor": [0.8, 0.8, 0.8, 1.0]}, 0.0),  # as small exporters write paint
        ({"roughnessFactor": 0.9}, 0.0),
        ({"roughnessFactor": 0.1}, 1.0),  # Blender leaves out a metallicFactor of 1
        ({"metallicFactor": 1.0}, 1.0),
    ],
)
def test_an_unwritten_metallic_factor(tmp_path: Path, pbr: dict, metallic: float) -> None:
    instance, scene = load(tmp_path, {"name": "m", "pbrMetallicRoughness": pbr})
    assert instance.material.metallic == metallic
    announced = any("no metallicFactor" in line for line in scene.announcements)
    assert announced is (metallic == 0.0)


def test_glass_that_names_no_factors_is_smooth_and_not_metal(tmp_path: Path) -> None:
    glass = {"name": "g", "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}}
    instance, scene = load(tmp_path, glass, torus())
    assert (instance.material.metallic, instance.material.roughness) == (0.0, 0.0)
    assert instance.optical_kind is OpticalKind.SOLID
    assert sum("material 'g'" in line for line in scene.announcements) == 2


def test_rough_glass_keeps_its_roughness(tmp_path: Path) -> None:
    """Who does not follow it says so: caustics/ignored.py."""
    rough = GLASS | {"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.7}}
    instance, _ = load(tmp_path, rough, torus())
    assert instance.material.roughness == 0.7 and instance.optical_kind is OpticalKind.SOLID


def test_a_mesh_without_material_is_diffuse(tmp_path: Path) -> None:
    scene = load_gltf(build_glb(tmp_path / "a.glb", [plane()]))
    assert scene.instances[0].optical_kind is OpticalKind.DIFFUSE
    assert scene.instances[0].material.metallic == 0.0
    assert any("no material" in line for line in scene.announcements)


def test_ior_zero_of_converted_files(tmp_path: Path) -> None:
    instance, scene = load(tmp_path, {"name": "m", "extensions": {"KHR_materials_ior": {"ior": 0.0}}})
    assert instance.material.ior == 1.5
    assert "material 'm': ior 0 is read as 1.5" in scene.announcements


def textured(**extra: object) -> dict:
    return {"pbrMetallicRoughness": {"metallicFactor": 0.0, "baseColorTexture": {"index": 0, **extra}}}


def test_png_in_a_buffer_view(tmp_path: Path) -> None:
    image = load(tmp_path, textured(), images=[png(CHECKER)])[0].material.base_color_image
    assert image is not None and image.srgb
    assert np.array_equal(image.pixels, CHECKER)


@pytest.mark.parametrize("form", ["file", "data"])
def test_images_by_uri(tmp_path: Path, form: str) -> None:
    data = png(CHECKER)
    (tmp_path / "my image.png").write_bytes(data)
    uri = "my%20image.png" if form == "file" else "data:image/png;base64," + base64.b64encode(data).decode()
    build = builder([plane() | {"material": 0}], materials=[textured()], images=[data])
    build.root["images"] = [{"uri": uri}]
    image = load_gltf(build.write(tmp_path / "a.gltf", external=True)).instances[0].material.base_color_image
    assert image is not None and np.array_equal(image.pixels, CHECKER)


def test_jpeg_palette_grey_alpha_and_sixteen_bits(tmp_path: Path) -> None:
    grey = Image.fromarray(np.full((4, 4), 128, np.uint8))
    cases = {}
    for name, picture, options in (
        ("JPEG", grey.convert("RGB"), {"quality": 100}),
        ("PNG", grey.convert("P"), {}),
        ("PNG ", grey, {}),
        ("PNG  ", grey.convert("RGBA"), {}),
    ):
        out = io.BytesIO()
        picture.save(out, name.strip(), **options)
        cases[name] = out.getvalue()
    cases["16"] = png(np.full((4, 4), 128 * 257, np.uint16))
    for data in cases.values():
        image = load(tmp_path, textured(), images=[data])[0].material.base_color_image
        assert image is not None
        assert image.pixels.shape == (4, 4, 3)
        assert np.all(np.abs(image.pixels.astype(int) - 128) <= 1)


def test_metallic_roughness_and_emissive_images(tmp_path: Path) -> None:
    material = {
        "pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}},
        "emissiveFactor": [1.0, 1.0, 1.0],
        "emissiveTexture": {"index": 0},
    }
    m = load(tmp_path, material, images=[png(CHECKER)])[0].material
    assert m.metallic_roughness_image is not None and not m.metallic_roughness_image.srgb
    assert m.emissive_image is not None and m.emissive_image.srgb
    assert m.emissive_image.pixels is m.metallic_roughness_image.pixels  # decoded once
    assert (m.metallic, m.roughness) == (1.0, 1.0)


def test_a_metal_baked_into_one_colour_is_a_mirror(tmp_path: Path) -> None:
    material = {"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}}
    pixels = np.full((2, 2, 3), (0, 51, 255), np.uint8)
    instance, _ = load(tmp_path, material, torus(), images=[png(pixels)])
    assert instance.optical_kind is OpticalKind.MIRROR
    assert instance.material.roughness == pytest.approx(0.2)
    assert instance.material.metallic_roughness_image is None


def test_texture_transform_is_baked_into_the_uv(tmp_path: Path) -> None:
    offset, rotation, scale = [0.25, 0.5], 0.3, [2.0, 3.0]
    transform = {"KHR_texture_transform": {"offset": offset, "rotation": rotation, "scale": scale}}
    mesh = load(tmp_path, textured(extensions=transform), images=[png(CHECKER)])[0].mesh
    c, s = math.cos(rotation), math.sin(rotation)
    for given, read in zip(plane()["uv"], mesh.uv, strict=True):
        u, v = given[0] * scale[0], given[1] * scale[1]
        assert np.allclose(read, (c * u + s * v + offset[0], -s * u + c * v + offset[1]), atol=1e-6)


def test_the_uv_set_a_texture_names_is_used(tmp_path: Path) -> None:
    build = builder([plane() | {"material": 0}], materials=[textured(texCoord=1)], images=[png(CHECKER)])
    second = np.array(plane()["uv"], "f4") * 0.5
    build.root["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = build.add_accessor(second)
    mesh = load_gltf(build.write(tmp_path / "a.glb")).instances[0].mesh
    assert np.allclose(mesh.uv, second)


def test_a_textured_mesh_without_uv_is_announced(tmp_path: Path) -> None:
    instance, scene = load(tmp_path, textured(), torus(), images=[png(CHECKER)])
    assert not instance.mesh.uv.any()
    assert any("no texture coordinates" in line for line in scene.announcements)


def test_what_is_not_supported_is_announced(tmp_path: Path) -> None:
    material = WHITE | {
        "name": "m",
        "normalTexture": {"index": 0},
        "alphaMode": "BLEND",
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.8, "transmissionTexture": {"index": 0}}},
    }
    build = builder([plane() | {"material": 0}], materials=[material], images=[png(np.full((2, 2, 3), 51, np.uint8))])
    build.root["extensionsUsed"] = ["KHR_materials_clearcoat"]
    scene = load_gltf(build.write(tmp_path / "a.glb"))
    text = "\n".join(scene.announcements)
    for word in ("normalTexture", "alphaMode BLEND", "transmissionTexture", "KHR_materials_clearcoat"):
        assert word in text
    assert scene.instances[0].material.transmission == pytest.approx(0.16)


def test_one_material_is_one_object(tmp_path: Path) -> None:
    parts = [plane() | {"material": 0}, torus() | {"material": 0}]
    one, two = load_gltf(build_glb(tmp_path / "a.glb", parts, materials=[WHITE])).instances
    assert one.material is two.material
