"""Procedural meshes. Solids are watertight, counter-clockwise from outside, with exact normals; lengths in metres.

Object space: origin at the shape's centre unless said otherwise, +y up. Texture coordinates of flat-faced shapes are in metres
(one repeat a metre; `uv_repeat_m` of a scene file rescales them), those of round shapes go once round in u.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from glcaustics.scene.model import Mesh

Array = npt.NDArray[np.float64]
Profile = Sequence[tuple[float, float, float, float]]  # points (r, y, normal r, normal y), bottom to top outside


def is_watertight(positions_m: npt.NDArray[np.generic], triangles: npt.NDArray[np.generic]) -> bool:
    """Whether each edge is shared by exactly two triangles in opposite directions, after welding equal positions."""
    if len(triangles) == 0:
        return False
    _, welded = np.unique(np.asarray(positions_m, np.float64) + 0.0, axis=0, return_inverse=True)
    tri = welded.reshape(-1)[triangles.astype(np.int64)]
    tri = tri[(tri[:, 0] != tri[:, 1]) & (tri[:, 1] != tri[:, 2]) & (tri[:, 2] != tri[:, 0])]
    count = np.int64(welded.max()) + 1
    start, end = tri.ravel(), np.roll(tri, -1, axis=1).ravel()
    edges, twins = np.sort(start * count + end), np.sort(end * count + start)
    return len(tri) > 0 and bool(np.all(np.diff(edges) > 0)) and bool(np.array_equal(edges, twins))


def vertex_normals(positions_m: npt.NDArray[np.generic], triangles: npt.NDArray[np.generic]) -> Array:
    """Area-weighted unit normals (V, 3) of welded vertices; (0, 1, 0) where no triangle has an area."""
    positions = np.asarray(positions_m, np.float64)
    _, welded = np.unique(positions + 0.0, axis=0, return_inverse=True)
    welded = welded.reshape(-1)
    a, b, c = (positions[triangles[:, i]] for i in range(3))
    face = np.cross(b - a, c - a)
    total = np.zeros((int(welded.max()) + 1, 3))
    for i in range(3):
        np.add.at(total, welded[triangles[:, i]], face)
    normals = total[welded]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0, normals / np.where(length > 0, length, 1.0), [[0.0, 1.0, 0.0]])


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


class _Faces:
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
    faces = _Faces()
    faces.box(list(-half), list(half))
    return faces.mesh(name)


def plane(name: str, size_m: Sequence[float]) -> Mesh:
    """A horizontal rectangle of (x, z) size at y = 0, normal +y, an open sheet."""
    x, z = 0.5 * size_m[0], 0.5 * size_m[1]
    faces = _Faces()
    faces.add((-x, 0, z), (x, 0, z), (x, 0, -z), (-x, 0, -z))
    return faces.mesh(name)


def _ring_faces(faces: _Faces, inner: Array, outer: Array, y: float) -> None:
    """The flat frame between two concentric rectangles (half sizes x, z) at height y, facing up."""
    (a, b), (c, d) = inner, outer
    faces.add((-c, y, d), (c, y, d), (a, y, b), (-a, y, b))
    faces.add((c, y, -d), (-c, y, -d), (-a, y, -b), (a, y, -b))
    faces.add((c, y, d), (c, y, -d), (a, y, -b), (a, y, b))
    faces.add((-c, y, -d), (-c, y, d), (-a, y, b), (-a, y, -b))


def basin(name: str, size_m: Sequence[float], wall_m: float) -> Mesh:
    """An open box: inner (x, depth, z) size, walls and floor `wall_m` thick; the rim's inner edge is at y = 0. Watertight."""
    x, depth, z = 0.5 * size_m[0], size_m[1], 0.5 * size_m[2]
    faces = _Faces()
    faces.box((-x - wall_m, -depth - wall_m, -z - wall_m), (x + wall_m, 0.0, z + wall_m), top=False)
    faces.box((-x, -depth, -z), (x, 0.0, z), inward=True, top=False)
    _ring_faces(faces, np.array([x, z]), np.array([x + wall_m, z + wall_m]), 0.0)
    return faces.mesh(name)


