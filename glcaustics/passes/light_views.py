"""What a light sees: one frustum, or six faces of a cube in a 3x2 atlas, and the uniforms that say so.

The GLSL side is `common/light_view.glsl`; `fit_view.py` makes the views.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from glcaustics.passes.view_math import unit
from glcaustics.scene.model import FloatArray, Light, LightKind

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
            x, y, z = unit(self.light.direction_ws)
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


def light_uniforms(light: Light) -> dict[str, Any]:
    """Uniforms of `interface/light.glsl`."""
    direction = unit(light.direction_ws)
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
