"""Closed form 4: a sphere of glass over a floor, in parallel light that falls straight down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError
from glcaustics.optics.beam_fan import BeamFan
from glcaustics.optics.fresnel import beer_lambert, fresnel_dielectric
from glcaustics.optics.pixels import radial_to_pixels

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GlassSphere:
    """Sphere of radius R centred `centre_height_m` above a floor, light (0, -1, 0).

    A ray that meets the sphere at the angle t_i (impact parameter R sin t_i) is refracted to t_t and leaves after p
    chords at the polar angle a_p = t_i + p (pi - 2 t_t) from +y, in the direction d_p = a_p + t_i
    (van de Hulst 1957, section 12.2). Order p = 1 is the light that passes through both interfaces, 0 the light
    reflected by the outside, 2 and more have bounced inside. It lands at the signed radius
    r = R sin a_p - (h + R cos a_p) tan d_p, with the flux E_perp pi R^2 sin(2 t_i) dt_i, times R(t_i) for p = 0, and
    (1 - R)^2 R^(p-1) exp(-sigma_a 2 R cos t_t p) for p >= 1.
    """

    radius_m: float
    centre_height_m: float
    ior: float = 1.5
    e_perp: float = 1.0
    sigma_a_per_m: float = 0.0
    order: int = 1

    def __post_init__(self) -> None:
        if self.ior < 1.0 or self.radius_m <= 0.0 or self.centre_height_m < self.radius_m or self.order < 0:
            raise UsageError(
                f"radius {self.radius_m:g} m, centre {self.centre_height_m:g} m above the floor, ior {self.ior:g}, "
                f"order {self.order}",
                where="GlassSphere",
                remedy="the sphere must stand on or above the floor, its ior be 1 or more, its order 0 or more",
            )

    def _landing(self, theta: npt.NDArray[np.complexfloating] | FloatArray) -> npt.NDArray[np.inexact]:
        inside = np.arcsin(np.sin(theta) / self.ior)
        polar = theta + self.order * (np.pi - 2.0 * inside)
        direction = polar + theta
        down = np.real(np.cos(direction)) < -1e-12
        # tan has no pole where the ray points down; elsewhere the ray never lands
        safe = np.where(down, direction, np.pi)
        radius = self.radius_m * np.sin(polar) - (self.centre_height_m + self.radius_m * np.cos(polar)) * np.tan(safe)
        return np.asarray(np.where(down, radius, np.nan))

    def _share(self, theta: FloatArray) -> FloatArray:
        reflectance = fresnel_dielectric(np.cos(theta), 1.0, self.ior)
        if self.order == 0:
            return reflectance
        chord_m = 2.0 * self.radius_m * np.sqrt(1.0 - (np.sin(theta) / self.ior) ** 2)
        absorbed = beer_lambert(self.sigma_a_per_m, chord_m * self.order)
        return (1.0 - reflectance) ** 2 * reflectance ** (self.order - 1) * absorbed

    def fan(self) -> BeamFan:
        """The family of rings of beams, parameter t_i in [0, pi/2]."""

        def flux_per_u(theta: FloatArray) -> FloatArray:
            return self.e_perp * np.pi * self.radius_m**2 * np.sin(2.0 * theta) * self._share(theta)

        return BeamFan(self._landing, flux_per_u, 0.0, np.pi / 2.0, radial=True)

    def irradiance(self, radius_m: npt.ArrayLike) -> FloatArray:
        """Irradiance at distances > 0 from the axis, any shape, W/m^2: sum over preimages on both sides."""
        return self.fan().irradiance(radius_m)

    def ring_irradiance(self, radius_edges_m: FloatArray) -> FloatArray:
        """Irradiance averaged over rings between ascending radii (B + 1,), (B,), W/m^2."""
        return self.fan().bin_flux(radius_edges_m) / (np.pi * np.diff(np.asarray(radius_edges_m) ** 2))

    def pixel_irradiance(self, x_edges_m: FloatArray, z_edges_m: FloatArray, rings_per_pixel: int = 16) -> FloatArray:
        """Irradiance averaged over pixels (Z, X) of the floor, origin below the centre, W/m^2.

        Rings are 1 / `rings_per_pixel` of a pixel wide, and a hundred times thinner within three pixels of the axis,
        where the irradiance grows like 1/r, and at folds, where it grows like the inverse root of the distance.
        """
        pixel = float(min(np.diff(x_edges_m).min(), np.diff(z_edges_m).min()))
        reach = float(np.hypot(np.abs(x_edges_m).max(), np.abs(z_edges_m).max()))
        thin = pixel / (100.0 * rings_per_pixel)
        steps = np.arange(-2.0 * pixel / rings_per_pixel, 2.0 * pixel / rings_per_pixel, thin)
        folds = [fold + steps for fold in self.fold_radii_m() if fold < reach]
        near, far = np.arange(0.0, 3.0 * pixel, thin), np.arange(3.0 * pixel, reach + pixel, pixel / rings_per_pixel)
        edges = np.unique(np.concatenate((near, far, *folds)).clip(0.0))
        return radial_to_pixels(self.fan().bin_flux(edges), edges, np.asarray(x_edges_m), np.asarray(z_edges_m))

    def fold_radii_m(self) -> FloatArray:
        """Radii of the caustic rings: where the landing radius turns round."""
        landing = np.asarray(self._landing(np.linspace(0.0, np.pi / 2.0, 1 << 17)), np.float64)
        step = np.diff(landing)
        turns = np.flatnonzero(step[1:] * step[:-1] < 0.0) + 1
        return np.abs(landing[turns])

    def entered_flux(self) -> float:
        """Flux on the sphere's cross-section, E_perp pi R^2."""
        return float(self.e_perp * np.pi * self.radius_m**2)

    def transmitted_flux(self) -> float:
        """Flux of this order that leaves the sphere, in whatever direction."""
        return self.fan().total_flux()

    def flux_within(self, radius_m: float) -> float:
        """Flux of this order that lands within a radius of the axis."""
        return float(self.fan().bin_flux(np.array([0.0, radius_m])).sum())
