"""Procedural meshes with flat faces. Solids are watertight, counter-clockwise from outside; lengths in metres.

Object space: origin at the shape's centre unless said otherwise, +y up. Texture coordinates are in metres.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from glcaustics.scene.mesh_tools import is_watertight
from glcaustics.scene.model import Mesh

Array = npt.NDArray[np.float64]


def make_mesh(
    name: str,
    positions_m: npt.ArrayLike,
    normals: npt.ArrayLike,
    uv: npt.ArrayLike,
    triangles: npt.ArrayLike,
) -> Mesh:
    """A Mesh with the contract's dtypes; finds out whether it is watertight."""
    positions = np.ascontiguousarray(positions_m, np.float32).reshape(-1, 3)
    tri = np.ascontiguousarray(triangles, np.uint32).reshape(-1, 3)
    unit = np.ascontiguousarray(normals, np.float32).reshape(-1, 3)
    return Mesh(
        name, positions, unit, np.ascontiguousarray(uv, np.float32).reshape(-1, 2), tri, is_watertight(positions, tri)
    )


class Faces:
    """Flat faces: convex polygons with the texture laid on in metres along the two axes that the face runs along."""

    def __init__(self) -> None:
        self.positions: list[Array] = []
        self.normals: list[Array] = []
        self.uv: list[Array] = []
        self.triangles: list[Array] = []
        self.count = 0

    def add(self, *corners: Sequence[float]) -> None:
        """A convex polygon, corners counter-clockwise from outside."""
        points = np.asarray(corners, np.float64)
        normal = np.cross(points[1] - points[0], points[2] - points[0])
        normal /= np.linalg.norm(normal)
        axis = int(np.argmax(np.abs(normal)))
        uv = points[:, [0, 2]] if axis == 1 else np.stack([points[:, 2 if axis == 0 else 0], -points[:, 1]], axis=1)
        n = len(points)
        fan = np.array([[0, i, i + 1] for i in range(1, n - 1)]) + self.count
        self.positions.append(points)
        self.normals.append(np.tile(normal, (n, 1)))
        self.uv.append(uv)
        self.triangles.append(fan)
        self.count += n

    def box(self, low: Sequence[float], high: Sequence[float], *, inward: bool = False, top: bool = True) -> None:
        """The faces of an axis-aligned box; `inward` turns them round."""
        (x0, y0, z0), (x1, y1, z1) = low, high
        faces = [
            [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
            [(x1, y0, z0), (x0, y0, z0), (x0, y1, z0), (x1, y1, z0)],
            [(x1, y0, z1), (x1, y0, z0), (x1, y1, z0), (x1, y1, z1)],
            [(x0, y0, z0), (x0, y0, z1), (x0, y1, z1), (x0, y1, z0)],
            [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
        ]
        if top:
            faces.append([(x0, y1, z1), (x1, y1, z1), (x1, y1, z0), (x0, y1, z0)])
        for face in faces:
            self.add(*(face[::-1] if inward else face))

    def mesh(self, name: str) -> Mesh:
        join = np.concatenate
        return make_mesh(name, join(self.positions), join(self.normals), join(self.uv), join(self.triangles))


def box(name: str, size_m: Sequence[float]) -> Mesh:
    """A box of (x, y, z) size, watertight."""
    half = 0.5 * np.asarray(size_m, np.float64)
    faces = Faces()
    faces.box(list(-half), list(half))
    return faces.mesh(name)


def plane(name: str, size_m: Sequence[float]) -> Mesh:
    """A horizontal rectangle of (x, z) size at y = 0, normal +y, an open sheet."""
    x, z = 0.5 * size_m[0], 0.5 * size_m[1]
    faces = Faces()
    faces.add((-x, 0, z), (x, 0, z), (x, 0, -z), (-x, 0, -z))
    return faces.mesh(name)


def _ring_faces(faces: Faces, inner: Array, outer: Array, y: float) -> None:
    """The flat frame between two concentric rectangles (half sizes x, z) at height y, facing up."""
    (a, b), (c, d) = inner, outer
    faces.add((-c, y, d), (c, y, d), (a, y, b), (-a, y, b))
    faces.add((c, y, -d), (-c, y, -d), (-a, y, -b), (a, y, -b))
    faces.add((c, y, d), (c, y, -d), (a, y, -b), (a, y, b))
    faces.add((-c, y, -d), (-c, y, d), (-a, y, b), (-a, y, -b))


def basin(name: str, size_m: Sequence[float], wall_m: float) -> Mesh:
    """An open box of inner (x, depth, z) size, walls and floor `wall_m` thick, its rim at y = 0. Watertight."""
    x, depth, z = 0.5 * size_m[0], size_m[1], 0.5 * size_m[2]
    faces = Faces()
    faces.box((-x - wall_m, -depth - wall_m, -z - wall_m), (x + wall_m, 0.0, z + wall_m), top=False)
    faces.box((-x, -depth, -z), (x, 0.0, z), inward=True, top=False)
    _ring_faces(faces, np.array([x, z]), np.array([x + wall_m, z + wall_m]), 0.0)
    return faces.mesh(name)


def frame(name: str, size_m: Sequence[float], width_m: float, height_m: float) -> Mesh:
    """A slab with a rectangular hole of (x, z) size: `width_m` wide all round, from y = -height_m to 0. Watertight."""
    x, z = 0.5 * size_m[0], 0.5 * size_m[1]
    inner, outer = np.array([x, z]), np.array([x + width_m, z + width_m])
    faces = Faces()
    _ring_faces(faces, inner, outer, 0.0)
    below = Faces()
    _ring_faces(below, inner, outer, -height_m)
    for quad in below.positions:
        faces.add(*quad[::-1])
    sides = Faces()
    sides.box((-outer[0], -height_m, -outer[1]), (outer[0], 0.0, outer[1]), top=False)
    for quad in sides.positions[:4]:
        faces.add(*quad)
    sides = Faces()
    sides.box((-x, -height_m, -z), (x, 0.0, z), inward=True, top=False)
    for quad in sides.positions[:4]:
        faces.add(*quad)
    return faces.mesh(name)


def stairs(name: str, size_m: Sequence[float], steps: int) -> Mesh:
    """Stairs that rise along +x in `steps` equal steps inside a box of (x, y, z) size, foot at y = 0. Watertight."""
    width, height, z = size_m[0], size_m[1], 0.5 * size_m[2]
    run, rise, x0 = width / steps, height / steps, -0.5 * width
    xs, ys = [x0 + run * i for i in range(steps)] + [-x0], [rise * i for i in range(steps)] + [height]
    faces = Faces()
    for i in range(steps):
        faces.add((xs[i], ys[i], -z), (xs[i], ys[i], z), (xs[i], ys[i + 1], z), (xs[i], ys[i + 1], -z))
        faces.add((xs[i], ys[i + 1], z), (xs[i + 1], ys[i + 1], z), (xs[i + 1], ys[i + 1], -z), (xs[i], ys[i + 1], -z))
        for j in range(i + 1):  # one cell of the side wall, so that its edges meet those of the steps
            low, high, left, right = ys[j], ys[j + 1], xs[i], xs[i + 1]
            faces.add((left, low, z), (right, low, z), (right, high, z), (left, high, z))
            faces.add((right, low, -z), (left, low, -z), (left, high, -z), (right, high, -z))
        faces.add((xs[i], 0, -z), (xs[i + 1], 0, -z), (xs[i + 1], 0, z), (xs[i], 0, z))
    for j in range(steps):
        faces.add((-x0, ys[j], z), (-x0, ys[j], -z), (-x0, ys[j + 1], -z), (-x0, ys[j + 1], z))
    return faces.mesh(name)
