"""The receivers of caustics as the light sees them that lands on them: straight, or bent by a water surface."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from glcaustics.passes.fit_view import fit_view
from glcaustics.passes.geometry import boxes_of, points_of
from glcaustics.passes.light_views import LightView
from glcaustics.passes.view_math import unit
from glcaustics.scene.model import FloatArray, Instance, Light, LightKind, OpticalKind

BESIDE = "beside"  # the receivers from the light itself
BELOW = "below"  # along the light as a water surface refracts it
CORE = ".core"  # suffix of the view over the small part of a window in which most of the light lands


@dataclass(frozen=True, eq=False)
class ReceiverView:
    """The receivers as the light that lands on them sees them.

    `view.light` may be a virtual light: under water the light comes along the refracted direction (directional), or
    from the surface's image of the lamp (point, spot). Seen from the real light the deck would hide what it does reach.
    `inner_ndc`: of a core, the half extents of the part that counts, in clip space; light beyond it is looked up in the
    map around. `clip_plane`: (a, b, c, d); receivers where a x + b y + c z + d < 0 (above the water) are not drawn.
    """

    name: str
    view: LightView
    clip_plane: tuple[float, float, float, float] | None = None
    inner_ndc: tuple[float, float] | None = None

    @property
    def base(self) -> str:
        """BESIDE or BELOW: the view of which this is a core (or a core's core), or itself."""
        return self.name.split(CORE)[0]


def receiver_views(everything: tuple[Instance, ...], light: Light, texels: int) -> dict[str, ReceiverView]:
    """The receiver views that the scene's specular surfaces call for, fitted to all receivers."""
    diffuse = [i for i in everything if i.optical_kind is OpticalKind.DIFFUSE]
    receivers, boxes = points_of(diffuse), boxes_of(diffuse)
    interfaces = [i for i in everything if i.optical_kind is OpticalKind.INTERFACE]
    views = {BESIDE: ReceiverView(BESIDE, fit_view(light, receivers, texels, boxes_ws=boxes))}
    if interfaces:
        virtual, plane = light_below(interfaces, light)
        under = receivers if plane is None else points_under(diffuse, plane)
        if len(under) == 0:
            under = receivers
        views[BELOW] = ReceiverView(BELOW, fit_view(virtual, under, texels, boxes_ws=boxes), plane)
    return views


def points_under(instances: Iterable[Instance], plane: tuple[float, float, float, float]) -> FloatArray:
    """Points (N, 3) whose hull holds what lies on the positive side of a plane (a, b, c, d): vertices, and where edges
    cross it. Of a large floor that a tilted sheet's plane cuts, the vertices alone would leave out all but a corner.
    """
    parts = [np.zeros((0, 3))]
    for instance in instances:
        points = instance.positions_ws()
        side = points @ np.asarray(plane[:3]) + plane[3]
        parts.append(points[side > 0.0])
        edges = instance.mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
        a, b = edges[(side[edges] > 0.0).sum(axis=1) == 1].T
        along = (side[a] / (side[a] - side[b]))[:, None]
        parts.append(points[a] + along * (points[b] - points[a]))
    return np.concatenate(parts)


def light_below(interfaces: list[Instance], light: Light) -> tuple[Light, tuple[float, float, float, float] | None]:
    """The light as it comes through a nearly flat water surface, and the plane above which nothing receives it.

    Directional: refracted at the mean normal. Point and spot: the paraxial image of the lamp, n times as
    high above the surface (Hecht 2017, sec. 5.2). Surfaces that are not nearly one plane: the light itself, no plane.
    """
    points = points_of(interfaces)
    normal = unit(sum((_mean_normal(i) for i in interfaces), np.zeros(3)) + 1e-12)
    heights = points @ normal
    low, high = float(heights.min()), float(heights.max())
    if high - low > 0.25 * float(np.linalg.norm(np.ptp(points, axis=0))):
        return light, None
    if light.kind is LightKind.DIRECTIONAL:
        above = float(unit(light.direction_ws) @ normal) < 0.0
    else:
        height = float(np.asarray(light.position_ws) @ normal)
        above = height > high
        if low < height <= high:
            return light, None  # the lamp hangs among the waves
    ior = float(np.mean([i.material.ior for i in interfaces]))
    n, eta, edge = (normal, ior, high) if above else (-normal, 1.0 / ior, -low)
    plane = (-float(n[0]), -float(n[1]), -float(n[2]), edge)
    if light.kind is LightKind.DIRECTIONAL:
        return _refracted(light, n, eta), plane
    return _lifted(light, n, eta, edge), plane


def _refracted(light: Light, normal: FloatArray, eta: float) -> Light:
    """A directional light behind a plane; `eta`: index behind it over that before; `normal` against the light."""
    d = unit(light.direction_ws)
    cos_i = max(-float(d @ normal), 1e-3)
    k = 1.0 - (1.0 - cos_i * cos_i) / (eta * eta)
    if k <= 0.0:
        return light  # the mean surface reflects totally; waves may still let some through
    bent = d / eta + normal * (cos_i / eta - np.sqrt(k))
    return replace(light, direction_ws=(float(bent[0]), float(bent[1]), float(bent[2])))


def _lifted(light: Light, normal: FloatArray, eta: float, edge: float) -> Light:
    """A lamp's image as seen from behind the plane x . normal = edge."""
    position = np.asarray(light.position_ws, np.float64)
    height = float(position @ normal) - edge
    image = position + normal * (height * (eta - 1.0))
    # A spot's axis and cone bend too; a cone that is too wide costs texels, one that is too narrow would cost light.
    return replace(light, kind=LightKind.POINT, position_ws=(float(image[0]), float(image[1]), float(image[2])))


def _mean_normal(instance: Instance) -> FloatArray:
    """Area-weighted normal of an open surface, by its vertex normals' side, not of unit length."""
    points, triangles = instance.positions_ws(), instance.mesh.triangles.astype(np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.asarray(np.cross(b - a, c - a).sum(axis=0))