def frame(name: str, size_m: Sequence[float], width_m: float, height_m: float) -> Mesh:
    """A slab with a rectangular hole of (x, z) size: `width_m` wide all round, from y = -height_m to 0. Watertight."""
    x, z = 0.5 * size_m[0], 0.5 * size_m[1]
    inner, outer = np.array([x, z]), np.array([x + width_m, z + width_m])
    faces = _Faces()
    _ring_faces(faces, inner, outer, 0.0)
    below = _Faces()
    _ring_faces(below, inner, outer, -height_m)
    for quad in below.positions:
        faces.add(*quad[::-1])
    sides = _Faces()
    sides.box((-outer[0], -height_m, -outer[1]), (outer[0], 0.0, outer[1]), top=False)
    for quad in sides.positions[:4]:
        faces.add(*quad)
    sides = _Faces()
    sides.box((-x, -height_m, -z), (x, 0.0, z), inward=True, top=False)
    for quad in sides.positions[:4]:
        faces.add(*quad)
    return faces.mesh(name)


def stairs(name: str, size_m: Sequence[float], steps: int) -> Mesh:
    """Stairs that rise along +x in `steps` equal steps inside a box of (x, y, z) size, foot at y = 0. Watertight."""
    width, height, z = size_m[0], size_m[1], 0.5 * size_m[2]
    run, rise, x0 = width / steps, height / steps, -0.5 * width
    xs, ys = [x0 + run * i for i in range(steps)] + [-x0], [rise * i for i in range(steps)] + [height]
    faces = _Faces()
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


def sphere(name: str, radius_m: float, segments: int = 64) -> Mesh:
    """A sphere of `segments` meridians and segments/2 parallels, smooth normals. Watertight."""
    rows = max(segments // 2, 2)
    profile = []
    for i in range(rows + 1):
        angle = math.pi * (i / rows - 0.5)
        r, y = (0.0 if i in (0, rows) else math.cos(angle)), math.sin(angle)
        profile.append((radius_m * r, radius_m * y, r, y))
    return revolve(name, [profile], segments)


def icosphere(name: str, radius_m: float, subdivisions: int = 4) -> Mesh:
    """A sphere of 20 * 4^subdivisions nearly equal triangles, smooth normals. Watertight."""
    g = (1.0 + math.sqrt(5.0)) / 2.0
    corners = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    corners += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    index = "0 11 5 0 5 1 0 1 7 0 7 10 0 10 11 1 5 9 5 11 4 11 10 2 10 7 6 7 1 8 "
    index += "3 9 4 3 4 2 3 2 6 3 6 8 3 8 9 4 9 5 2 4 11 6 2 10 8 6 7 9 8 1"
    points = np.asarray(corners, np.float64) / math.hypot(1.0, g)
    tri = np.array(index.split(), np.int64).reshape(-1, 3)
    for _ in range(subdivisions):
        edges = np.sort(np.concatenate([tri[:, [0, 1]], tri[:, [1, 2]], tri[:, [2, 0]]]), axis=1)
        unique, inverse = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = inverse.reshape(3, -1) + len(points)
        middle = points[unique[:, 0]] + points[unique[:, 1]]
        points = np.concatenate([points, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        a, b, c = tri.T
        tri = np.stack([a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca], axis=1).reshape(-1, 3)
    uv = np.stack([np.arctan2(points[:, 2], points[:, 0]) / (2 * math.pi) + 0.5, 0.5 - 0.5 * points[:, 1]], axis=1)
    return make_mesh(name, radius_m * points, points, uv, tri)


def revolve(name: str, profiles: Sequence[Profile], segments: int, angle_rad: float = 2.0 * math.pi) -> Mesh:
    """Surfaces of revolution about +y; each profile is smooth in itself, edges between profiles are sharp.

    Profile points run so that the outside lies to the right when r is to the right and y up (bottom to top outside).
    A partial `angle_rad` starts at +x, turns towards -z, and is left open: the caller closes it.
    """
    whole = angle_rad >= 2.0 * math.pi - 1e-12
    angles = np.linspace(0.0, angle_rad, segments + 1)
    cos, sin = np.cos(angles), np.sin(angles)
    if whole:
        cos[-1], sin[-1] = cos[0], sin[0]  # the seam has to weld exactly
    positions, normals, uv, triangles, base = [], [], [], [], 0
    for points in profiles:
        r, y, nr, ny = np.asarray(points, np.float64).T
        rows, columns = len(r), segments + 1
        positions.append(np.stack([np.outer(r, cos), np.outer(y, np.ones(columns)), -np.outer(r, sin)], axis=-1))
        normals.append(np.stack([np.outer(nr, cos), np.outer(ny, np.ones(columns)), -np.outer(nr, sin)], axis=-1))
        length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(r), np.diff(y)))])
        u, v = np.meshgrid(np.linspace(0.0, 1.0, columns), 1.0 - length / length[-1])
        uv.append(np.stack([u, v], axis=-1))
        i, j = np.meshgrid(np.arange(segments), np.arange(rows - 1))
        a = (base + j * columns + i).ravel()
        lower = np.stack([a, a + 1, a + columns + 1], axis=1)[(r[j] > 0).ravel()]
        upper = np.stack([a, a + columns + 1, a + columns], axis=1)[(r[j + 1] > 0).ravel()]
        triangles += [lower, upper]
        base += rows * columns
    flat = [np.concatenate([x.reshape(-1, n) for x in part]) for part, n in ((positions, 3), (normals, 3), (uv, 2))]
    return make_mesh(name, flat[0], flat[1], flat[2], np.concatenate(triangles))


