"""Lights with a size and rough surfaces for the reference beams: sums over points of the light and over microfacets.

A light with a size becomes many point or directional lights, each traced like any other; a rough surface is met once
for each of many samples, and one sample gives microfacets that vary smoothly over the surface, so that beams stay
beams. Both kinds of samples are low-discrepancy and shifted at random by the seed: two seeds are independent halves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError
from glcaustics.optics.beam_scene import BeamLight, BeamScene, SurfaceOptics

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class SizedBeamLight(BeamLight):
    """A sphere of `radius_m` with the same intensity in every direction, or an even disc of half the angle
    `angular_radius_rad` in the sky with the same irradiance on a plane across `direction_ws`; `points`: of the sum.
    """

    radius_m: float = 0.0
    angular_radius_rad: float = 0.0
    points: int = 256


@dataclass(frozen=True)
class LambertPoint(BeamLight):
    """A small piece of a glowing surface: intensity falls off with the cosine to `normal_ws`."""

    normal_ws: tuple[float, float, float] = (0.0, -1.0, 0.0)

    def cone(self, directions_ws: FloatArray) -> FloatArray:
        """The cosine (n,), 0 behind."""
        return np.asarray(np.maximum(directions_ws @ np.asarray(self.normal_ws), 0.0))


@dataclass(frozen=True)
class RoughOptics(SurfaceOptics):
    """`roughness`: as glTF has it, GGX of width roughness^2. `facets`: samples of the sum over microfacets."""

    roughness: float = 0.0
    facets: int = 256


@dataclass(frozen=True, eq=False)
class Facets:
    """One sample of the microfacets: `samples` (events, 2) in [0, 1), one row a specular event; `axis_ws`: a unit
    vector that frames turn about.
    """

    samples: FloatArray
    axis_ws: FloatArray


def spread(
    light: BeamLight, scene: BeamScene, specular_ws: FloatArray, max_events: int, seed: int
) -> Iterator[tuple[BeamLight, Facets | None]]:
    """The simple lights whose sum is `light`, each with a sample of microfacets if the scene has rough surfaces.

    Args:
        specular_ws: (n, 3) points whose hull holds the specular surfaces: parts of a sphere that none of them sees are
            left out.

    Raises:
        UsageError: a spot light with a radius.
    """
    generator = np.random.default_rng((seed, 77))
    parts = _parts(light, specular_ws, generator)
    rough = [o.facets for o in scene.optics() if isinstance(o, RoughOptics) and o.roughness > 0.0]
    if not rough:
        yield from ((part, None) for part in parts)
        return
    if len(parts) == 1:
        share = 1.0 / max(rough)
        parts = [replace(light, intensity_rgb=_times(light, share))] * max(rough)
    order = generator.permutation(len(parts))
    sequence = _sequence(len(parts), 2 * max_events, generator)
    axis = generator.normal(size=3)
    axis /= np.linalg.norm(axis)  # one for all: turned anew for each sample, the samples would no longer be even
    for row, k in enumerate(order):
        yield parts[k], Facets(sequence[row].reshape(max_events, 2), axis)


def _parts(light: BeamLight, specular_ws: FloatArray, generator: np.random.Generator) -> list[BeamLight]:
    if not isinstance(light, SizedBeamLight) or max(light.radius_m, light.angular_radius_rad) == 0.0:
        return [light]
    if light.position_ws is None:
        return _disc(light, generator)
    if light.outer_cone_rad is not None:
        raise UsageError("the beams know no spot light with a radius", where="SizedBeamLight", remedy="leave one out")
    return _sphere(light, specular_ws, generator)


def disc_parts(light: BeamLight, seed: int) -> list[BeamLight]:
    """The directional lights that stand for one with a disc; the light itself if it has none."""
    if not isinstance(light, SizedBeamLight) or light.angular_radius_rad == 0.0 or light.position_ws is not None:
        return [light]
    return _disc(light, np.random.default_rng((seed, 77)))


def _disc(light: SizedBeamLight, generator: np.random.Generator) -> list[BeamLight]:
    """Even over the disc as projected on a plane across its axis, so that each part's share of the irradiance there is
    the same; a part's own irradiance is that over the cosine.
    """
    axis = np.asarray(light.direction_ws, np.float64)
    axis /= np.linalg.norm(axis)
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    right = np.cross(helper, axis)
    right /= np.linalg.norm(right)
    up = np.cross(axis, right)
    u = _sequence(light.points, 2, generator)
    radius, angle = math.sin(light.angular_radius_rad) * np.sqrt(u[:, 0]), 2.0 * math.pi * u[:, 1]
    cosine = np.sqrt(1.0 - radius**2)
    across = np.cos(angle)[:, None] * right + np.sin(angle)[:, None] * up
    directions = cosine[:, None] * axis + radius[:, None] * across
    return [
        BeamLight(_times(light, 1.0 / (light.points * c)), (float(d[0]), float(d[1]), float(d[2])))
        for d, c in zip(directions, cosine, strict=True)
    ]


def _sphere(light: SizedBeamLight, specular_ws: FloatArray, generator: np.random.Generator) -> list[BeamLight]:
    """Pieces of equal area of a surface of radiance I / (pi r^2): 4 I / points each along its normal."""
    u = _sequence(light.points, 2, generator)
    z, angle = 2.0 * u[:, 0] - 1.0, 2.0 * math.pi * u[:, 1]
    ring = np.sqrt(1.0 - z**2)
    normals = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)
    normals = normals @ np.linalg.qr(generator.normal(size=(3, 3)))[0]
    positions = np.asarray(light.position_ws) + light.radius_m * normals
    parts: list[BeamLight] = []
    for position, normal in zip(positions, normals, strict=True):
        if float(((specular_ws - position) @ normal).max()) > 0.0:
            x, y, m = position.tolist(), normal.tolist(), _times(light, 4.0 / light.points)
            parts.append(LambertPoint(m, position_ws=(x[0], x[1], x[2]), normal_ws=(y[0], y[1], y[2])))
    return parts


def _times(light: BeamLight, factor: float) -> tuple[float, float, float]:
    r, g, b = (float(c) * factor for c in light.intensity_rgb)
    return r, g, b


def _sequence(count: int, dimensions: int, generator: np.random.Generator) -> FloatArray:
    """(count, dimensions) points of an R sequence (Roberts 2018), shifted at random (Cranley and Patterson 1976)."""
    root = 1.5
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (dimensions + 1))
    steps = root ** -np.arange(1.0, dimensions + 1.0)
    return np.asarray((np.arange(count)[:, None] * steps + generator.random(dimensions)) % 1.0)
