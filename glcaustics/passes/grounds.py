"""Floors and walls at the scene's far side, which can throw no shadow."""

from __future__ import annotations

import numpy as np

from glcaustics.scene.model import FloatArray, Instance, IntArray, Light, LightKind


def grounds(everything: tuple[Instance, ...], light: Light) -> frozenset[int]:
    """Identities of the instances that can throw no shadow: floors and walls at the scene's far side.

    A plane separates such a convex body from everything else and from the light, so that no ray from the light to
    anything else meets it; and a convex body throws no shadow on its own lit side. Kept out of the shadow map, a wide
    floor does not thin out its texels.
    """
    parts = [instance.positions_ws() for instance in everything]
    found = set()
    for index, (instance, points) in enumerate(zip(everything, parts, strict=True)):
        others = parts[:index] + parts[index + 1 :]
        if len(instance.mesh.triangles) <= 64 and _is_behind_all(points, instance.mesh.triangles, others, light):
            found.add(id(instance))
    return frozenset(found)


def _is_behind_all(points: FloatArray, triangles: IntArray, others: list[FloatArray], light: Light) -> bool:
    a, b, c = (points[triangles[:, i].astype(np.int64)] for i in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    faces = lengths > 1e-12 * extent * extent
    normals, origins = normals[faces] / lengths[faces, None], a[faces]
    beyond = points @ normals.T - np.sum(normals * origins, axis=1)
    if not len(normals) or float(beyond.max()) > 1e-4 * extent:
        return False  # not convex
    for normal, origin in _unique_planes(normals, origins, flat=float(np.abs(beyond).max()) <= 1e-4 * extent):
        if light.kind is LightKind.DIRECTIONAL:
            side = -float(np.asarray(light.direction_ws) @ normal)
        else:
            side = float((np.asarray(light.position_ws) - origin) @ normal)
        if side > 0.0 and all(float(((p - origin) @ normal).min()) > -1e-4 * extent for p in others):
            return True
    return False


def _unique_planes(normals: FloatArray, origins: FloatArray, *, flat: bool) -> list[tuple[FloatArray, FloatArray]]:
    """Face planes without repetition; a flat sheet has two sides."""
    _, first = np.unique(np.round(normals, 5), axis=0, return_index=True)
    planes = [(normals[k], origins[k]) for k in first]
    return planes + [(-n, o) for n, o in planes] if flat else planes
