"""Closed form 5: the nephroid on the floor inside a cylindrical mirror."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError
from glcaustics.optics.pixels import bin_points, pixel_areas

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class MirrorCylinder:
    """Wall x = R cos p, z = R sin p for |p| <= `azimuth_max_rad`, from the floor up to the height H = s_max tan(b).

    Light travels along (cos b, -sin b, 0) and meets the inside of the wall. A ray that meets it at azimuth p and
    height h is mirrored once, and lands s = h / tan(b) further on (horizontally):
    x = R cos p - s cos 2p, z = R sin p - s sin 2p; the Jacobian |d(x, z)/d(p, s)| is |R cos p - 2 s|, so
    E = sum over preimages of E_perp sin(b) rho R cos p / |R cos p - 2 s|. The envelope s = R cos(p) / 2 is the nephroid
    with its cusp at (R/2, 0) (Lock and Andrews 1992; Huygens 1690). The chord to the second meeting with the circle
    is 2 R cos p, so s_max below 2 R cos(azimuth_max) leaves out every second reflection.
    """

    radius_m: float
    elevation_rad: float
    s_max_m: float
    azimuth_max_rad: float = math.pi / 3
    e_perp: float = 1.0
    reflectance: float = 1.0

    def __post_init__(self) -> None:
        chord_m = 2.0 * self.radius_m * math.cos(self.azimuth_max_rad)
        if not 0.0 < self.s_max_m < chord_m or not 0.0 < self.elevation_rad < math.pi / 2:
            raise UsageError(
                f"s_max {self.s_max_m:g} m, shortest chord {chord_m:g} m, elevation {self.elevation_rad:g} rad",
                where="MirrorCylinder",
                remedy="keep s_max below the chord, and the elevation between 0 and pi/2",
            )

    @property
    def height_m(self) -> float:
        """Height of the wall, s_max tan(b)."""
        return self.s_max_m * math.tan(self.elevation_rad)

    @property
    def cusp_m(self) -> tuple[float, float]:
        """Where the nephroid has its cusp, (x, z)."""
        return 0.5 * self.radius_m, 0.0

    def landing_m(self, azimuth_rad: npt.ArrayLike, s_m: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Where a ray lands, (x, z), from the azimuth of the wall and the horizontal way s."""
        p, s = np.asarray(azimuth_rad, np.float64), np.asarray(s_m, np.float64)
        r = self.radius_m
        return np.asarray(r * np.cos(p) - s * np.cos(2 * p)), np.asarray(r * np.sin(p) - s * np.sin(2 * p))

    def flux(self) -> float:
        """Flux that the wall throws on the floor: E_perp cos(b) rho H 2 R sin(azimuth_max)."""
        width_m = 2.0 * self.radius_m * math.sin(self.azimuth_max_rad)
        return self.e_perp * self.reflectance * math.cos(self.elevation_rad) * self.height_m * width_m

    def _azimuth_residual(self, p: FloatArray, x: FloatArray, z: FloatArray) -> FloatArray:
        """Zero where (x, z) lies on the line of the ray mirrored at azimuth p."""
        r = self.radius_m
        return np.asarray((r * np.cos(p) - x) * np.sin(2 * p) - (r * np.sin(p) - z) * np.cos(2 * p))

    def irradiance(self, x_m: npt.ArrayLike, z_m: npt.ArrayLike, intervals: int = 2000) -> FloatArray:
        """Irradiance at points of the floor, broadcast shape, W/m^2; infinite right on the nephroid."""
        x, z = np.broadcast_arrays(np.asarray(x_m, np.float64), np.asarray(z_m, np.float64))
        flat_x, flat_z, r = x.ravel(), z.ravel(), self.radius_m
        p = np.linspace(-self.azimuth_max_rad, self.azimuth_max_rad, intervals + 1)
        total = np.zeros(flat_x.size)
        for start in range(0, flat_x.size, 4096):
            cx, cz = flat_x[start : start + 4096], flat_z[start : start + 4096]
            positive = self._azimuth_residual(p[None, :], cx[:, None], cz[:, None]) > 0.0
            query, interval = np.nonzero(positive[:, 1:] != positive[:, :-1])
            low, high, low_positive = p[interval], p[interval + 1], positive[query, interval]
            for _ in range(60):
                middle = 0.5 * (low + high)
                same = (self._azimuth_residual(middle, cx[query], cz[query]) > 0.0) == low_positive
                low, high = np.where(same, middle, low), np.where(same, high, middle)
            root = 0.5 * (low + high)
            s = (r * np.cos(root) - cx[query]) * np.cos(2 * root) + (r * np.sin(root) - cz[query]) * np.sin(2 * root)
            density = r * np.cos(root) / np.abs(r * np.cos(root) - 2.0 * s)
            lit = (s >= 0.0) & (s <= self.s_max_m)
            total[start : start + 4096] += np.bincount(query, np.where(lit, density, 0.0), minlength=cx.size)
        return (self.e_perp * math.sin(self.elevation_rad) * self.reflectance * total).reshape(x.shape)

    def pixel_irradiance(self, x_edges_m: FloatArray, z_edges_m: FloatArray, beams_per_side: int = 4096) -> FloatArray:
        """Irradiance averaged over pixels (Z, X) of the floor, W/m^2, by `beams_per_side`^2 even float64 beams.

        Equal azimuths, each with its own shift along s (golden ratio), so that no moire forms with the pixels.
        """
        n = beams_per_side
        step = 2.0 * self.azimuth_max_rad / n
        azimuth = -self.azimuth_max_rad + (np.arange(n) + 0.5) * step
        shift = (np.arange(n) * 0.5 * (math.sqrt(5.0) - 1.0)) % 1.0
        weight = np.sin(azimuth + 0.5 * step) - np.sin(azimuth - 0.5 * step)
        weight *= self.flux() / (weight.sum() * n)
        flux = np.zeros((z_edges_m.size - 1) * (x_edges_m.size - 1))
        for rows in np.array_split(np.arange(n), max(1, n * n // (1 << 20))):
            s = self.s_max_m * (np.arange(n)[None, :] + shift[rows, None]) / n
            x, z = self.landing_m(azimuth[rows, None], s)
            flux += bin_points(x, z, np.broadcast_to(weight[rows, None], x.shape), x_edges_m, z_edges_m)
        areas = pixel_areas(x_edges_m, z_edges_m)
        return flux.reshape(areas.shape) / areas
