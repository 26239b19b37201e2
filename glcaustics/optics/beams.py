"""Reference irradiance by brute force: even, jittered float64 beams through a height field on to a flat floor."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError
from glcaustics.optics.fresnel import fresnel_dielectric
from glcaustics.optics.pixels import bin_points, pixel_areas

FloatArray = npt.NDArray[np.float64]
BEAMS_PER_CHUNK = 1 << 18  # a chunk's dozen arrays stay in the cache of a small machine

# (wavelength m, direction deg, phase rad) of the pool that published implementations were measured on
PEER_POOL_WAVES = ((0.70, 20.0, 0.3), (0.45, 100.0, 1.7), (0.31, -35.0, 4.1), (0.23, 65.0, 2.2))


@dataclass(frozen=True)
class HeightField:
    """Water y(x, z) above its mean level, metres, and its gradient (dy/dx, dy/dz); both take arrays of one shape."""

    height_m: Callable[[FloatArray, FloatArray], FloatArray]
    gradient: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, eq=False)
class BeamImage:
    """Irradiance (Z, X) in W/m^2, and where the flux went, W: entered = landed + outside + reflected + lost.

    `flux_outside_w` landed beyond the image; `flux_reflected_w` did not pass the surface (or was absorbed);
    `flux_lost_w` belongs to beams that left the surface upwards.
    """

    irradiance: FloatArray
    flux_entered_w: float
    flux_landed_w: float
    flux_outside_w: float
    flux_reflected_w: float
    flux_lost_w: float


def sine_field(waves: Sequence[tuple[float, float, float, float]]) -> HeightField:
    """Sum of waves a sin(k_x x + k_z z + phase), each given as (a in m, k_x, k_z in 1/m, phase in rad)."""

    def height(x: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(sum(a * np.sin(kx * x + kz * z + phase) for a, kx, kz, phase in waves))

    def gradient(x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        slope_x, slope_z = np.zeros_like(x), np.zeros_like(z)
        for a, kx, kz, phase in waves:
            cosine = a * np.cos(kx * x + kz * z + phase)
            slope_x += kx * cosine
            slope_z += kz * cosine
        return slope_x, slope_z

    return HeightField(height, gradient)


def peer_pool_field(strength: float) -> HeightField:
    """The `peer-pool` water: four waves of amplitude 1.5 s / k^2; floor at y = -1, ior 1.333."""
    waves = []
    for wavelength_m, direction_deg, phase in PEER_POOL_WAVES:
        k = 2.0 * math.pi / wavelength_m
        angle = math.radians(direction_deg)
        waves.append((1.5 * strength / k**2, k * math.cos(angle), k * math.sin(angle), phase))
    return sine_field(waves)


def beam_irradiance(
    field: HeightField,
    *,
    light_direction_ws: npt.ArrayLike,
    depth_m: float,
    x_range_m: tuple[float, float],
    z_range_m: tuple[float, float],
    x_edges_m: FloatArray,
    z_edges_m: FloatArray,
    ior: float = 1.333,
    e_perp: float = 1.0,
    sigma_a_per_m: float = 0.0,
    fresnel: bool = True,
    beams_per_side: int = 2048,
    seed: int = 0,
) -> BeamImage:
    """Caustic irradiance of the floor y = -depth under a height field in directional light.

    One jittered beam in each cell of an even `beams_per_side`^2 grid over the water; its flux
    E_perp (-d . N) dx dz with N = (-dy/dx, 1, -dy/dz), times transmittance and absorption. Waves do not shade or
    refract a ray twice here.

    Args:
        light_direction_ws: (3,) direction that light travels along, normalised here.
        x_edges_m, z_edges_m: edges of an even pixel grid, (X + 1,) and (Z + 1,).
        fresnel: False leaves the transmittance out (as the published peers do).
        seed: of the jitter; two seeds give independent halves.

    Raises:
        UsageError: light that does not fall downwards.
    """
    light = np.asarray(light_direction_ws, np.float64)
    light = light / np.linalg.norm(light)
    if not light[1] < 0.0:
        raise UsageError(f"light direction {light} does not point down", where="beam_irradiance", remedy="give y < 0")
    n, generator = beams_per_side, np.random.default_rng(seed)
    size_x, size_z = (x_range_m[1] - x_range_m[0]) / n, (z_range_m[1] - z_range_m[0]) / n
    flux = np.zeros((x_edges_m.size - 1) * (z_edges_m.size - 1))
    entered = reflected = lost = arrived = 0.0
    for rows in np.array_split(np.arange(n), max(1, n * n // BEAMS_PER_CHUNK)):
        shape = (rows.size, n)
        x = x_range_m[0] + (np.arange(n)[None, :] + generator.random(shape)) * size_x
        z = z_range_m[0] + (rows[:, None] + generator.random(shape)) * size_z
        floor_x, floor_z, cell_flux, share, down = _trace(field, x, z, light, depth_m, ior, sigma_a_per_m, fresnel)
        cell_flux = cell_flux * (e_perp * size_x * size_z)
        passed = cell_flux * share
        entered += float(cell_flux.sum())
        reflected += float((cell_flux - passed).sum())
        lost += float(passed[~down].sum())
        arrived += float(passed[down].sum())
        flux += bin_points(floor_x[down], floor_z[down], passed[down], x_edges_m, z_edges_m)
    areas = pixel_areas(x_edges_m, z_edges_m)
    landed = float(flux.sum())
    return BeamImage(flux.reshape(areas.shape) / areas, entered, landed, arrived - landed, reflected, lost)


def _trace(
    field: HeightField,
    x: FloatArray,
    z: FloatArray,
    light: FloatArray,
    depth_m: float,
    ior: float,
    sigma_a: float,
    fresnel: bool,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Landing x, z; flux per unit E_perp and area (0 in shade); share that passes; whether the ray goes down."""
    slope_x, slope_z = field.gradient(x, z)
    facing = light[0] * slope_x - light[1] + light[2] * slope_z
    normal_y = 1.0 / np.sqrt(1.0 + slope_x**2 + slope_z**2)
    cell_flux = np.maximum(facing, 0.0)
    cos_i = cell_flux * normal_y
    cos_t = np.sqrt(1.0 - (1.0 - cos_i**2) / ior**2)
    along = (cos_i / ior - cos_t) * normal_y
    ray_x, ray_y, ray_z = light[0] / ior - along * slope_x, light[1] / ior + along, light[2] / ior - along * slope_z
    down = ray_y < 0.0
    length = (depth_m + field.height_m(x, z)) / np.where(down, -ray_y, 1.0)
    share = 1.0 - fresnel_dielectric(cos_i, 1.0, ior) if fresnel else np.ones_like(cos_i)
    if sigma_a > 0.0:
        share = share * np.exp(-sigma_a * np.maximum(length, 0.0))
    return x + length * ray_x, z + length * ray_z, cell_flux, share, down
