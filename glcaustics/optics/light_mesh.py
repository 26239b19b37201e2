"""The light mesh: a light's rays as a grid of triangles of exact flux, turned and shifted at random by a seed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from glcaustics.optics.beam_scene import BeamLight

FloatArray = npt.NDArray[np.float64]
MARGIN = 1.01
WIDEST_SINGLE_RAD = math.radians(60.0)


@dataclass(frozen=True, eq=False)
class LightPatch:
    """A rectangle of light coordinates (u, v). Directional: metres on a plane perpendicular to the light.

    Point or spot: gnomonic, direction = axis + u right + v up. `axes_ws`: rows right, up, axis (orthonormal).
    """

    light: BeamLight
    axes_ws: FloatArray
    origin_ws: FloatArray
    low_uv: FloatArray
    high_uv: FloatArray

    def rays(self, uv: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins and unit directions (n, 3) for light coordinates (n, 2)."""
        right, up, axis = self.axes_ws
        across = uv[:, :1] * right + uv[:, 1:] * up
        if self.light.position_ws is None:
            return self.origin_ws + across, np.tile(axis, (len(uv), 1))
        direction = across + axis
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        return np.tile(self.origin_ws, (len(uv), 1)), direction

    def flux(self, uv: FloatArray) -> FloatArray:
        """Flux of triangles (n, 3, 2) without colour, per unit intensity: area, or solid angle times cone fall-off."""
        a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
        area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        if self.light.position_ws is None:
            return np.asarray(area)
        # a gnomonic triangle's solid angle is exactly 2 atan(num / den) (Van Oosterom and Strackee 1983, eq. 8)
        p = np.concatenate([uv, np.ones((*uv.shape[:2], 1))], axis=2)
        norm = np.linalg.norm(p, axis=2)
        dots = [np.einsum("ij,ij->i", p[:, i], p[:, j]) * norm[:, k] for i, j, k in ((0, 1, 2), (0, 2, 1), (1, 2, 0))]
        solid_angle = 2.0 * np.arctan2(2.0 * area, norm.prod(axis=1) + sum(dots))
        cones = [self.light.cone(self.rays(uv[:, k])[1]) for k in range(3)]
        return np.asarray(solid_angle * sum(cones) / 3.0)


def light_patches(light: BeamLight, specular_ws: FloatArray, bounds_ws: FloatArray, seed: int) -> list[LightPatch]:
    """Patches that together hold every direction in which the light meets a specular surface.

    Args:
        specular_ws: (n, 3) points whose hull holds the specular surfaces. seed: of the turn and the shift.
        bounds_ws: (2, 3) of everything: directional light starts outside.
    """
    generator = np.random.default_rng(seed)
    turn = generator.uniform(0.0, 2.0 * math.pi)
    if light.position_ws is None:
        return [
            _fit(
                light,
                _turned(_frame(np.asarray(light.direction_ws, np.float64)), turn),
                specular_ws,
                bounds_ws,
                generator,
            )
        ]
    toward = specular_ws - np.asarray(light.position_ws)
    distance = np.linalg.norm(toward, axis=1, keepdims=True)
    unit = toward / np.maximum(distance, 1e-12)
    centre = unit.max(axis=0) + unit.min(axis=0)
    axis = centre / max(float(np.linalg.norm(centre)), 1e-12)
    # a hull can wrap round the light between its points; only clearly narrow bundles go through one patch
    if float((unit @ axis).min()) > math.cos(WIDEST_SINGLE_RAD):
        return [_fit(light, _turned(_frame(axis), turn), specular_ws, bounds_ws, generator)]
    cube = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    patches = []
    for face in range(6):
        axis = cube[face // 2] * (1.0 if face % 2 else -1.0)
        right = cube[(face // 2 + 1) % 3]
        axes = np.stack([right, np.cross(axis, right), axis])
        patches.append(LightPatch(light, axes, np.asarray(light.position_ws), np.full(2, -1.0), np.full(2, 1.0)))
    return patches


def _frame(axis: FloatArray) -> FloatArray:
    axis = axis / np.linalg.norm(axis)
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    right = np.cross(helper, axis)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(axis, right), axis])


def _turned(axes: FloatArray, angle: float) -> FloatArray:
    cosine, sine = math.cos(angle), math.sin(angle)
    right, up, axis = axes
    return np.stack([cosine * right + sine * up, cosine * up - sine * right, axis])


def _fit(
    light: BeamLight, axes: FloatArray, points: FloatArray, bounds_ws: FloatArray, generator: np.random.Generator
) -> LightPatch:
    """The rectangle around the points, a little larger on all sides by different random amounts."""
    if light.position_ws is None:
        corners = bounds_ws[np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T, [0, 1, 2]]
        along = corners @ axes[2]
        origin = axes[2] * (1.01 * along.min() - 0.01 * along.max())
        local = points @ axes[:2].T
        origin = origin + axes[:2].T @ (0.5 * (local.min(axis=0) + local.max(axis=0)))
        local = local - 0.5 * (local.min(axis=0) + local.max(axis=0))
    else:
        origin = np.asarray(light.position_ws, np.float64)
        local = (points - origin) @ axes.T
        local = local[:, :2] / local[:, 2:]
    size = local.max(axis=0) - local.min(axis=0)
    extra = size * (MARGIN - 1.0) * generator.uniform(0.5, 1.5, (2, 2))
    return LightPatch(light, axes, origin, local.min(axis=0) - extra[0], local.max(axis=0) + extra[1])
