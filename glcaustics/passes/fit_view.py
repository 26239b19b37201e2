"""Light views fitted to the points that matter.

A directional light gets an orthographic view, turned about the light's direction so that its rectangle is smallest; a
point or spot light gets an off-centre perspective frustum, or a cube where one frustum cannot hold the points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from glcaustics.passes.light_views import CUBE_FORWARD, CUBE_UP, LightView
from glcaustics.passes.view_math import basis, orthographic, perspective, unit, view_from_world
from glcaustics.scene.model import FloatArray, Light, LightKind

# Widest half angle of a single frustum, 65 degrees: beyond, a texel at the rim is a tenth of one at the axis.
MAX_TANGENT = 2.2


@dataclass(frozen=True, eq=False)
class _Wanted:
    """What a view has to hold, (N, 3) and (M, 3) in metres, and its raster: about `texels`^2 texels with a border."""

    points_ws: FloatArray
    depths_ws: FloatArray
    texels: int
    border_texels: float

    def window(self, u: FloatArray, v: FloatArray) -> tuple[tuple[int, int], tuple[float, float, float, float]]:
        """The texture's size, and the window (x0, x1, y0, y1) around the points' places along the view's axes."""
        size = fit_size(self.texels, float(np.ptp(u)) / max(float(np.ptp(v)), 1e-30))
        return size, _grow(np.array([u.min(), u.max(), v.min(), v.max()]), size, self.border_texels)


def fit_view(
    light: Light,
    points_ws: FloatArray,
    texels: int,
    *,
    depth_points_ws: FloatArray | None = None,
    border_texels: float = 2.0,
    boxes_ws: FloatArray | None = None,
) -> LightView:
    """The tightest view of a light that holds all points.

    Args:
        points_ws: (N, 3) float64, metres; what the window must hold.
        texels: the texture has about `texels`^2 texels.
        depth_points_ws: (M, 3); what the depth range must hold, if more than the points (occluders).
        boxes_ws: (N, 2, 3), a box an object: how near to a lamp surfaces come. Their vertices do not tell: those of a
            large ground are all far away.
    """
    wanted = _Wanted(points_ws, points_ws if depth_points_ws is None else depth_points_ws, texels, border_texels)
    if light.kind is LightKind.DIRECTIONAL:
        return _fit_directional(light, wanted)
    nearest = None if boxes_ws is None or len(boxes_ws) == 0 else nearest_box_m(np.asarray(light.position_ws), boxes_ws)
    view = _fit_frustum(light, wanted, nearest)
    return view if view is not None else cube_view(light, texels, wanted.depths_ws, nearest)


def _fit_directional(light: Light, wanted: _Wanted) -> LightView:
    points = wanted.points_ws
    forward = unit(light.direction_ws)
    right, up = basis(forward)
    turn = best_turn(points @ right, points @ up)
    right, up = math.cos(turn) * right + math.sin(turn) * up, math.cos(turn) * up - math.sin(turn) * right
    origin = 0.5 * (points.min(axis=0) + points.max(axis=0))
    size, rect = wanted.window((points - origin) @ right, (points - origin) @ up)
    depths = (wanted.depths_ws - origin) @ forward
    near, far = depth_range(depths, _extent(wanted.depths_ws), positional=False)
    matrix = orthographic(*rect, near, far) @ view_from_world(right, up, forward, origin)
    along = float(origin @ forward)
    return LightView(
        light, 1, size, (matrix,), _texel_measure(rect, size), forward, right, up, rect, near + along, far + along
    )


def _fit_frustum(light: Light, wanted: _Wanted, nearest_m: float | None) -> LightView | None:
    """None where one frustum cannot hold the points. `nearest_m`: how near surfaces come, if that is known."""
    position = np.asarray(light.position_ws, np.float64)
    cone = math.tan(light.outer_cone_rad) if light.kind is LightKind.SPOT and light.outer_cone_rad < 1.5 else math.inf
    points = wanted.points_ws
    forward = unit(light.direction_ws) if cone <= MAX_TANGENT else light_axis(light, points)
    right, up = basis(forward)
    tangents = _tangents(points - position, right, up, forward, cone)
    if tangents is None:
        return None
    size, rect = wanted.window(*tangents)
    along = (wanted.depths_ws - position) @ forward
    near, far = depth_range(along, _extent(wanted.depths_ws), positional=True)
    if nearest_m is not None and float(along.min()) < near:  # some points stand beside or behind the light
        rim = math.sqrt(1.0 + max(rect[0] ** 2, rect[1] ** 2) + max(rect[2] ** 2, rect[3] ** 2))
        near = min(near, max(0.999 * nearest_m / rim, 1e-7 * far))
    matrix = perspective(*rect, near, far) @ view_from_world(right, up, forward, position)
    return LightView(light, 1, size, (matrix,), _texel_measure(rect, size), forward, right, up, rect, near, far)


def _tangents(
    d: FloatArray, right: FloatArray, up: FloatArray, forward: FloatArray, cone: float
) -> tuple[FloatArray, FloatArray] | None:
    """Where points `d` (N, 3) from the light lie in its view, in tangents; None where some are too far off its axis.

    `cone`: tangent of a spot's outer cone, else infinite. Nothing outside of a narrow spot's cone is lit, so it holds
    any points.
    """
    z = d @ forward
    is_narrow_spot = cone <= MAX_TANGENT
    if is_narrow_spot:
        ahead = z > 1e-6 * np.abs(z).max(initial=1e-30)
        if not ahead.any():
            ahead = np.ones_like(z, bool)
        z, d = np.maximum(z[ahead], 1e-30), d[ahead]
    elif float(z.min()) <= 1e-4 * float(np.abs(z).max()):
        return None
    u, v = (d @ right) / z, (d @ up) / z
    if is_narrow_spot:
        return np.clip(u, -cone, cone), np.clip(v, -cone, cone)
    return None if max(float(np.abs(u).max()), float(np.abs(v).max())) > MAX_TANGENT else (u, v)


