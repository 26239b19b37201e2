"""Closed form 3: water y = a cos(kx) over a flat floor under directional light."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError
from glcaustics.optics.beam_fan import BeamFan
from glcaustics.optics.fresnel import beer_lambert, transmittance_dielectric
from glcaustics.optics.pixels import interval_coverage

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class SineWater:
    """Water y = a cos(kx) for x in `x_range_m`, a flat floor at y = -depth, light along (sin t, -cos t, 0).

    The light map is x' = x + (depth + y) t_x / (-t_y) with t the refracted direction (Snell), and
    E(x') = sum over preimages of E_perp (cos t + y' sin t) T exp(-sigma_a s) / |dx'/dx|, s the length of the path in
    the water. All y are heights, y' the slope.
    """

    amplitude_m: float
    wavenumber_per_m: float
    depth_m: float
    ior: float = 1.333
    theta_rad: float = 0.0
    e_perp: float = 1.0
    sigma_a_per_m: float = 0.0
    x_range_m: tuple[float, float] = (-1.0, 1.0)

    def __post_init__(self) -> None:
        slope = abs(self.amplitude_m * self.wavenumber_per_m)
        if slope * abs(math.tan(self.theta_rad)) >= 1.0:
            raise UsageError(
                f"slope {slope:g} shades itself at {math.degrees(self.theta_rad):g} degrees",
                where="SineWater",
                remedy="lower the amplitude or the angle",
            )
        if self.depth_m <= abs(self.amplitude_m) or self.ior < 1.0:
            raise UsageError(
                f"depth {self.depth_m:g} m, amplitude {self.amplitude_m:g} m, ior {self.ior:g}",
                where="SineWater",
                remedy="the floor must lie below the troughs and the ior be 1 or more",
            )

    def _path(
        self, x: npt.NDArray[np.complexfloating] | FloatArray
    ) -> tuple[npt.NDArray[np.inexact], npt.NDArray[np.inexact], npt.NDArray[np.inexact]]:
        """Landing x', cosine of incidence and length in the water; analytic in x, for the complex step."""
        a, k = self.amplitude_m, self.wavenumber_per_m
        slope = -a * k * np.sin(k * x)
        normal_y = 1.0 / np.sqrt(1.0 + slope * slope)
        normal_x = -slope * normal_y
        light_x, light_y = math.sin(self.theta_rad), -math.cos(self.theta_rad)
        cos_i = -(light_x * normal_x + light_y * normal_y)
        cos_t = np.sqrt(1.0 - (1.0 - cos_i * cos_i) / self.ior**2)
        along = cos_i / self.ior - cos_t
        ray_x, ray_y = light_x / self.ior + along * normal_x, light_y / self.ior + along * normal_y
        length = (self.depth_m + a * np.cos(k * x)) / -ray_y
        return x + length * ray_x, cos_i, length

    def height_m(self, x: npt.ArrayLike) -> FloatArray:
        """Height of the surface above its mean."""
        return np.asarray(self.amplitude_m * np.cos(self.wavenumber_per_m * np.asarray(x, np.float64)))

    def slope(self, x: npt.ArrayLike) -> FloatArray:
        """dy/dx of the surface."""
        a, k = self.amplitude_m, self.wavenumber_per_m
        return np.asarray(-a * k * np.sin(k * np.asarray(x, np.float64)))

    def entering_per_m(self, x: FloatArray) -> FloatArray:
        """Flux that meets the surface, per metre of x and of z, W/m^2: E_perp (cos t + y' sin t)."""
        return np.asarray(self.e_perp * (math.cos(self.theta_rad) + math.sin(self.theta_rad) * self.slope(x)))

    def fan(self) -> BeamFan:
        """The family of beams, parameter x of the surface, flux per metre of z."""

        def flux_per_u(x: FloatArray) -> FloatArray:
            _, cos_i, length = self._path(x)
            share = transmittance_dielectric(np.real(cos_i), 1.0, self.ior)
            return self.entering_per_m(x) * share * beer_lambert(self.sigma_a_per_m, np.real(length))

        return BeamFan(lambda x: self._path(x)[0], flux_per_u, *self.x_range_m)

    def irradiance(self, x_m: npt.ArrayLike) -> FloatArray:
        """Irradiance at points of the floor, any shape, W/m^2; infinite right on a fold."""
        return self.fan().irradiance(x_m)

    def preimage_count(self, x_m: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """How many points of the surface send light to each point of the floor: 3 and more inside a fold."""
        landing = np.asarray(self.fan().landing_m(np.linspace(*self.x_range_m, 8193)), np.float64)
        at = np.asarray(x_m, np.float64)
        above = landing[None, :] > at.ravel()[:, None]
        return np.asarray((above[:, 1:] != above[:, :-1]).sum(axis=1).reshape(at.shape))

    def bin_irradiance(self, x_edges_m: FloatArray) -> FloatArray:
        """Irradiance averaged over bins of the floor, (B,), W/m^2; exact to 1e-5 and better."""
        return self.fan().bin_flux(x_edges_m) / np.diff(x_edges_m)

    def pixel_irradiance(
        self, x_edges_m: FloatArray, z_edges_m: FloatArray, z_range_m: tuple[float, float]
    ) -> FloatArray:
        """The same on pixels (Z, X), for water that ends at `z_range_m` (rays stay in their plane of constant z)."""
        return np.outer(interval_coverage(z_edges_m, *z_range_m), self.bin_irradiance(x_edges_m))

    def flux_per_m(self) -> float:
        """Flux that reaches the floor, per metre of z: entered flux times transmittance."""
        return self.fan().total_flux()
