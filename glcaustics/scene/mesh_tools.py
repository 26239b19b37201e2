"""Triangle-mesh geometry on NumPy arrays: welding, normals, watertightness, degenerate triangles.

Every tolerance is relative to the mesh, so that a scene in millimetres and one in kilometres are read alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from glcaustics.scene.model import FloatArray, IntArray

CONVEX_TOLERANCE = 1e-4  # of the mesh's extent: what an edge may bend inwards by rounding
WELD_TOLERANCE = 1e-6  # of the mesh's extent: what a modeller's rounding moves the two sides of a uv seam apart
CREASE_ANGLE_RAD = math.radians(60.0)  # edges that bend more than this stay sharp when normals are computed
SLIVER_RATIO = 1e-7  # height over longest edge below which a triangle is rounding noise of float32


def weld(positions_m: FloatArray, tolerance: float = WELD_TOLERANCE) -> IntArray:
    """Vertices of equal position get one number.

    Args:
        positions_m: (V, 3), metres, any space.
        tolerance: positions this close, per axis, are surely one; a fraction of the mesh's largest extent.

    Returns:
        (V,) int64, for each vertex the smallest index of a vertex at the same place.
    """
    points = np.asarray(positions_m, np.float64)
    if len(points) == 0:
        return np.zeros(0, np.int64)
    low = points.min(axis=0)
    extent = float((points.max(axis=0) - low).max())
    rounding = 2.0 * float(np.finfo(np.float32).eps) * float(np.abs(points).max())
    cell = max(2.0 * max(tolerance * extent, rounding), extent / (1 << 20))
    if cell == 0.0:
        return np.zeros(len(points), np.int64)
    first, same = _distinct_rows(points)  # few are left for the eight sorts below
    in_cells = (points[first] - low) / cell
    everyone = np.arange(len(first), dtype=np.int64)
    links_from, links_to = [], []
    # A grid can cut between two close points; of the eight grids shifted by half a cell one never does.
    for shift in np.ndindex(2, 2, 2):
        x, y, z = np.floor(in_cells + 0.5 * np.asarray(shift)).astype(np.int64).T
        _, start, group = np.unique((x << 42) | (y << 21) | z, return_index=True, return_inverse=True)
        moved = start[group] != everyone
        links_from.append(everyone[moved])
        links_to.append(start[group][moved])
    labels = _components(np.concatenate(links_from), np.concatenate(links_to), len(first))
    return np.asarray(first[labels][same])


def _distinct_rows(points: FloatArray) -> tuple[IntArray, IntArray]:
    """First index of each distinct row, in rising order, and for each row (V,) the number of its distinct row."""
    order = np.lexsort(points.T)
    ordered = points[order]
    fresh = np.concatenate(([True], np.any(ordered[1:] != ordered[:-1], axis=1)))
    first = order[fresh]  # lexsort is stable: the smallest index of each group
    rank = np.argsort(np.argsort(first))
    same = np.empty(len(points), np.int64)
    same[order] = rank[np.cumsum(fresh) - 1]
    return np.sort(first), same


def face_normals(positions_m: FloatArray, triangles: IntArray) -> FloatArray:
    """Unit normals (T, 3) float64 by the right-hand rule; zero where a triangle has no area."""
    return _unit(_area_vectors(positions_m, triangles))


def _area_vectors(positions_m: FloatArray, triangles: IntArray) -> FloatArray:
    corners = np.asarray(positions_m, np.float64)[triangles]
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _unit(vectors: FloatArray) -> FloatArray:
    peak = np.abs(vectors).max(axis=-1, keepdims=True)  # dividing by it first keeps tiny scenes from underflow
    scaled = np.divide(vectors, peak, out=np.zeros_like(vectors), where=peak > 0.0)
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    return np.asarray(np.divide(scaled, length, out=np.zeros_like(scaled), where=length > 0.0))


def corner_angles(positions_m: FloatArray, triangles: IntArray) -> FloatArray:
    """Interior angles (T, 3), radians; zero at corners of zero-length edges."""
    corners = np.asarray(positions_m, np.float64)[triangles]
    to_next = _unit(np.roll(corners, -1, axis=1) - corners)
    to_last = _unit(np.roll(corners, 1, axis=1) - corners)
    cosine = np.clip(np.einsum("tci,tci->tc", to_next, to_last), -1.0, 1.0)
    usable = np.any(to_next != 0.0, axis=2) & np.any(to_last != 0.0, axis=2)
    return np.where(usable, np.arccos(cosine), 0.0)


def directed_edges(triangles: IntArray) -> IntArray:
    """The edges (3T, 2) in the order of the triangles' corners: 01, 12, 20."""
    return np.asarray(np.stack((triangles, np.roll(triangles, -1, axis=1)), axis=2).reshape(-1, 2))