def cylinder(name: str, radius_m: float, height_m: float, segments: int = 64) -> Mesh:
    """An upright closed cylinder. Watertight."""
    r, h = radius_m, 0.5 * height_m
    return revolve(name, [[(0, -h, 0, -1), (r, -h, 0, -1)], [(r, -h, 1, 0), (r, h, 1, 0)], [(r, h, 0, 1), (0, h, 0, 1)]], segments)


def cone(name: str, radius_m: float, height_m: float, segments: int = 64) -> Mesh:
    """An upright closed cone, base at y = -height/2. Watertight."""
    r, h, slant = radius_m, 0.5 * height_m, math.hypot(radius_m, height_m)
    nr, ny = height_m / slant, radius_m / slant
    return revolve(name, [[(0, -h, 0, -1), (r, -h, 0, -1)], [(r, -h, nr, ny), (0, h, nr, ny)]], segments)


def torus(name: str, radius_m: float, tube_m: float, segments: int = 96) -> Mesh:
    """A torus lying flat: `radius_m` to the centre of the tube, `tube_m` the tube's radius. Watertight."""
    count = max(segments // 2, 3)
    angles = [2.0 * math.pi * i / count for i in range(count)] + [0.0]  # the last equals the first, to weld exactly
    profile = [(radius_m + tube_m * math.cos(a), tube_m * math.sin(a), math.cos(a), math.sin(a)) for a in angles]
    return revolve(name, [profile], segments)


def ring(name: str, inner_radius_m: float, outer_radius_m: float, height_m: float, segments: int = 256) -> Mesh:
    """An upright tube with thick walls, open at both ends, centred at the origin. Watertight."""
    return revolve(name, _tube_profiles(inner_radius_m, outer_radius_m, 0.5 * height_m), segments)


def _tube_profiles(inner: float, outer: float, h: float) -> list[Profile]:
    return [
        [(outer, -h, 1, 0), (outer, h, 1, 0)],
        [(outer, h, 0, 1), (inner, h, 0, 1)],
        [(inner, h, -1, 0), (inner, -h, -1, 0)],
        [(inner, -h, 0, -1), (outer, -h, 0, -1)],
    ]


def half_cylinder(name: str, inner_radius_m: float, thickness_m: float, height_m: float, segments: int = 192) -> Mesh:
    """Half a thick upright tube, the half with z < 0, open towards +z, centred on its axis. Watertight."""
    inner, outer, h = inner_radius_m, inner_radius_m + thickness_m, 0.5 * height_m
    half = revolve(name, _tube_profiles(inner, outer, h), segments, math.pi)
    # sin(pi) is not exactly 0: put the end on z = 0, so that the end faces weld.
    positions = half.positions_m.astype(np.float64)
    positions[np.abs(positions[:, 2]) < 1e-9 * outer, 2] = 0.0
    ends = _Faces()
    ends.add((inner, -h, 0), (outer, -h, 0), (outer, h, 0), (inner, h, 0))
    ends.add((-outer, -h, 0), (-inner, -h, 0), (-inner, h, 0), (-outer, h, 0))
    return make_mesh(
        name,
        np.concatenate([positions, *ends.positions]),
        np.concatenate([half.normals, *ends.normals]),
        np.concatenate([half.uv, *ends.uv]),
        np.concatenate([half.triangles, *[t + len(positions) for t in ends.triangles]]),
    )
