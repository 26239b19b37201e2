"""First hits of rays with triangles and analytic waters: Embree finds the triangle, float64 finds the point on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError
from glcaustics.optics.beam_scene import BeamScene, BeamWater

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
START_OFFSET = 4e-6  # of the scene's extent: beyond the rounding of Embree's float32, far below any feature
NEWTON_STEPS = 12


@dataclass(frozen=True, eq=False)
class Hits:
    """First hits of n rays. `object_id` (n,) is -1 where there is none; then the other fields are undefined.

    `t` (n,) metres along the unit ray; `point_ws`, `geometric_ws`, `normal_ws` (n, 3): point, unit geometric normal
    (front side), unit interpolated normal on the same side.
    """

    object_id: IntArray
    t: FloatArray
    point_ws: FloatArray
    geometric_ws: FloatArray
    normal_ws: FloatArray

    def pick(self, chosen: BoolArray) -> Hits:
        """Those of a mask (n,)."""
        return Hits(
            self.object_id[chosen],
            self.t[chosen],
            self.point_ws[chosen],
            self.geometric_ws[chosen],
            self.normal_ws[chosen],
        )


class RayCaster:
    """Ray queries in a BeamScene.

    Raises:
        UsageError: embreex is not installed.
    """

    def __init__(self, scene: BeamScene) -> None:
        self._waters = scene.waters
        self._first_water = len(scene.meshes)
        self._corners = np.concatenate([m.positions_ws[m.triangles] for m in scene.meshes]).astype(np.float64)
        self._normals = np.concatenate([m.normals_ws[m.triangles] for m in scene.meshes]).astype(np.float64)
        self._object = np.concatenate([np.full(len(m.triangles), i) for i, m in enumerate(scene.meshes)])
        edge_1, edge_2 = self._corners[:, 1] - self._corners[:, 0], self._corners[:, 2] - self._corners[:, 0]
        area_vector = np.cross(edge_1, edge_2)
        area2 = np.linalg.norm(area_vector, axis=1)
        solid = area2 > 0.0
        self._corners, self._normals, self._object = self._corners[solid], self._normals[solid], self._object[solid]
        self._edge_1, self._edge_2 = edge_1[solid], edge_2[solid]
        self._face = area_vector[solid] / area2[solid, None]
        self._inverse_area2 = 1.0 / area2[solid]
        spread = self._corners.reshape(-1, 3)
        self.extent_m = float(np.abs(spread).max() + (spread.max(axis=0) - spread.min(axis=0)).max())
        self._embree = _embree_scene(self._corners)

    def first_hits(self, origin_ws: FloatArray, direction_ws: FloatArray, from_water: IntArray | None = None) -> Hits:
        """First hits beyond START_OFFSET.

        Args:
            origin_ws, direction_ws: (n, 3), unit directions.
            from_water: (n,) object number of the water that the ray starts on, which it cannot meet again; or None.
        """
        hits = self._mesh_hits(origin_ws, direction_ws)
        for i, water in enumerate(self._waters):
            number = self._first_water + i
            may = np.ones(len(origin_ws), bool) if from_water is None else from_water != number
            self._keep_nearer(hits, water, number, origin_ws, direction_ws, may)
        return hits

    def _mesh_hits(self, origin: FloatArray, direction: FloatArray) -> Hits:
        start = origin + direction * (START_OFFSET * self.extent_m)
        found = self._embree.run(start.astype(np.float32), direction.astype(np.float32)).astype(np.int64)
        hit = found >= 0
        triangle = np.where(hit, found, 0)
        face = self._face[triangle]
        from_corner = origin - self._corners[triangle, 0]
        slope = np.einsum("ij,ij->i", direction, face)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = -np.einsum("ij,ij->i", from_corner, face) / slope
        hit &= np.isfinite(t) & (t > 0.0)
        t = np.where(hit, t, np.inf)
        point = origin + np.where(hit, t, 0.0)[:, None] * direction
        offset = point - self._corners[triangle, 0]
        inverse = self._inverse_area2[triangle]
        v = np.einsum("ij,ij->i", np.cross(offset, self._edge_2[triangle]), face) * inverse
        w = np.einsum("ij,ij->i", np.cross(self._edge_1[triangle], offset), face) * inverse
        corners = self._normals[triangle]
        normal = corners[:, 0] * (1.0 - v - w)[:, None] + corners[:, 1] * v[:, None] + corners[:, 2] * w[:, None]
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.where(length > 1e-12, normal / np.maximum(length, 1e-12), face)
        return Hits(np.where(hit, self._object[triangle], -1), t, point, face, normal)

    @staticmethod
    def _keep_nearer(
        hits: Hits, water: BeamWater, number: int, origin: FloatArray, direction: FloatArray, may: BoolArray
    ) -> None:
        t, x, z = _water_crossing(water, origin, direction, may)
        nearer = np.flatnonzero(t < hits.t)
        if nearer.size == 0:
            return
        slope_x, slope_z = water.field.gradient(x[nearer], z[nearer])
        normal = np.stack([-slope_x, np.ones_like(slope_x), -slope_z], axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        hits.object_id[nearer] = number
        hits.t[nearer] = t[nearer]
        hits.point_ws[nearer] = origin[nearer] + t[nearer, None] * direction[nearer]
        hits.geometric_ws[nearer] = normal
        hits.normal_ws[nearer] = normal


def _water_crossing(
    water: BeamWater, origin: FloatArray, direction: FloatArray, may: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """t (inf: none), and x, z of the crossing relative to the water's centre; Newton from the mean level."""
    cx, cy, cz = water.centre_ws
    slope = direction[:, 1]
    may = may & (np.abs(slope) > 1e-9)
    safe = np.where(may, slope, 1.0)
    t = np.where(may, (cy - origin[:, 1]) / safe, 0.0)
    for _ in range(NEWTON_STEPS):
        x, z = origin[:, 0] + t * direction[:, 0] - cx, origin[:, 2] + t * direction[:, 2] - cz
        gap = origin[:, 1] + t * slope - cy - water.field.height_m(x, z)
        gx, gz = water.field.gradient(x, z)
        rate = slope - gx * direction[:, 0] - gz * direction[:, 2]
        step = gap / np.where(np.abs(rate) > 1e-9, rate, np.inf)
        t = t - step
        if np.max(np.abs(step), where=may, initial=0.0) < 1e-14 * (1.0 + abs(cy)):
            break
    x, z = origin[:, 0] + t * direction[:, 0] - cx, origin[:, 2] + t * direction[:, 2] - cz
    inside = (np.abs(x) <= 0.5 * water.size_m[0]) & (np.abs(z) <= 0.5 * water.size_m[1])
    gap = origin[:, 1] + t * slope - cy - water.field.height_m(x, z)
    good = may & inside & (t > 1e-9) & (np.abs(gap) < 1e-9 * (1.0 + abs(cy)))
    return np.where(good, t, np.inf), x, z


def _embree_scene(corners: FloatArray):  # type: ignore[no-untyped-def]  # embreex has no types
    try:
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh
    except ImportError as error:
        remedy = "install it with: pip install 'glcaustics[bench]'"
        raise UsageError("reference beams need the embreex package", where="optics.raycast", remedy=remedy) from error
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, np.ascontiguousarray(corners, np.float32))
    return scene
