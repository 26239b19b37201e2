"""Builds small glTF files for tests with NumPy and json alone, so that no exporter's habits hide a loader's faults."""

from __future__ import annotations

import base64
import io
import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

COMPONENT = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
ELEMENT = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
GLASS = {
    "name": "glass",
    "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.0},
    "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_ior": {"ior": 1.5}},
}
WHITE = {"name": "white", "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9}}
METAL = {"name": "metal", "pbrMetallicRoughness": {"metallicFactor": 1.0, "roughnessFactor": 0.1}}


class GlbBuilder:
    """Collects binary data and JSON. `root` is the JSON and may be edited at will before it is written."""

    def __init__(self) -> None:
        self.binary = bytearray()
        self.root: dict[str, Any] = {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": []}

    def add_view(self, data: bytes, stride: int = 0) -> int:
        """Append a buffer view, aligned to 4 bytes; its number."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        if stride:
            view["byteStride"] = stride
        self.binary += data
        self.root["bufferViews"].append(view)
        return len(self.root["bufferViews"]) - 1

    def add_accessor(self, array: Any, *, normalized: bool = False) -> int:
        """Append an accessor for an (N,) or (N, C) array of a glTF component type; its number."""
        array = np.ascontiguousarray(array)
        rows = array.reshape(len(array), -1)
        stride = -(-rows.itemsize * rows.shape[1] // 4) * 4 if rows.shape[1] > 1 else 0
        data = rows.tobytes()
        if stride and stride != rows.itemsize * rows.shape[1]:  # vertex attributes start at multiples of four bytes
            padded = np.zeros((len(rows), stride), np.uint8)
            padded[:, : rows.itemsize * rows.shape[1]] = rows.view(np.uint8).reshape(len(rows), -1)
            data = padded.tobytes()
        else:
            stride = 0
        accessor: dict[str, Any] = {
            "bufferView": self.add_view(data, stride),
            "componentType": COMPONENT[rows.dtype.name],
            "count": len(rows),
            "type": ELEMENT[rows.shape[1]],
        }
        if normalized:
            accessor["normalized"] = True
        self.root["accessors"].append(accessor)
        return len(self.root["accessors"]) - 1

    def primitive(self, mesh: Mapping[str, Any]) -> dict[str, Any]:
        """A primitive from `positions`, `normals`, `uv`, `indices` (arrays or accessor numbers), `material`, `mode`."""
        attributes: dict[str, int] = {}
        for key, name in (("positions", "POSITION"), ("normals", "NORMAL"), ("uv", "TEXCOORD_0")):
            if mesh.get(key) is not None:
                values = mesh[key]
                attributes[name] = values if isinstance(values, int) else self.add_accessor(np.asarray(values, "f4"))
        result: dict[str, Any] = {"attributes": attributes}
        if mesh.get("indices") is not None:
            values = mesh["indices"]
            if not isinstance(values, int):
                values = np.asarray(values)
                kind = values.dtype if values.dtype in (np.uint8, np.uint16, np.uint32) else np.uint32
                values = self.add_accessor(values.astype(kind).ravel())
            result["indices"] = values
        for key in ("material", "mode", "targets"):
            if key in mesh:
                result[key] = mesh[key]
        return result

    def write(self, path: Path, *, external: bool = False, data_uri: bool = False) -> Path:
        """Write a .glb, or a .gltf with a .bin beside it (`external`) or a data URI."""
        self.root["buffers"] = [{"byteLength": len(self.binary)}]
        if external or data_uri:
            uri = Path(path).stem + " data.bin"
            if data_uri:
                uri = "data:application/octet-stream;base64," + base64.b64encode(bytes(self.binary)).decode()
            else:
                (Path(path).parent / uri).write_bytes(bytes(self.binary))
            self.root["buffers"][0]["uri"] = uri.replace(" ", "%20")
            Path(path).write_text(json.dumps(self.root))
        else:
            Path(path).write_bytes(pack_glb(self.root, bytes(self.binary)))
        return Path(path)


def pack_glb(root: Any, binary: bytes = b"") -> bytes:
    """A GLB container around JSON (or raw text) and a binary chunk."""
    text = root if isinstance(root, bytes) else json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if binary:
        binary += b"\0" * (-len(binary) % 4)
        chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def builder(
    meshes: Sequence[Mapping[str, Any]],
    materials: Sequence[Mapping[str, Any]] = (),
    lights: Sequence[Mapping[str, Any]] = (),
    nodes: Sequence[Mapping[str, Any]] | None = None,
    cameras: Sequence[Mapping[str, Any]] = (),
    images: Sequence[bytes] = (),
) -> GlbBuilder:
    """A builder with meshes, raw glTF materials, lights and cameras, and PNG or JPEG images (texture i = image i).

    A mesh is what `GlbBuilder.primitive` takes, plus `name`; or `{"name", "primitives": [...]}`. Without `nodes` every
    mesh, light and camera gets a node; a light's or camera's `translation`, `rotation` and `scale` go to its node.
    """
    build = GlbBuilder()
    root = build.root
    placed: list[dict[str, Any]] = []
    root["meshes"] = []
    for number, mesh in enumerate(meshes):
        parts = [build.primitive(part) for part in mesh.get("primitives", [mesh])]
        name = mesh.get("name", f"mesh{number}")
        root["meshes"].append({"name": name, "primitives": parts})
        placed.append({"name": name, "mesh": number})
    root["materials"] = [dict(material) for material in materials]
    root["images"] = [{"bufferView": build.add_view(data), "mimeType": "image/png"} for data in images]
    root["textures"] = [{"source": number} for number in range(len(images))]
    for number, light in enumerate(lights):
        item, node = _without_placement(light)
        root.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})["lights"].append(item)
        placed.append({"extensions": {"KHR_lights_punctual": {"light": number}}, **node})
    for number, camera in enumerate(cameras):
        item, node = _without_placement(camera)
        root.setdefault("cameras", []).append(item)
        placed.append({"camera": number, **node})
    root["nodes"] = [dict(node) for node in nodes] if nodes is not None else placed
    children = {child for node in root["nodes"] for child in node.get("children", [])}
    if root["nodes"]:
        root["scenes"] = [{"nodes": [number for number in range(len(root["nodes"])) if number not in children]}]
        root["scene"] = 0
    return build


def _without_placement(item: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    placement = ("translation", "rotation", "scale", "matrix")
    inner = {key: value for key, value in item.items() if key not in placement}
    return inner, {key: item[key] for key in placement if key in item}


def build_glb(path: Path, meshes: Sequence[Mapping[str, Any]], **parts: Any) -> Path:
    """Write a .glb from what `builder` takes."""
    return builder(meshes, **parts).write(path)


def png(pixels: Any) -> bytes:
    """A (H, W, 3|4) uint8 or (H, W) uint16 array as PNG."""
    out = io.BytesIO()
    Image.fromarray(np.asarray(pixels)).save(out, "PNG")
    return out.getvalue()


def torus(
    major_m: float = 1.0, minor_m: float = 0.3, rings: int = 32, sides: int = 16, *, seam: bool = True
) -> dict[str, Any]:
    """A torus round the y axis without normals; with `seam`, vertices are doubled along it as for texture mapping."""
    u = np.linspace(0.0, 2.0 * np.pi, rings + 1)[: rings + seam]
    v = np.linspace(0.0, 2.0 * np.pi, sides + 1)[: sides + seam]
    uu, vv = np.meshgrid(u, v, indexing="ij")
    ring = major_m + minor_m * np.cos(vv)
    positions = np.stack((ring * np.cos(uu), minor_m * np.sin(vv), -ring * np.sin(uu)), axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")
    rows, columns = len(u), len(v)

    def at(a: Any, b: Any) -> Any:
        return (a % rows) * columns + b % columns

    quad = np.stack((at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)), axis=-1)
    return {"name": "torus", "positions": positions, "indices": quad.reshape(-1, 3)}


def plane(half_m: float = 3.0, height_m: float = 0.0) -> dict[str, Any]:
    """A horizontal square facing up, with normals and texture coordinates."""
    corners = np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], float) * half_m
    return {
        "name": "floor",
        "positions": corners + (0.0, height_m, 0.0),
        "normals": np.tile([0.0, 1.0, 0.0], (4, 1)),
        "uv": [[0, 0], [0, 1], [1, 1], [1, 0]],
        "indices": [[0, 1, 2], [0, 2, 3]],
    }


def cube(half_m: float = 0.5) -> dict[str, Any]:
    """A closed cube of eight shared vertices without normals."""
    positions = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * half_m
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return {"name": "cube", "positions": positions, "indices": triangles}
