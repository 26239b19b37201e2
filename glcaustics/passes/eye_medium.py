"""What the eye is in: air, the water below an open surface, or a closed solid. Decided once a frame on the CPU."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glcaustics.scene.model import FloatArray, Instance, OpticalKind

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

    @property
    def found(self) -> EyeMedium | None:
        """The last answer."""
        return self._found

    def find(
        self, instances: Sequence[Instance], boxes_ws: FloatArray, eye_ws: FloatArray, version: int = 0
    ) -> EyeMedium | None:
        """The medium around the eye; None: air.

        Args:
            instances: in the order of the object table. boxes_ws: (N, 2, 3) of each, metres.
            eye_ws: (3,), metres. version: changes when the scene moves.
        """
        key = (version, np.asarray(eye_ws, np.float64).tobytes())
        if key != self._key:
            self._key, self._found = key, self._search(instances, boxes_ws, np.asarray(eye_ws, np.float64))
        return self._found

    def _search(self, instances: Sequence[Instance], boxes_ws: FloatArray, eye_ws: FloatArray) -> EyeMedium | None:
        around: list[tuple[float, EyeMedium]] = []
        above: list[tuple[float, EyeMedium]] = []
        for index, (instance, box_ws) in enumerate(zip(instances, boxes_ws, strict=True)):
            kind = instance.optical_kind
            if kind is OpticalKind.SOLID and holds(instance, box_ws, eye_ws):
                around.append((float(np.prod(np.ptp(box_ws, axis=0))), _medium(instance, solid=index)))
            elif kind is OpticalKind.INTERFACE:
                distance_m = self._below(instance, box_ws, eye_ws)
                if distance_m is not None:
                    above.append((distance_m, _medium(instance)))
        nearest = min(around or above, key=lambda pair: pair[0], default=None)
        return nearest[1] if nearest else None

    def _below(self, sheet: Instance, box_ws: FloatArray, eye_ws: FloatArray) -> float | None:
        """Metres from the eye to the sheet above it, by its mean normal; None when the eye is not below it."""
        normal = self._normals.get(sheet.name)
        if normal is None:
            normal = self._normals[sheet.name] = mean_normal(sheet)
        highest = np.where(normal > 0.0, box_ws[1], box_ws[0]) @ normal
        if not normal.any() or float(eye_ws @ normal) >= float(highest):
            return None
        straight = first_crossing(sheet, eye_ws, normal)
        if straight is not None:
            return straight[0] if straight[1] else None
        side = _perpendicular(normal)
        sides = (side, -side, np.cross(normal, side), -np.cross(normal, side))
        tilted = [first_crossing(sheet, eye_ws, normal + _TILT * s) for s in sides]
        through_back = [hit[0] for hit in tilted if hit is not None and hit[1]]
        return min(through_back) if len(through_back) >= _TILTED_HITS else None


def _medium(instance: Instance, solid: int = -1) -> EyeMedium:
    material = instance.material
    return EyeMedium(instance.name, np.asarray(material.sigma_a, np.float64), float(material.ior), solid)


def mean_normal(instance: Instance) -> FloatArray:
    """Direction (3,) of the vertices' mean normal, unit length, world space; zero where the normals cancel."""
    linear = np.linalg.inv(instance.world_from_object[:3, :3]).T
    normal = np.asarray(linear @ instance.mesh.normals.mean(axis=0, dtype=np.float64))
    length = float(np.linalg.norm(normal))
    return np.asarray(normal / length) if length > 1e-3 * float(np.linalg.norm(linear)) else np.zeros(3)


def _perpendicular(n: FloatArray) -> FloatArray:
    side = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    return np.asarray(side / np.linalg.norm(side))


def first_crossing(instance: Instance, origin_ws: FloatArray, direction_ws: FloatArray) -> tuple[float, bool] | None:
    """The first triangle of an instance that a ray crosses; edges belong to both their triangles.

    Returns:
        Distance in lengths of `direction_ws`, and whether it is crossed from its back (the ray goes along the normal
        that the winding gives). None without a crossing.
    """
    inverse = np.linalg.inv(instance.world_from_object)
    origin, direction = inverse[:3, :3] @ origin_ws + inverse[:3, 3], inverse[:3, :3] @ direction_ws
    points, triangles = instance.mesh.positions_m, instance.mesh.triangles
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


def holds(instance: Instance, box_ws: FloatArray, point_ws: FloatArray) -> bool:
    """Whether a watertight mesh encloses a point (3,): from there, the first surface on a way out is met from its back.

    Two of three rays decide, should one run along an edge. A mesh wound inside out holds nothing.
    """
    low, high = box_ws
    if not instance.mesh.watertight or (point_ws <= low).any() or (point_ws >= high).any():
        return False
    hits = (first_crossing(instance, point_ws, np.asarray(way)) for way in _WAYS)
    return sum(hit is not None and hit[1] for hit in hits) >= 2
