"""Views from a light, fitted to the points that matter: one frustum, or six faces of a cube in a 3x2 atlas.

The GLSL side is `common/light_view.glsl`. A directional light gets an orthographic view, turned about the light's
direction so that its rectangle is smallest; a point or spot light gets an off-centre perspective frustum, or a cube
where one frustum cannot hold the points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from glcaustics.scene.model import FloatArray, Light, LightKind

MAX_TANGENT = (
    2.2  # widest half angle of a single frustum, 65 degrees: beyond, a texel at the rim is a tenth of one at the axis
)
CUBE_FORWARD = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)
CUBE_UP = np.array([[0, 1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1], [0, 1, 0], [0, 1, 0]], np.float64)


@dataclass(frozen=True, eq=False)
class LightView:
    """A fitted view. `size`: texels (width, height) of the texture, of the whole atlas for a cube.

    `matrices`: clip-from-world, column-vector form, one a face. `texel_measure`: m^2 (directional) or the tangent-plane
    area of a texel at unit distance. `near_m`, `far_m`: along the light's direction from the world's origin
    (directional), or from the light. `rect`: the window (x0, x1, y0, y1) along `right` and `up`: metres (directional)
    or tangents.
    """

    light: Light
    faces: int
    size: tuple[int, int]
    matrices: tuple[FloatArray, ...]
    texel_measure: float
    forward_ws: FloatArray
    right_ws: FloatArray
    up_ws: FloatArray
    rect: tuple[float, float, float, float]
    near_m: float
    far_m: float

    @property
    def light_vec4(self) -> tuple[float, float, float, float]:
        """What the shaders call `light`: direction of travel with w = 0, or position with w = 1."""
        if self.light.kind is LightKind.DIRECTIONAL:
            x, y, z = unit(np.asarray(self.light.direction_ws, np.float64))
            return float(x), float(y), float(z), 0.0
        x, y, z = self.light.position_ws
        return float(x), float(y), float(z), 1.0

    def forward_of(self, face: int) -> FloatArray:
        """Axis of a face."""
        return self.forward_ws if self.faces == 1 else np.asarray(CUBE_FORWARD[face])

    def uniforms(self, prefix: str) -> dict[str, Any]:
        """Uniforms of `interface/<prefix>_view.glsl`."""
        return {
            f"u_{prefix}_clip_from_world": self.matrices[0],
            f"u_{prefix}_size": (float(self.size[0]), float(self.size[1])),
            f"u_{prefix}_texel_measure": self.texel_measure,
            f"u_{prefix}_forward_ws": tuple(self.forward_ws),
            f"u_{prefix}_light": self.light_vec4,
        }

    def raster_from_world(self, face: int = 0) -> FloatArray:
        """(4, 4) column-vector form: world to X, Y, S, W with texel = XY / W of the whole texture and s = S / W.

        s is the affine depth of `common/raster_ray.glsl`: 1 / depth; directional: minus the depth behind near_m.
        """
        x0, y0, width, height = self.viewports()[face]
        m = np.asarray(self.matrices[face], np.float64)
        x, y = (0.5 * n * (m[k] + m[3]) + at * m[3] for k, n, at in ((0, width, x0), (1, height, y0)))
        s = np.array([0.0, 0.0, 0.0, 1.0])
        if self.light.kind is LightKind.DIRECTIONAL:
            s = np.array([*(-self.forward_ws), self.near_m])
        return np.stack([x, y, s, m[3]])

    def viewports(self) -> list[tuple[int, int, int, int]]:
        """Viewport (x, y, width, height) of each face."""
        if self.faces == 1:
            return [(0, 0, *self.size)]
        w, h = self.size[0] // 3, self.size[1] // 2
        return [((i % 3) * w, (i // 3) * h, w, h) for i in range(6)]


def unit(v: FloatArray) -> FloatArray:
    """v / |v|; v (3,) must not be zero."""
    return v / np.linalg.norm(v)


def basis(forward: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A right and an up axis for a forward axis, so that right x up = -forward."""
    helper = np.array([0.0, 0.0, -1.0]) if abs(forward[1]) > 0.9 else np.array([0.0, 1.0, 0.0])
    right = unit(np.cross(forward, helper))
    return right, np.cross(right, forward)


def fit_size(texels: int, aspect: float) -> tuple[int, int]:
    """Width and height, multiples of 8, with about `texels`^2 texels and the aspect ratio width / height."""
    aspect = min(max(aspect, 0.125), 8.0)
    w = max(8, round(texels * math.sqrt(aspect) / 8) * 8)
    return w, max(8, round(texels / math.sqrt(aspect) / 8) * 8)


def _affine(right: FloatArray, up: FloatArray, forward: FloatArray, origin: FloatArray) -> FloatArray:
    m = np.eye(4)
    m[0, :3], m[1, :3], m[2, :3] = right, up, -forward
    m[:3, 3] = -m[:3, :3] @ origin
    return m


