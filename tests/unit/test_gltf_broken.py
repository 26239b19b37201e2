"""Broken glTF files: each fails on one line that names the thing."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glcaustics.errors import GlcError, ResourceLimitError, SceneError
from glcaustics.scene import limits
from glcaustics.scene.gltf import load_gltf
from tests.unit.glb_builder import WHITE, GlbBuilder, build_glb, builder, pack_glb, png, torus


def error_of(path: Path) -> str:
    """The one-line error of loading a file."""
    with pytest.raises(GlcError) as caught:
        load_gltf(path)
    line = str(caught.value)
    assert "\n" not in line
    assert path.name in line
    assert len(line) < 300
    return line


def good() -> GlbBuilder:
    light = {"type": "spot", "spot": {"outerConeAngle": 0.5}}
    camera = {"type": "perspective", "perspective": {"yfov": 0.6}}
    material = WHITE | {"extensions": {"KHR_materials_ior": {"ior": 1.4}}}
    image = png(np.zeros((2, 2, 3), np.uint8))
    mesh = torus() | {"material": 0}
    build = builder([mesh], materials=[material], lights=[light], cameras=[camera], images=[image])
    build.root["materials"][0]["pbrMetallicRoughness"] = {"metallicFactor": 0.0, "baseColorTexture": {"index": 0}}
    return build


def test_the_file_that_is_broken_below_is_good(tmp_path: Path) -> None:
    assert len(load_gltf(good().write(tmp_path / "a.glb")).instances) == 1


CONTAINERS = {
    "empty": (lambda data: b"", "magic"),
    "wrong magic": (lambda data: b"glTX" + data[4:], "magic 'glTF'"),
    "header only": (lambda data: data[:8], "truncated: 8 bytes"),
    "truncated": (lambda data: data[:-40], "truncated"),
    "chunk beyond the end": (lambda data: data[:12] + struct.pack("<I", 1 << 30) + data[16:], "chunk at byte 12"),
    "no chunks": (lambda data: struct.pack("<4sII", b"glTF", 2, 12), "no JSON chunk"),
    "binary first": (lambda data: data[:16] + b"BIN\0" + data[20:], "first chunk is not JSON"),
    "old container": (lambda data: data[:4] + struct.pack("<I", 1) + data[8:], "GLB version 1"),
    "bad JSON": (lambda data: pack_glb(b'{"asset": {"version": '), "JSON cannot be read"),
    "not UTF-8": (lambda data: pack_glb(b'{"asset": "\xff\xfe"}'), "JSON cannot be read"),
    "NaN": (lambda data: pack_glb(b'{"asset": {"version": "2.0"}, "x": NaN}'), "NaN"),
    "nested too deep": (lambda data: pack_glb(b"[" * 200_000), "JSON cannot be read"),
    "not an object": (lambda data: pack_glb(b"[1, 2]"), "not an object"),
}


@pytest.mark.parametrize("case", CONTAINERS)
def test_broken_container(tmp_path: Path, case: str) -> None:
    change, expected = CONTAINERS[case]
    path = tmp_path / "broken.glb"
    path.write_bytes(change(good().write(tmp_path / "good.glb").read_bytes()))
    assert expected in error_of(path)


def set_at(*keys: Any) -> Callable[[dict], None]:
    """An edit of the JSON: the last of `keys` is the value, the others are the way to it; `...` deletes."""

    def edit(root: dict) -> None:
        *way, last, value = keys
        for key in way:
            root = root[key]
        if value is ...:
            del root[last]
        else:
            root[last] = value

    return edit


PRIMITIVE = ("meshes", 0, "primitives", 0)
LIGHT = ("extensions", "KHR_lights_punctual", "lights", 0)
EDITS = {
    "no version": (set_at("asset", {}), "asset.version"),
    "version 1": (set_at("asset", "version", "1.0"), "glTF version '1.0' is not supported"),
    "version 3 needed": (set_at("asset", "minVersion", "2.1"), "'2.1' is not supported"),
    "draco": (set_at("extensionsRequired", ["KHR_draco_mesh_compression"]), "without Draco"),
    "meshopt": (set_at("extensionsRequired", ["EXT_meshopt_compression"]), "EXT_meshopt_compression"),
    "unknown extension": (set_at("extensionsRequired", ["ACME_thing"]), "ACME_thing"),
    "nodes no array": (set_at("nodes", 5), "'nodes' is 5, not an array"),
    "node no object": (set_at("nodes", 0, 7), "nodes[0] is not an object"),
    "scene out of range": (set_at("scene", 9), "'scene' is 9"),
    "root out of range": (set_at("scenes", 0, "nodes", [44]), "holds 44"),
    "child out of range": (set_at("nodes", 0, "children", [-1]), "nodes[0] 'torus': 'children' holds -1"),
    "own child": (set_at("nodes", 0, "children", [0]), "cycle"),
    "cycle": (set_at("nodes", 0, "children", [1, 0]), "cycle"),
    "mesh out of range": (set_at("nodes", 0, "mesh", 3), "'mesh' is 3, but the file has 1 meshes"),
    "mesh is text": (set_at("nodes", 0, "mesh", "torus"), "'mesh' is 'torus'"),
    "short translation": (set_at("nodes", 0, "translation", [1, 2]), "array of 3 finite numbers"),
    "zero quaternion": (set_at("nodes", 0, "rotation", [0, 0, 0, 0]), "zero quaternion"),
    "projective matrix": (set_at("nodes", 0, "matrix", [1.0] * 16), "last row of 'matrix'"),
    "huge scale": (set_at("nodes", 0, "scale", [1e300, 1, 1]), "nodes[0] 'torus': its world transform"),
    "huge place": (set_at("nodes", 1, "translation", [0, 1e300, 0]), "nodes[1]: its world transform"),
    "no meshes": (set_at("nodes", 0, "mesh", ...), "no triangles to draw"),
    "accessor out of range": (set_at(*PRIMITIVE, "attributes", "POSITION", 77), "'POSITION' is 77"),
    "indices out of range": (set_at(*PRIMITIVE, "indices", 77), "'indices' is 77"),
    "material out of range": (set_at(*PRIMITIVE, "material", 5), "'material' is 5"),
    "attributes no object": (set_at(*PRIMITIVE, "attributes", [1]), "not an object"),
    "float indices": (set_at(*PRIMITIVE, "indices", 0), "indices are not scalars"),
    "odd index count": (set_at("accessors", 1, "count", 4), "not a multiple of three"),
    "no position data": (set_at("accessors", 0, "bufferView", ...), "accessors[0]: POSITION has no data"),
    "positions of two": (set_at("accessors", 0, "type", "VEC2"), "POSITION has 2 components"),
    "component type": (set_at("accessors", 0, "componentType", 5130), "componentType 5130"),
    "element type": (set_at("accessors", 0, "type", "VEC9"), "type 'VEC9'"),
    "accessor too long": (set_at("accessors", 0, "count", 100_000), "accessors[0]: 100000 elements end at byte"),
    "negative count": (set_at("accessors", 0, "count", -3), "'count' is -3"),
    "view out of range": (set_at("accessors", 0, "bufferView", 99), "'bufferView' is 99"),
    "narrow stride": (set_at("bufferViews", 0, "byteStride", 4), "wider than the byteStride 4"),
    "view too long": (set_at("bufferViews", 0, "byteLength", 1 << 30), "bufferViews[0]: bytes"),
    "no such buffer": (set_at("bufferViews", 0, "buffer", 1), "'buffer' is 1, but the file has 1 buffers"),
    "sparse beyond": (set_at("accessors", 0, "sparse", {"count": 1}), "sparse: 'indices' names no buffer view"),
    "ior below 1": (set_at("materials", 0, "extensions", "KHR_materials_ior", "ior", 0.5), "'white': ior 0.5"),
    "roughness": (set_at("materials", 0, "pbrMetallicRoughness", "roughnessFactor", 2.0), "'roughnessFactor' is 2.0"),
    "texture out of range": (set_at("materials", 0, "pbrMetallicRoughness", "baseColorTexture", {"index": 4}), "4"),
    "image without data": (set_at("images", 0, {}), "images[0]: it has neither"),
    "light out of range": (set_at("nodes", 1, "extensions", "KHR_lights_punctual", "light", 3), "'light' is 3"),
    "light type": (set_at(*LIGHT, "type", "area"), "light type 'area'"),
    "negative light": (set_at(*LIGHT, "intensity", -1.0), "'intensity' is -1.0"),
    "cone": (set_at(*LIGHT, "spot", "outerConeAngle", 2.0), "outerConeAngle"),
    "camera out of range": (set_at("nodes", 2, "camera", 5), "'camera' is 5"),
    "camera type": (set_at("cameras", 0, "type", "fisheye"), "camera type 'fisheye'"),
    "no yfov": (set_at("cameras", 0, "perspective", {}), "'yfov'"),
    "flat camera": (set_at("nodes", 2, "scale", [0, 0, 0]), "singular"),
}


@pytest.mark.parametrize("case", EDITS)
def test_broken_json(tmp_path: Path, case: str) -> None:
    edit, expected = EDITS[case]
    build = good()
    edit(build.root)
    line = error_of(build.write(tmp_path / "broken.glb"))
    assert expected in line


def test_a_number_beyond_double_precision(tmp_path: Path) -> None:
    path = good().write(tmp_path / "a.gltf", data_uri=True)
    path.write_text(path.read_text().replace('"outerConeAngle": 0.5', '"outerConeAngle": 1e999'))
    assert "'outerConeAngle' is inf" in error_of(path)


def test_missing_files(tmp_path: Path) -> None:
    assert "does not exist" in error_of(tmp_path / "nowhere.glb")
    path = good().write(tmp_path / "a.gltf", external=True)
    (tmp_path / "a data.bin").unlink()
    line = error_of(path)
    assert "buffers[0]" in line and "a%20data.bin" in line and "does not exist" in line


def test_a_directory_is_not_a_scene(tmp_path: Path) -> None:
    path = tmp_path / "folder.glb"
    path.mkdir()
    assert "cannot be read" in error_of(path)


def test_short_buffer(tmp_path: Path) -> None:
    path = good().write(tmp_path / "a.gltf", external=True)
    file = tmp_path / "a data.bin"
    file.write_bytes(file.read_bytes()[:-100])
    assert "buffers[0]: it has" in error_of(path)


@pytest.mark.parametrize(
    ("uri", "expected"),
    [
        ("data:application/octet-stream;base64,%%%%", "data URI cannot be decoded"),
        ("data:application/octet-stream;base64", "data URI cannot be decoded"),
        ("https://example.com/a.bin", "is on the network"),
        ("a%00b.bin", "buffers[0]"),
    ],
)
def test_bad_buffer_uri(tmp_path: Path, uri: str, expected: str) -> None:
    path = good().write(tmp_path / "a.gltf", data_uri=True)
    root = json.loads(path.read_text())
    root["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(root))
    assert expected in error_of(path)


def test_glb_without_its_binary_chunk(tmp_path: Path) -> None:
    build = good()
    build.root["buffers"] = [{"byteLength": len(build.binary)}]
    path = tmp_path / "a.glb"
    path.write_bytes(pack_glb(build.root))
    assert "buffers[0]: it has neither a uri nor a binary chunk" in error_of(path)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_positions_that_are_not_finite(tmp_path: Path, value: float) -> None:
    mesh = torus()
    mesh["positions"][5, 1] = value
    line = error_of(build_glb(tmp_path / "a.glb", [mesh]))
    assert "mesh 'torus': POSITION of vertex 5 in accessors[0] is not finite" in line


def test_vertex_index_out_of_range(tmp_path: Path) -> None:
    mesh = torus()
    mesh["indices"] = mesh["indices"].copy()
    mesh["indices"][3, 1] = 5000
    assert "index 5000 in accessors[1] is out of range, there are 561 vertices" in error_of(
        build_glb(tmp_path / "a.glb", [mesh])
    )


def test_attributes_of_different_length(tmp_path: Path) -> None:
    mesh = torus() | {"normals": np.tile([0.0, 1.0, 0.0], (5, 1))}
    assert "NORMAL has 5 elements, POSITION has 561" in error_of(build_glb(tmp_path / "a.glb", [mesh]))


@pytest.mark.parametrize("keep", [0, 8, 45])
def test_truncated_image(tmp_path: Path, keep: int) -> None:
    build = good()
    data = png(np.random.default_rng(0).integers(0, 255, (16, 16, 3), dtype=np.uint8))[:keep] or b"x"
    build.root["images"][0]["bufferView"] = build.add_view(data)
    line = error_of(build.write(tmp_path / "a.glb"))
    assert "images[0]: the image cannot be decoded" in line


def test_nothing_with_an_area(tmp_path: Path) -> None:
    assert "no triangles to draw" in error_of(build_glb(tmp_path / "a.glb", [{"positions": np.ones((3, 3))}]))


def test_limits_name_themselves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MAX_LIGHTS", 2)
    path = build_glb(tmp_path / "a.glb", [torus()], lights=[{"type": "point"}] * 3)
    with pytest.raises(ResourceLimitError, match="lights: 3 is above the limit of 2"):
        load_gltf(path)
    monkeypatch.setattr(limits, "MAX_IMAGE_SIDE", 1)
    with pytest.raises(ResourceLimitError, match=r"image 'images\[0\]'.*2 is above the limit of 1; scale"):
        load_gltf(good().write(tmp_path / "b.glb"))


def test_random_damage_never_escapes_as_another_error(tmp_path: Path) -> None:
    """Bytes flipped anywhere: the file still loads or fails with an error of ours, never with a traceback."""
    data = good().write(tmp_path / "a.glb").read_bytes()
    json_length = struct.unpack_from("<I", data, 12)[0]
    rng = np.random.default_rng(1)
    failures = 0
    for _ in range(150):
        broken = bytearray(data)
        for position in rng.integers(12, 20 + json_length, 3):
            broken[position] = rng.integers(32, 127)
        path = tmp_path / "broken.glb"
        path.write_bytes(broken)
        try:
            load_gltf(path)
        except GlcError as error:
            assert "\n" not in str(error)
            failures += 1
    assert failures > 100


def test_random_json_values_never_escape_as_another_error(tmp_path: Path) -> None:
    """Any one value of the JSON replaced by one of another type."""
    wild = (None, -1, 10**30, 1e308, "x", [], {}, True, [[]], [{}], "\0")
    ways = list(_ways(json.loads(json.dumps(good().root))))
    for number, way in enumerate(ways):
        build = good()
        set_at(*way, wild[number % len(wild)])(build.root)
        path = tmp_path / "broken.glb"
        try:
            load_gltf(build.write(path))
        except (SceneError, ResourceLimitError) as error:
            assert "\n" not in str(error)


def _ways(value: Any, way: tuple = ()) -> Any:
    if way:
        yield way
    if isinstance(value, dict):
        for key, child in value.items():
            yield from _ways(child, (*way, key))
    elif isinstance(value, list):
        for key, child in enumerate(value):
            yield from _ways(child, (*way, key))
