"""Files written by trimesh's exporter, not by ours, with habits of its own (materials that default to metal)."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from glcaustics.scene.gltf import load_gltf
from glcaustics.scene.model import OpticalKind


@pytest.mark.parametrize("include_normals", [False, True])
def test_torus_and_floor_of_trimesh_with_glass_added(tmp_path: Path, include_normals: bool) -> None:
    ring = trimesh.creation.torus(1.0, 0.3)
    ring.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name="glass"))
    floor = trimesh.creation.box((6.0, 6.0, 0.1))
    data = trimesh.Scene({"ring": ring, "floor": floor}).export(file_type="glb", include_normals=include_normals)
    length = struct.unpack_from("<I", data, 12)[0]
    root = json.loads(data[20 : 20 + length])
    root["materials"][0]["extensions"] = {"KHR_materials_transmission": {"transmissionFactor": 1.0}}
    text = json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    header = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    path = tmp_path / "a.glb"
    path.write_bytes(header + text + rest)
    kinds = {instance.name: instance for instance in load_gltf(path).instances}
    assert kinds["ring"].optical_kind is OpticalKind.SOLID
    assert kinds["floor"].optical_kind is OpticalKind.DIFFUSE and kinds["floor"].material.metallic == 0.0
    mesh = kinds["ring"].mesh
    points = kinds["ring"].positions_ws()
    axis = np.argmin(np.ptp(points, axis=0))
    centre = points.copy()
    centre[:, axis] = 0.0
    centre /= np.linalg.norm(centre, axis=1, keepdims=True)
    outward = points - centre
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    normals = mesh.normals @ np.linalg.inv(kinds["ring"].world_from_object[:3, :3])
    assert np.min(np.sum(outward * normals, axis=1)) > 0.999