def orthographic(x0: float, x1: float, y0: float, y1: float, near: float, far: float) -> FloatArray:
    """Clip-from-view matrix of an orthographic window; near and far are distances along -Z."""
    m = np.eye(4)
    m[0, 0], m[1, 1], m[2, 2] = 2 / (x1 - x0), 2 / (y1 - y0), -2 / (far - near)
    m[0, 3], m[1, 3], m[2, 3] = -(x1 + x0) / (x1 - x0), -(y1 + y0) / (y1 - y0), -(far + near) / (far - near)
    return m


def perspective(x0: float, x1: float, y0: float, y1: float, near: float, far: float) -> FloatArray:
    """Clip-from-view matrix of an off-centre perspective window given in tangents."""
    m = np.zeros((4, 4))
    m[0, 0], m[0, 2] = 2 / (x1 - x0), (x1 + x0) / (x1 - x0)
    m[1, 1], m[1, 2] = 2 / (y1 - y0), (y1 + y0) / (y1 - y0)
    m[2, 2], m[2, 3] = -(far + near) / (far - near), -2 * far * near / (far - near)
    m[3, 2] = -1
    return m


def _grow(rect: FloatArray, size: tuple[int, int], border_texels: float) -> tuple[float, float, float, float]:
    """The window (x0, x1, y0, y1) with a border of some texels, widened to the aspect ratio of the texture."""
    x0, x1, y0, y1 = (float(v) for v in rect)
    largest = max(x1 - x0, y1 - y0, 1e-30)
    w, h = max(x1 - x0, 1e-3 * largest), max(y1 - y0, 1e-3 * largest)
    texel = max(w / max(size[0] - 2 * border_texels, 1), h / max(size[1] - 2 * border_texels, 1))
    cx, cy = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    w, h = 0.5 * texel * size[0], 0.5 * texel * size[1]
    return cx - w, cx + w, cy - h, cy + h


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


def fit_view(
    light: Light,
    points_ws: FloatArray,
    texels: int,
    *,
    depth_points_ws: FloatArray | None = None,
    size: tuple[int, int] | None = None,
    border_texels: float = 2.0,
    boxes_ws: FloatArray | None = None,
) -> LightView:
    """The tightest view of a light that holds all points.

    Args:
        points_ws: (N, 3) float64, metres; what the window must hold.
        texels: the texture has about `texels`^2 texels.
        depth_points_ws: (M, 3); what the depth range must hold, if more than the points (occluders).
        size: fixes the texture's size, else it follows the aspect ratio of the window.
        boxes_ws: (N, 2, 3), a box an object: how near to a lamp surfaces come. Their vertices do not tell: those of a
            large ground are all far away.
    """
    depths_ws = points_ws if depth_points_ws is None else depth_points_ws
    if light.kind is LightKind.DIRECTIONAL:
        return _fit_directional(light, points_ws, texels, depths_ws, size, border_texels)
    nearest = None if boxes_ws is None or len(boxes_ws) == 0 else nearest_box_m(np.asarray(light.position_ws), boxes_ws)
    view = _fit_frustum(light, points_ws, texels, depths_ws, size, border_texels, nearest)
    return view if view is not None else cube_view(light, texels, depths_ws, nearest)


def nearest_box_m(position_ws: FloatArray, boxes_ws: FloatArray) -> float:
    """Least distance from a point to what is in some boxes (N, 2, 3), metres; within one, 1e-3 of its diagonal."""
    low, high = boxes_ws[:, 0], boxes_ws[:, 1]
    away = np.linalg.norm(np.maximum(np.maximum(low - position_ws, position_ws - high), 0.0), axis=1)
    return float(np.maximum(away, 1e-3 * np.linalg.norm(high - low, axis=1) * (away == 0.0)).min())


def _fit_directional(
    light: Light, points: FloatArray, texels: int, depths: FloatArray, size: tuple[int, int] | None, border: float
) -> LightView:
    forward = unit(np.asarray(light.direction_ws, np.float64))
    right, up = basis(forward)
    turn = best_turn(points @ right, points @ up)
    right, up = math.cos(turn) * right + math.sin(turn) * up, math.cos(turn) * up - math.sin(turn) * right
    origin = 0.5 * (points.min(axis=0) + points.max(axis=0))
    u, v = (points - origin) @ right, (points - origin) @ up
    extent_u, extent_v = float(np.ptp(u)), float(np.ptp(v))
    if size is None:
        size = fit_size(texels, extent_u / max(extent_v, 1e-30))
    rect = _grow(np.array([u.min(), u.max(), v.min(), v.max()]), size, border)
    near, far = depth_range((depths - origin) @ forward, _extent(depths), positional=False)
    matrix = orthographic(*rect, near, far) @ _affine(right, up, forward, origin)
    measure = (rect[1] - rect[0]) * (rect[3] - rect[2]) / (size[0] * size[1])
    along = float(origin @ forward)
    return LightView(light, 1, size, (matrix,), measure, forward, right, up, rect, near + along, far + along)