@dataclass(frozen=True)
class Topology:
    """How far a mesh is from being a solid. `open_edges`: edges with a triangle on one side only;
    `miswound_edges`: edges whose triangles run the same way round."""

    open_edges: int
    miswound_edges: int

    @property
    def watertight(self) -> bool:
        return self.open_edges == 0 and self.miswound_edges == 0


def topology(positions_m: FloatArray, triangles: IntArray, labels: IntArray | None = None) -> Topology:
    """Count the edges that keep a mesh from being watertight, after welding vertices of equal position.

    Args:
        positions_m: (V, 3), metres. triangles: (T, 3) indices. labels: `weld(positions_m)` if it is at hand.

    Returns:
        Topology; a mesh of no triangles counts as open.
    """
    welded = (weld(positions_m) if labels is None else labels)[triangles]
    collapsed = (welded == np.roll(welded, 1, axis=1)).any(axis=1)  # such as those at the poles of a sphere
    edges = directed_edges(welded[~collapsed])
    if len(edges) == 0:
        return Topology(open_edges=max(1, 3 * len(triangles)), miswound_edges=0)
    low, high = edges.min(axis=1), edges.max(axis=1)
    key = low * (int(high.max()) + 1) + high
    _, group = np.unique(key, return_inverse=True)
    uses = np.bincount(group)
    balance = np.bincount(group, weights=np.where(edges[:, 0] == low, 1.0, -1.0))
    odd = uses % 2 == 1
    return Topology(open_edges=int(odd.sum()), miswound_edges=int((~odd & (balance != 0.0)).sum()))


def is_watertight(positions_m: FloatArray, triangles: IntArray) -> bool:
    """True if every edge is shared by triangles of opposite directions (`Mesh.watertight`)."""
    return topology(positions_m, triangles).watertight


def signed_volume(positions_m: FloatArray, triangles: IntArray) -> float:
    """Volume of a closed mesh, m^3 (divergence theorem); negative if the triangles face inwards."""
    points = np.asarray(positions_m, np.float64)
    corners = (points - points.mean(axis=0))[triangles]
    return float(np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)


def enclosure(positions_m: FloatArray, triangles: IntArray) -> float:
    """How much a surface turns round on itself, 0..1: 0 for a flat sheet, 1 for anything closed."""
    vectors = _area_vectors(positions_m, triangles)
    total = float(np.linalg.norm(vectors, axis=1).sum())
    return 1.0 - float(np.linalg.norm(vectors.sum(axis=0))) / total if total > 0.0 else 0.0


def is_convex(positions_m: FloatArray, triangles: IntArray) -> bool:
    """Whether a watertight mesh is one convex body: no edge bends inwards, and it is all in one piece.

    Inwards counts from `CONVEX_TOLERANCE` of the extent on, since rounded vertices of a flat face bend both ways.
    """
    points = np.asarray(positions_m, np.float64)
    corners = weld(points)[triangles]
    corners = corners[~(corners == np.roll(corners, 1, axis=1)).any(axis=1)]
    if len(corners) == 0:
        return False
    edges = directed_edges(corners)
    owner, opposite = np.repeat(np.arange(len(corners)), 3), np.roll(corners, 1, axis=1).ravel()
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((low, high))
    pairs = order.reshape(-1, 2) if len(order) % 2 == 0 else None
    if pairs is None or (low[pairs[:, 0]] != low[pairs[:, 1]]).any() or (high[pairs[:, 0]] != high[pairs[:, 1]]).any():
        return False
    faces = face_normals(points, corners)[owner[pairs[:, 0]]]
    above = np.einsum("ei,ei->e", faces, points[opposite[pairs[:, 1]]] - points[corners[owner[pairs[:, 0]], 0]])
    if above.max() > CONVEX_TOLERANCE * float(np.ptp(points, axis=0).max()):
        return False
    used, index = np.unique(edges, return_inverse=True)
    index = index.reshape(-1, 2)
    return len(np.unique(_components(index[:, 0], index[:, 1], len(used)))) == 1


def nondegenerate(positions_m: FloatArray, triangles: IntArray) -> IntArray:
    """Mask (T,) of the triangles that have an area, judged against their own longest edge (scale-free)."""
    corners = np.asarray(positions_m, np.float64)[triangles]
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    scale = np.where(longest > 0.0, longest, 1.0)[:, None]
    double_area = np.linalg.norm(np.cross(edges[:, 0] / scale, edges[:, 1] / scale), axis=1)
    return np.asarray(double_area > SLIVER_RATIO)


