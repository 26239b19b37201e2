"""Mesh files that carry a shape and no scene: .obj, .ply, .stl, .off, read by trimesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from glcaustics.errors import SceneError
from glcaustics.scene.limits import MAX_MESH_VERTICES, check_limit
from glcaustics.scene.mesh_tools import crease_normals, nondegenerate
from glcaustics.scene.model import FloatArray, IntArray, Mesh
from glcaustics.scene.shapes import make_mesh

MESH_FILES = (".obj", ".ply", ".stl", ".off")


def load_mesh_file(path: Path) -> Mesh:
    """The whole file as one Mesh; normals from the file if it has them, or else smooth ones that stop at creases.

    Raises:
        SceneError: file of another kind, unreadable, or without triangles.
        ResourceLimitError: too many vertices.
    """
    if path.suffix.lower() not in MESH_FILES:
        kinds = ", ".join((*MESH_FILES, ".glb", ".gltf"))
        raise SceneError(f"mesh files of kind '{path.suffix}' are not read", where=str(path), remedy=f"use {kinds}")
    parts = [_read_part(geometry, path) for geometry in _geometries(path)]
    if not parts:
        raise SceneError("mesh has no triangles", where=str(path), remedy="export it with faces")
    first = np.cumsum([0] + [len(positions) for positions, _, _, _ in parts])
    positions, normals, uv = (np.concatenate([part[i] for part in parts]) for i in range(3))
    triangles = np.concatenate([part[3].astype(np.int64) + start for part, start in zip(parts, first, strict=False)])
    return make_mesh(path.stem, positions, normals, uv, triangles)


def _geometries(path: Path) -> list[Any]:
    """The trimesh objects of the file that have triangles; an .obj may hold one for each material."""
    import trimesh  # slow to import, and most scenes do without it

    try:
        loaded: Any = trimesh.load(path, process=False)
    except Exception as cause:  # trimesh lets every parser's own exceptions through
        raise SceneError(f"mesh cannot be read ({cause})", where=str(path), remedy="export it again") from cause
    found = loaded.geometry.values() if isinstance(loaded, trimesh.Scene) else [loaded]
    return [g for g in found if isinstance(g, trimesh.Trimesh) and len(g.faces) > 0]


def _read_part(geometry: Any, path: Path) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Positions (V, 3), unit normals (V, 3), uv (V, 2) with v downwards as in glTF, and triangles (T, 3)."""
    positions, triangles = np.asarray(geometry.vertices, np.float64), np.asarray(geometry.faces, np.int64)
    check_limit(len(positions), MAX_MESH_VERTICES, "mesh: vertices", "decimate it", where=str(path))
    if triangles.min() < 0 or triangles.max() >= len(positions):
        raise SceneError("mesh has a vertex index out of range", where=str(path), remedy="export it again")
    if not np.isfinite(positions).all():
        raise SceneError("mesh has a position that is not finite", where=str(path), remedy="repair the file")
    triangles = triangles[nondegenerate(positions, triangles)]
    uv = getattr(geometry.visual, "uv", None)
    if uv is None or len(uv) != len(positions):
        uv = np.zeros((len(positions), 2))
    else:
        uv = np.asarray(uv, np.float64) * [1.0, -1.0] + [0.0, 1.0]
    # Reading the property would compute normals; asking the cache is how trimesh's own exporters tell (ply.py, obj.py).
    if "vertex_normals" in geometry._cache:
        normals = np.asarray(geometry.vertex_normals, np.float64)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        if np.isfinite(normals).all() and length.all():
            return positions, normals / length, uv, triangles
    split = crease_normals(positions, triangles)
    return positions[split.source], split.normals, uv[split.source], split.triangles
