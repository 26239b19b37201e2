"""Meshes whose vertices and normals are exact, for scenes with a closed form."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from glcaustics.scene.model import Mesh

FloatArray = npt.NDArray[np.float64]


def make_mesh(
    name: str, positions: npt.ArrayLike, normals: npt.ArrayLike, triangles: npt.ArrayLike, tight: bool
) -> Mesh:
    points = np.ascontiguousarray(positions, np.float32)
    return Mesh(
        name,
        points,
        np.ascontiguousarray(normals, np.float32),
        np.ascontiguousarray(points[:, [0, 2]]),
        np.ascontiguousarray(triangles, np.uint32),
        tight,
    )


def grid_triangles(rows: int, columns: int) -> npt.NDArray[np.int64]:
    """Two triangles a cell for vertices stored row by row, (rows + 1) x (columns + 1); (T, 3)."""
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)[None, :]).ravel()
    right, below = corner + 1, corner + columns + 1
    return np.concatenate((np.stack((corner, below, right), 1), np.stack((right, below, below + 1), 1)))


def height_sheet(
    name: str,
    half_m: float,
    columns: int,
    rows: int,
    height: Callable[[FloatArray], FloatArray],
    slope: Callable[[FloatArray], FloatArray],
) -> Mesh:
    """Open sheet y = height(x) over |x|, |z| <= half, normals up and exact at the vertices."""
    x, z = np.meshgrid(np.linspace(-half_m, half_m, columns + 1), np.linspace(-half_m, half_m, rows + 1))
    x, z = x.ravel(), z.ravel()
    normals = np.stack((-slope(x), np.ones_like(x), np.zeros_like(x)), 1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return make_mesh(name, np.stack((x, height(x), z), 1), normals, grid_triangles(rows, columns), False)


def icosphere(name: str, radius_m: float, frequency: int) -> Mesh:
    """Geodesic sphere at the origin, 20 frequency^2 triangles, vertices and normals on the exact sphere, watertight."""
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    base = np.array([(0, s, t * golden) for s in (-1, 1) for t in (-1, 1)], np.float64)
    corners = np.concatenate((base, base[:, [2, 0, 1]], base[:, [1, 2, 0]]))
    near = np.isclose(np.linalg.norm(corners[:, None] - corners[None], axis=2), 2.0)
    faces = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] & near[b, c] & near[a, c]
    ]
    points, triangles = [], []
    rows = [(i, j) for i in range(frequency + 1) for j in range(frequency + 1 - i)]
    index = {key: n for n, key in enumerate(rows)}
    weights = np.array([(i, j, frequency - i - j) for i, j in rows], np.float64) / frequency
    cells = [(index[i, j], index[i + 1, j], index[i, j + 1]) for i, j in rows if i + j < frequency]
    cells += [(index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]) for i, j in rows if i + j < frequency - 1]
    for number, face in enumerate(faces):
        p = corners[list(face)]
        outward = np.dot(np.cross(p[1] - p[0], p[2] - p[0]), p[0]) > 0.0
        points.append(weights @ p)
        triangles.append(np.array(cells)[:, :: 1 if outward else -1] + number * len(rows))
    unit = np.concatenate(points)
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    _, first, inverse = np.unique(np.round(unit, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    unit = unit[first]
    return make_mesh(name, unit * radius_m, unit, inverse.reshape(-1)[np.concatenate(triangles)], True)


def cylinder_wall(name: str, radius_m: float, height_m: float, azimuth_max_rad: float, columns: int, rows: int) -> Mesh:
    """Wall (R cos p, y, R sin p), 0 <= y <= height, open, triangles and exact normals facing the axis."""
    p, y = np.meshgrid(np.linspace(-azimuth_max_rad, azimuth_max_rad, columns + 1), np.linspace(0, height_m, rows + 1))
    p, y = p.ravel(), y.ravel()
    normals = np.stack((-np.cos(p), np.zeros_like(p), -np.sin(p)), 1)
    positions = np.stack((radius_m * np.cos(p), y, radius_m * np.sin(p)), 1)
    return make_mesh(name, positions, normals, grid_triangles(rows, columns)[:, ::-1], False)