def smooth_normals(positions_m: FloatArray, triangles: IntArray, labels: IntArray | None = None) -> FloatArray:
    """Angle-weighted vertex normals over all triangles that meet at a position (Thuermer and Wuethrich 1998).

    Args:
        positions_m: (V, 3), metres; vertices of equal position share their normal. triangles: (T, 3).
        labels: `weld(positions_m)` if it is at hand.

    Returns:
        (V, 3) float64 unit normals in the space of the positions; (0, 1, 0) where no triangle gives one.
    """
    labels = weld(positions_m) if labels is None else labels
    weighted = face_normals(positions_m, triangles)[:, None, :] * corner_angles(positions_m, triangles)[:, :, None]
    normals = _unit(_sum_by(labels[triangles].ravel(), weighted.reshape(-1, 3), len(labels))[labels])
    normals[~normals.any(axis=1)] = (0.0, 1.0, 0.0)
    return normals


def _sum_by(group: IntArray, vectors: FloatArray, count: int) -> FloatArray:
    return np.stack([np.bincount(group, weights=vectors[:, axis], minlength=count) for axis in range(3)], axis=1)


@dataclass(frozen=True, eq=False)
class SplitNormals:
    """Normals that may differ between triangles sharing a vertex: `source[i]` is the old number of new vertex i."""

    normals: FloatArray
    triangles: IntArray
    source: IntArray


def flat_normals(positions_m: FloatArray, triangles: IntArray) -> SplitNormals:
    """Each triangle gets its own three vertices with the face's normal (what glTF asks for by default)."""
    normals = np.repeat(face_normals(positions_m, triangles), 3, axis=0)
    new_triangles = np.arange(3 * len(triangles), dtype=np.uint32).reshape(-1, 3)
    return SplitNormals(normals, new_triangles, triangles.ravel())


def crease_normals(
    positions_m: FloatArray,
    triangles: IntArray,
    crease_rad: float = CREASE_ANGLE_RAD,
    labels: IntArray | None = None,
) -> SplitNormals:
    """Smooth angle-weighted normals that stop at edges bending by `crease_rad` or more; vertices are split there.

    Args:
        positions_m: (V, 3), metres. triangles: (T, 3), degenerate ones removed beforehand.
        crease_rad: dihedral angle between the faces' normals, radians. labels: `weld(positions_m)` if at hand.

    Returns:
        SplitNormals with unit normals (V', 3), triangles (T, 3) uint32 and source (V',).
    """
    corners = (weld(positions_m) if labels is None else labels)[triangles]
    faces = face_normals(positions_m, triangles)
    groups = _smooth_groups(corners, faces, math.cos(crease_rad))
    weighted = faces[:, None, :] * corner_angles(positions_m, triangles)[:, :, None]
    corner_normals = _unit(_sum_by(groups, weighted.reshape(-1, 3), groups.size)[groups])
    lost = ~corner_normals.any(axis=1)
    corner_normals[lost] = np.repeat(faces, 3, axis=0)[lost]
    # one new vertex for every (old vertex, smoothing group)
    pairs = np.asarray(triangles, np.int64).ravel() * groups.size + groups
    unique, first, inverse = np.unique(pairs, return_index=True, return_inverse=True)
    new_triangles = inverse.reshape(-1, 3).astype(np.uint32)
    return SplitNormals(corner_normals[first], new_triangles, unique // groups.size)


def _smooth_groups(corners: IntArray, faces: FloatArray, min_cosine: float) -> IntArray:
    """Group number (3T,) of every triangle corner: corners at one vertex are joined across its unsharp edges."""
    edges = directed_edges(corners)
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((high, low))
    low, high = low[order], high[order]
    same = (low[1:] == low[:-1]) & (high[1:] == high[:-1])
    one, two = order[:-1][same], order[1:][same]  # edge number = number of its first corner
    unsharp = np.einsum("ei,ei->e", faces[one // 3], faces[two // 3]) > min_cosine
    one, two = one[unsharp], two[unsharp]
    end_one, end_two = 3 * (one // 3) + (one % 3 + 1) % 3, 3 * (two // 3) + (two % 3 + 1) % 3
    opposite = edges[one, 0] == edges[two, 1]  # well wound: the edge runs the other way in its neighbour
    links_from = np.concatenate((one, end_one))
    links_to = np.concatenate((np.where(opposite, end_two, two), np.where(opposite, two, end_two)))
    return _components(links_from, links_to, corners.size)


def _components(links_from: IntArray, links_to: IntArray, count: int) -> IntArray:
    """Smallest member (count,) of the connected component of each node."""
    parent = np.arange(count, dtype=np.int64)
    while True:
        smaller = np.minimum(parent[links_from], parent[links_to])
        before = parent.copy()
        for ends in (links_from, links_to):
            np.minimum.at(parent, before[ends], smaller)
            np.minimum.at(parent, ends, smaller)
        parent = parent[parent]
        if np.array_equal(parent, before):
            return parent
