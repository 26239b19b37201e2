"""What the eye is in: air, the water below an open surface, or a closed solid. Decided once a frame on the CPU."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glcaustics.passes.geometry import DrawItem
from glcaustics.scene.model import FloatArray, OpticalKind

_TILT = 0.45  # tangent of the angle between the sheet's mean normal and the four further rays
_WAYS = ((0.236, 0.917, 0.322), (-0.871, 0.133, 0.473), (0.411, -0.377, -0.830))  # no axis of anything
_TILTED_HITS = 3  # of these four that must meet the sheet's back where the straight ray goes through a hole in it


@dataclass(frozen=True, eq=False)
class EyeMedium:
    """The dense medium around the eye.

    `name`: of the instance whose surface bounds it. `sigma_a`: absorption (3,), 1/m. `ior`: index of refraction.
    `solid`: the object-table row of the closed solid that the eye is in, -1 below an open surface.
    """

    name: str
    sigma_a: FloatArray
    ior: float
    solid: int = -1

    @property
    def words(self) -> str:
        """For the plan's notes and announcements."""
        sigma = ", ".join(f"{s:.3g}" for s in self.sigma_a)
        return f"the eye is in '{self.name}' (index {self.ior:g}, absorption {sigma} 1/m)"


class EyeMediumFinder:
    """Finds the eye's medium, and keeps the answer while neither scene nor eye moves.

    Closed solids count first, the smallest that holds the eye. Then open surfaces: a ray from the eye along the
    surface's mean normal; the eye is in the medium when the first crossing is through the back, since the denser
    medium lies opposite the normals. Tested against this frame's mesh, so waves count as they stand. Where that ray
    goes through a hole (a hull cut out of the water), four tilted ones vote.
    """

    def __init__(self) -> None:
        self._normals: dict[str, FloatArray] = {}
        self._key: tuple[int, bytes] | None = None
        self._found: EyeMedium | None = None

    def find(self, items: Sequence[DrawItem], eye_ws: FloatArray, version: int) -> EyeMedium | None:
        """The medium around `eye_ws` (3,), metres, world space; None: air. `version`: changes when the scene moves."""
        key = (version, np.asarray(eye_ws, np.float64).tobytes())
        if key != self._key:
            self._key, self._found = key, self._search(items, np.asarray(eye_ws, np.float64))
        return self._found

    def _search(self, items: Sequence[DrawItem], eye_ws: FloatArray) -> EyeMedium | None:
        solids = [item for item in items if item.kind is OpticalKind.SOLID and holds(item, eye_ws)]
        if solids:
            item = min(solids, key=lambda i: float(np.prod(np.ptp(i.bounds_ws, axis=0))))
            return _medium(item, solid=item.index)
        found = [
            (distance, item)
            for item in items
            if item.kind is OpticalKind.INTERFACE and (distance := self._below(item, eye_ws)) is not None
        ]
        return _medium(min(found, key=lambda pair: pair[0])[1]) if found else None

    def _below(self, item: DrawItem, eye_ws: FloatArray) -> float | None:
        """Metres from the eye to the sheet above it, by its mean normal; None when the eye is not below it."""
        normal = self._normals.get(item.instance.name)
        if normal is None:
            normal = self._normals[item.instance.name] = mean_normal(item)
        highest = np.where(normal > 0.0, item.bounds_ws[1], item.bounds_ws[0]) @ normal
        if not normal.any() or float(eye_ws @ normal) >= float(highest):
            return None
        straight = first_crossing(item, eye_ws, normal)
        if straight is not None:
            return straight[0] if straight[1] else None
        side = _perpendicular(normal)
        sides = (side, -side, np.cross(normal, side), -np.cross(normal, side))
        tilted = [first_crossing(item, eye_ws, normal + _TILT * s) for s in sides]
        through_back = [hit[0] for hit in tilted if hit is not None and hit[1]]
        return min(through_back) if len(through_back) >= _TILTED_HITS else None


def _medium(item: DrawItem, solid: int = -1) -> EyeMedium:
    material = item.instance.material
    return EyeMedium(item.instance.name, np.asarray(material.sigma_a, np.float64), float(material.ior), solid)


def mean_normal(item: DrawItem) -> FloatArray:
    """Direction (3,) of the vertices' mean normal, unit length; zero where the normals cancel."""
    normal = np.asarray(item.normal_from_object @ item.instance.mesh.normals.mean(axis=0, dtype=np.float64))
    length = float(np.linalg.norm(normal))
    scale = float(np.linalg.norm(item.normal_from_object))
    return np.asarray(normal / length) if length > 1e-3 * scale else np.zeros(3)


def _perpendicular(n: FloatArray) -> FloatArray:
    side = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    return np.asarray(side / np.linalg.norm(side))


def first_crossing(item: DrawItem, origin_ws: FloatArray, direction_ws: FloatArray) -> tuple[float, bool] | None:
    """The first triangle of an instance that a ray crosses; edges belong to both their triangles.

    Returns:
        Distance in lengths of `direction_ws`, and whether it is crossed from its back (the ray goes along the normal
        that the winding gives). None without a crossing.
    """
    inverse = np.linalg.inv(item.world_from_object)
    origin, direction = inverse[:3, :3] @ origin_ws + inverse[:3, 3], inverse[:3, :3] @ direction_ws
    points, triangles = item.instance.mesh.positions_m, item.instance.mesh.triangles
    u = _perpendicular(direction)
    uv = np.stack((u, np.cross(direction, u) / np.linalg.norm(direction)), 1)
    # Seen along the ray: only a triangle with corners on both sides of the origin, in u and in v, can be crossed.
    flat = points @ uv.astype(np.float32)
    at, slack = origin @ uv, 1e-6 * float(np.abs(points).max())
    sides = np.zeros(len(points), np.uint8)
    for axis in range(2):
        sides |= (flat[:, axis] <= at[axis] + slack) * np.uint8(1 << 2 * axis)
        sides |= (flat[:, axis] >= at[axis] - slack) * np.uint8(2 << 2 * axis)
    near = triangles[np.bitwise_or.reduce([sides[triangles[:, k]] for k in range(3)]) == 15]
    corners = points[near].astype(np.float64) - origin
    a, b, c = np.moveaxis(corners @ uv, 1, 0)
    twice = _cross2(b - a, c - a)
    weights = np.stack((_cross2(b, c), _cross2(c, a), _cross2(a, b)), 1)
    weights = weights / np.where(twice == 0.0, np.inf, twice)[:, None]
    distances = (weights * (corners @ (direction / (direction @ direction)))).sum(axis=1)
    hit = (weights >= -1e-9).all(axis=1) & (distances > 0.0) & (twice != 0.0)
    if not hit.any():
        return None
    first = int(np.argmin(np.where(hit, distances, np.inf)))
    return float(distances[first]), bool(twice[first] * np.linalg.det(inverse[:3, :3]) > 0.0)


def _cross2(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def holds(item: DrawItem, point_ws: FloatArray) -> bool:
    """Whether a watertight mesh encloses a point (3,): from there, the first surface on a way out is met from its back.

    Two of three rays decide, should one run along an edge. A mesh wound inside out holds nothing.
    """
    low, high = item.bounds_ws
    if not item.instance.mesh.watertight or (point_ws <= low).any() or (point_ws >= high).any():
        return False
    hits = (first_crossing(item, point_ws, np.asarray(way)) for way in _WAYS)
    return sum(hit is not None and hit[1] for hit in hits) >= 2
