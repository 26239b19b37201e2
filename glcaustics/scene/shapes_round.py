"""Procedural round meshes with exact smooth normals. Solids are watertight; lengths in metres.

Object space: origin at the shape's centre, axis +y. Texture coordinates go once round in u, bottom to top in v.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from glcaustics.scene.model import Mesh
from glcaustics.scene.shapes import Faces, make_mesh

Array = npt.NDArray[np.float64]
Profile = Sequence[tuple[float, float, float, float]]  # points (r, y, normal r, normal y), bottom to top outside


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
    upright = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0)]
    corners = [np.roll(corner, shift) for shift in range(3) for corner in upright]
    index = "0 11 5 0 5 1 0 1 7 0 7 10 0 10 11 1 5 9 5 11 4 11 10 2 10 7 6 7 1 8 "
    index += "3 9 4 3 4 2 3 2 6 3 6 8 3 8 9 4 9 5 2 4 11 6 2 10 8 6 7 9 8 1"
    points = np.array(corners, np.float64) / math.hypot(1.0, g)
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
    bottom, side = [(0, -h, 0, -1), (r, -h, 0, -1)], [(r, -h, 1, 0), (r, h, 1, 0)]
    return revolve(name, [bottom, side, [(r, h, 0, 1), (0, h, 0, 1)]], segments)


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
    ends = Faces()
    ends.add((inner, -h, 0), (outer, -h, 0), (outer, h, 0), (inner, h, 0))
    ends.add((-outer, -h, 0), (-inner, -h, 0), (-inner, h, 0), (-outer, h, 0))
    return make_mesh(
        name,
        np.concatenate([positions, *ends.positions]),
        np.concatenate([half.normals, *ends.normals]),
        np.concatenate([half.uv, *ends.uv]),
        np.concatenate([half.triangles, *[t + len(positions) for t in ends.triangles]]),
    )