def cube_view(light: Light, texels: int, depths_ws: FloatArray, nearest_m: float | None = None) -> LightView:
    """Six 90-degree faces in a 3x2 atlas with about `texels`^2 texels."""
    tile = max(16, round(texels / math.sqrt(6.0) / 8) * 8)
    position = np.asarray(light.position_ws, np.float64)
    far = float(np.linalg.norm(depths_ws - position, axis=1).max()) * 1.01
    near = 1e-3 * far if nearest_m is None else min(max(0.999 * nearest_m / math.sqrt(3.0), 1e-7 * far), 0.5 * far)
    projection = perspective(-1, 1, -1, 1, near, far)
    axes = zip(CUBE_FORWARD, CUBE_UP, strict=True)
    matrices = tuple(projection @ view_from_world(np.cross(f, up), up, f, position) for f, up in axes)
    right, up = basis(CUBE_FORWARD[3])
    size = (3 * tile, 2 * tile)
    return LightView(
        light, 6, size, matrices, 4.0 / (tile * tile), CUBE_FORWARD[3], right, up, (-1.0, 1.0, -1.0, 1.0), near, far
    )


def fit_size(texels: int, aspect: float) -> tuple[int, int]:
    """Width and height, multiples of 8, with about `texels`^2 texels and the aspect ratio width / height."""
    aspect = min(max(aspect, 0.125), 8.0)
    w = max(8, round(texels * math.sqrt(aspect) / 8) * 8)
    return w, max(8, round(texels / math.sqrt(aspect) / 8) * 8)


def _grow(rect: FloatArray, size: tuple[int, int], border_texels: float) -> tuple[float, float, float, float]:
    """The window (x0, x1, y0, y1) with a border of some texels, widened to the aspect ratio of the texture."""
    x0, x1, y0, y1 = (float(v) for v in rect)
    largest = max(x1 - x0, y1 - y0, 1e-30)
    w, h = max(x1 - x0, 1e-3 * largest), max(y1 - y0, 1e-3 * largest)
    texel = max(w / max(size[0] - 2 * border_texels, 1), h / max(size[1] - 2 * border_texels, 1))
    cx, cy = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    w, h = 0.5 * texel * size[0], 0.5 * texel * size[1]
    return cx - w, cx + w, cy - h, cy + h


def _texel_measure(rect: tuple[float, float, float, float], size: tuple[int, int]) -> float:
    """`LightView.texel_measure` of a window (x0, x1, y0, y1)."""
    return (rect[1] - rect[0]) * (rect[3] - rect[2]) / (size[0] * size[1])


def best_turn(u: FloatArray, v: FloatArray) -> float:
    """Angle in [0, pi/2) by which axes have to be turned so that the bounding rectangle of (u, v) is smallest."""
    step = max(1, len(u) // 4000)
    u, v = u[::step], v[::step]
    best_angle, best_area = 0.0, math.inf
    for angle in np.radians(np.arange(0.0, 90.0, 3.0)):
        c, s = math.cos(angle), math.sin(angle)
        area = float(np.ptp(c * u + s * v) * np.ptp(c * v - s * u))
        if area < best_area * 0.999:
            best_angle, best_area = float(angle), area
    return best_angle


def light_axis(light: Light, points_ws: FloatArray) -> FloatArray:
    """The middle direction in which a positional light sees the points."""
    d = points_ws - np.asarray(light.position_ws, np.float64)
    length = np.linalg.norm(d, axis=1, keepdims=True)
    d = d / np.maximum(length, 1e-30)
    lo, hi = d.min(axis=0), d.max(axis=0)
    middle = 0.5 * (lo + hi)
    if np.linalg.norm(middle) > 1e-3:
        return unit(middle)
    return np.array([0.0, -1.0, 0.0])


def depth_range(depths: FloatArray, extent_m: float, *, positional: bool) -> tuple[float, float]:
    """Near and far plane with some air around the depths, in proportion to the scene's extent, so that scale does not
    matter.
    """
    lo, hi = float(np.min(depths)), float(np.max(depths))
    air = max(0.01 * (hi - lo), 1e-3 * extent_m, 1e-6 * abs(hi), 1e-30)  # the third: all points in one place
    if positional:
        far = max(hi, 1e-30) + air
        return max(lo - air, 2e-4 * far), far
    return lo - air, hi + air


def _extent(points: FloatArray) -> float:
    """Diagonal of the points' box, metres."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def nearest_box_m(position_ws: FloatArray, boxes_ws: FloatArray) -> float:
    """Least distance from a point to what is in some boxes (N, 2, 3), metres; within one, 1e-3 of its diagonal."""
    low, high = boxes_ws[:, 0], boxes_ws[:, 1]
    away = np.linalg.norm(np.maximum(np.maximum(low - position_ws, position_ws - high), 0.0), axis=1)
    return float(np.maximum(away, 1e-3 * np.linalg.norm(high - low, axis=1) * (away == 0.0)).min())