def _fit_frustum(
    light: Light,
    points: FloatArray,
    texels: int,
    depths: FloatArray,
    size: tuple[int, int] | None,
    border: float,
    nearest_m: float | None,
) -> LightView | None:
    position = np.asarray(light.position_ws, np.float64)
    cone = math.tan(light.outer_cone_rad) if light.kind is LightKind.SPOT and light.outer_cone_rad < 1.5 else math.inf
    is_narrow_spot = cone <= MAX_TANGENT
    forward = unit(np.asarray(light.direction_ws, np.float64)) if is_narrow_spot else light_axis(light, points)
    right, up = basis(forward)
    d = points - position
    z = d @ forward
    if is_narrow_spot:  # nothing outside of its cone is lit
        ahead = z > 1e-6 * np.abs(z).max(initial=1e-30)
        if not ahead.any():
            ahead = np.ones_like(z, bool)
        z, d = np.maximum(z[ahead], 1e-30), d[ahead]
    elif float(z.min()) <= 1e-4 * float(np.abs(z).max()):
        return None
    u, v = (d @ right) / z, (d @ up) / z
    if is_narrow_spot:
        u, v = np.clip(u, -cone, cone), np.clip(v, -cone, cone)
    elif max(float(np.abs(u).max()), float(np.abs(v).max())) > MAX_TANGENT:
        return None
    if size is None:
        size = fit_size(texels, float(np.ptp(u)) / max(float(np.ptp(v)), 1e-30))
    rect = _grow(np.array([u.min(), u.max(), v.min(), v.max()]), size, border)
    along = (depths - position) @ forward
    near, far = depth_range(along, _extent(depths), positional=True)
    if nearest_m is not None and float(along.min()) < near:  # some points stand beside or behind the light
        rim = math.sqrt(1.0 + max(rect[0] ** 2, rect[1] ** 2) + max(rect[2] ** 2, rect[3] ** 2))
        near = min(near, max(0.999 * nearest_m / rim, 1e-7 * far))
    matrix = perspective(*rect, near, far) @ _affine(right, up, forward, position)
    measure = (rect[1] - rect[0]) * (rect[3] - rect[2]) / (size[0] * size[1])
    return LightView(light, 1, size, (matrix,), measure, forward, right, up, rect, near, far)


def cube_view(light: Light, texels: int, depths_ws: FloatArray, nearest_m: float | None = None) -> LightView:
    """Six 90-degree faces in a 3x2 atlas with about `texels`^2 texels."""
    tile = max(16, round(texels / math.sqrt(6.0) / 8) * 8)
    position = np.asarray(light.position_ws, np.float64)
    far = float(np.linalg.norm(depths_ws - position, axis=1).max()) * 1.01
    near = 1e-3 * far if nearest_m is None else min(max(0.999 * nearest_m / math.sqrt(3.0), 1e-7 * far), 0.5 * far)
    projection = perspective(-1, 1, -1, 1, near, far)
    matrices = tuple(
        projection @ _affine(np.cross(f, up), up, f, position) for f, up in zip(CUBE_FORWARD, CUBE_UP, strict=True)
    )
    right, up = basis(CUBE_FORWARD[3])
    size = (3 * tile, 2 * tile)
    return LightView(
        light, 6, size, matrices, 4.0 / (tile * tile), CUBE_FORWARD[3], right, up, (-1.0, 1.0, -1.0, 1.0), near, far
    )


def light_uniforms(light: Light) -> dict[str, Any]:
    """Uniforms of `interface/light.glsl`."""
    direction = unit(np.asarray(light.direction_ws, np.float64))
    intensity = np.asarray(light.color, np.float64) * light.intensity
    is_directional = light.kind is LightKind.DIRECTIONAL
    cone = (0.0, 1.0)
    if light.kind is LightKind.SPOT:  # glTF: saturate(cos * scale + offset)^2
        scale = 1.0 / max(1e-3, math.cos(light.inner_cone_rad) - math.cos(light.outer_cone_rad))
        cone = (scale, -math.cos(light.outer_cone_rad) * scale)
    size = math.sin(0.5 * light.angular_diameter_rad) if is_directional else light.radius_m
    xyz = direction if is_directional else np.asarray(light.position_ws, np.float64)
    return {
        "u_light": (float(xyz[0]), float(xyz[1]), float(xyz[2]), 0.0 if is_directional else 1.0),
        "u_light_intensity": tuple(float(c) for c in intensity),
        "u_light_axis_ws": tuple(float(c) for c in direction),
        "u_light_cone": cone,
        "u_light_size": size,
    }
