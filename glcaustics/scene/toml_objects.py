"""The [[object]] tables of a scene file: procedural shapes and mesh files, placed in the world."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from glcaustics.scene import shapes, shapes_round
from glcaustics.scene.gltf import read_gltf
from glcaustics.scene.mesh_file import load_mesh_file
from glcaustics.scene.model import FloatArray, Instance, Material, Mesh
from glcaustics.scene.strict_table import StrictTable, nearest

GLTF_FILES = (".glb", ".gltf")


def _positive(table: StrictTable, key: str, default: object = ...) -> float:
    return float(table.number(key, default, above=0.0))


def _segments(table: StrictTable, default: int) -> int:
    return int(table.integer("segments", default, low=8, high=4096))


def _sizes(table: StrictTable, count: int) -> tuple[float, ...]:
    return tuple(table.vector("size_m", count, above=0.0))


def _ring(name: str, table: StrictTable) -> Mesh:
    inner, outer = _positive(table, "inner_radius_m"), _positive(table, "outer_radius_m")
    if outer <= inner:
        raise table.error(f"'outer_radius_m' is {outer:g}", f"it must be greater than inner_radius_m = {inner:g}")
    return shapes_round.ring(name, inner, outer, _positive(table, "height_m"), _segments(table, 256))


def _torus(name: str, table: StrictTable) -> Mesh:
    radius, tube = _positive(table, "radius_m"), _positive(table, "tube_radius_m")
    if tube >= radius:
        raise table.error(f"'tube_radius_m' is {tube:g}", f"it must be smaller than radius_m = {radius:g}")
    return shapes_round.torus(name, radius, tube, _segments(table, 96))


# Shape name -> what reads its keys and builds it. The keys are the allowed ones, by being read.
SHAPES: Mapping[str, Callable[[str, StrictTable], Mesh]] = {
    "box": lambda n, t: shapes.box(n, _sizes(t, 3)),
    "plane": lambda n, t: shapes.plane(n, _sizes(t, 2)),
    "basin": lambda n, t: shapes.basin(n, _sizes(t, 3), _positive(t, "wall_m")),
    "frame": lambda n, t: shapes.frame(n, _sizes(t, 2), _positive(t, "width_m"), _positive(t, "height_m")),
    "stairs": lambda n, t: shapes.stairs(n, _sizes(t, 3), t.integer("steps", low=1, high=100)),
    "sphere": lambda n, t: shapes_round.sphere(n, _positive(t, "radius_m"), _segments(t, 64)),
    "icosphere": lambda n, t: shapes_round.icosphere(
        n, _positive(t, "radius_m"), t.integer("subdivisions", 4, low=0, high=8)
    ),
    "cylinder": lambda n, t: shapes_round.cylinder(
        n, _positive(t, "radius_m"), _positive(t, "height_m"), _segments(t, 64)
    ),
    "cone": lambda n, t: shapes_round.cone(n, _positive(t, "radius_m"), _positive(t, "height_m"), _segments(t, 64)),
    "torus": _torus,
    "ring": _ring,
    "half_cylinder": lambda n, t: shapes_round.half_cylinder(
        n,
        _positive(t, "inner_radius_m"),
        _positive(t, "thickness_m"),
        _positive(t, "height_m"),
        _segments(t, 192),
    ),
}


def rotation(degrees: tuple[float, float, float]) -> FloatArray:
    """(3, 3) rotation: about x first, then y, then z (the world's axes), right-handed."""
    cx, cy, cz = (math.cos(math.radians(d)) for d in degrees)
    sx, sy, sz = (math.sin(math.radians(d)) for d in degrees)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def _placement(table: StrictTable) -> FloatArray:
    """world_from_object = translate * rotate * scale, (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(table.vector("rotate_deg", 3, (0.0, 0.0, 0.0)))
    if isinstance(table.data.get("scale"), list):
        matrix[:3, :3] *= np.array(table.vector("scale", 3, above=0.0))[None, :]
    else:
        matrix[:3, :3] *= table.number("scale", 1.0, above=0.0)
    matrix[:3, 3] = table.vector("translate", 3, (0.0, 0.0, 0.0))
    return matrix


def _material(table: StrictTable, materials: Mapping[str, Material], default: Material | None) -> Material | None:
    name = table.text("material", None)
    if name is None:
        return default
    if name not in materials:
        raise table.error(f"'material' is '{name}'", nearest(name, materials))
    return materials[name]


def existing_file(table: StrictTable, key: str, folder: Path) -> Path:
    """The path under `key`, relative to the scene file's folder; raises if there is no such file."""
    path = folder / str(table.text(key))
    if not path.is_file():
        raise table.error(f"'{key}' is '{table.data[key]}'", f"there is no file {path}")
    return path


def _scaled_uv(mesh: Mesh, table: StrictTable) -> Mesh:
    if isinstance(table.data.get("uv_scale"), list):
        scale = np.array(table.vector("uv_scale", 2))
    else:
        scale = np.full(2, table.number("uv_scale", 1.0))
    if np.all(scale == 1.0):
        return mesh
    return dataclasses.replace(mesh, uv=(mesh.uv * scale).astype(np.float32))


def read_object(
    table: StrictTable, folder: Path, materials: Mapping[str, Material], default_name: str
) -> tuple[Instance, ...]:
    """The instances of one [[object]] table: one for a shape or mesh file, several for a glTF file."""
    name = str(table.text("name", default_name))
    placement = _placement(table)
    material = _material(table, materials, None)
    if table.has("shape") == table.has("file"):
        raise table.error("it needs either 'shape' or 'file'", "give exactly one of the two")
    if table.has("file"):
        path = existing_file(table, "file", folder)
        if path.suffix.lower() in GLTF_FILES:
            return _gltf_instances(table, path, name, placement, material)
        mesh = load_mesh_file(path)
    else:
        mesh = SHAPES[table.text("shape", choices=SHAPES)](name, table)
    mesh = _scaled_uv(mesh, table)
    table.finish()
    return (Instance(name, mesh, material or Material(), placement),)


def _gltf_instances(
    table: StrictTable, path: Path, name: str, placement: FloatArray, material: Material | None
) -> tuple[Instance, ...]:
    table.finish()
    return tuple(
        Instance(f"{name}/{part.name}", part.mesh, material or part.material, placement @ part.world_from_object)
        for part in read_gltf(path).instances
    )
