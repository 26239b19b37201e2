"""The closed forms that every caustics method is tested on, one class or function a truth.

1. `flat_directional_irradiance`   2. `flat_point_irradiance`, `flat_point_flux`   3. `SineWater`   4. `GlassSphere`
5. `MirrorCylinder`   6. flux totals: `flat_point_flux`, `SineWater.flux_per_m`, `GlassSphere.transmitted_flux`,
`GlassSphere.flux_within`, `MirrorCylinder.flux`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError
from glcaustics.optics.fresnel import beer_lambert, transmittance_dielectric
from glcaustics.optics.glass_sphere import GlassSphere
from glcaustics.optics.mirror_cylinder import MirrorCylinder
from glcaustics.optics.sine_water import SineWater

__all__ = [
    "GlassSphere",
    "MirrorCylinder",
    "SineWater",
    "flat_directional_irradiance",
    "flat_directional_shift_m",
    "flat_point_entry_radius_m",
    "flat_point_flux",
    "flat_point_irradiance",
]

FloatArray = npt.NDArray[np.float64]
BISECTIONS = 80


def _cos_inside(cos_above: FloatArray, n_above: float, n_below: float) -> FloatArray:
    """Snell's law for cosines; total internal reflection is an error here."""
    cos2 = 1.0 - (n_above / n_below) ** 2 * (1.0 - cos_above**2)
    if np.any(cos2 <= 0.0):
        raise UsageError(
            "the light is totally reflected by the flat interface", where="closed_form", remedy="lower the angle"
        )
    return np.asarray(np.sqrt(cos2))


def flat_directional_irradiance(
    theta_rad: npt.ArrayLike,
    *,
    ior: float = 1.333,
    n_above: float = 1.0,
    e_perp: float = 1.0,
    depth_m: float = 0.0,
    sigma_a_per_m: float = 0.0,
) -> FloatArray:
    """Irradiance of a floor parallel to a flat interface under directional light: a constant.

    E = E_perp cos t T(t) exp(-sigma_a d / cos t'), t' the refracted angle. What a patch of the interface lets through
    lands on a patch of equal area, so no angle of the refracted ray enters but through absorption.

    Args:
        theta_rad: angle between the light and the vertical, any shape.
    """
    cos_i = np.cos(np.asarray(theta_rad, np.float64))
    cos_t = _cos_inside(cos_i, n_above, ior)
    passed = transmittance_dielectric(cos_i, n_above, ior) * beer_lambert(sigma_a_per_m, depth_m / cos_t)
    return np.asarray(e_perp * cos_i * passed)


def flat_directional_shift_m(
    theta_rad: npt.ArrayLike, depth_m: float, *, ior: float = 1.333, n_above: float = 1.0
) -> FloatArray:
    """How far sideways directional light travels from the flat interface to the floor, d tan t', metres."""
    theta = np.asarray(theta_rad, np.float64)
    return np.asarray(depth_m * np.tan(np.arcsin(n_above * np.sin(theta) / ior)))


def flat_point_entry_radius_m(
    radius_m: npt.ArrayLike, *, height_m: float, depth_m: float, ior: float = 1.333, n_above: float = 1.0
) -> FloatArray:
    """Where the light that reaches floor radius r meets the flat interface, metres from the axis, same shape.

    Solves r = h tan t + d tan t' by bisection; r grows with t, so there is one solution.
    """
    r = np.asarray(radius_m, np.float64)
    low, high = np.zeros_like(r), r.copy()
    if n_above > ior:  # the entry cannot lie beyond the critical angle
        high = np.minimum(high, height_m * np.tan(np.arcsin(ior / n_above)))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        sin_t = n_above / ior * middle / np.hypot(middle, height_m)
        beyond = middle + depth_m * sin_t / np.sqrt(np.maximum(1.0 - sin_t**2, 1e-300)) > r
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return np.asarray(0.5 * (low + high))


def flat_point_irradiance(
    radius_m: npt.ArrayLike,
    *,
    height_m: float,
    depth_m: float,
    ior: float = 1.333,
    n_above: float = 1.0,
    intensity: float = 1.0,
    sigma_a_per_m: float = 0.0,
) -> FloatArray:
    """Irradiance of a floor under a flat interface, lit by a point light.

    Light h above the interface, floor d below: r(t) = h tan t + d tan t', sin t' = n sin t. The ring between t and
    t + dt receives I T exp(-sigma_a d / cos t') 2 pi sin t dt, so
    E(r) = I T exp(-sigma_a d / cos t') sin t / (r dr/dt), dr/dt = h / cos^2 t + d n cos t / cos^3 t';
    on the axis sin t / r tends to 1 / (h + n d), with n = n_above / ior.

    Args:
        radius_m: distance from the foot of the light, any shape, metres.
        intensity: W/sr (or cd); the result is in W/m^2 (or lux).
    """
    r = np.asarray(radius_m, np.float64)
    entry = flat_point_entry_radius_m(r, height_m=height_m, depth_m=depth_m, ior=ior, n_above=n_above)
    eta = n_above / ior
    cos_i = height_m / np.hypot(entry, height_m)
    cos_t = _cos_inside(cos_i, n_above, ior)
    # r / sin t without 0 / 0 on the axis: r = sin t (h / cos t + d eta / cos t')
    r_over_sin = height_m / cos_i + depth_m * eta / cos_t
    stretch = height_m / cos_i**2 + depth_m * eta * cos_i / cos_t**3
    passed = transmittance_dielectric(cos_i, n_above, ior) * beer_lambert(sigma_a_per_m, depth_m / cos_t)
    return np.asarray(intensity * passed / (r_over_sin * stretch))


def flat_point_flux(
    half_x_m: float,
    half_z_m: float,
    *,
    height_m: float,
    depth_m: float = 0.0,
    ior: float = 1.333,
    intensity: float = 1.0,
    sigma_a_per_m: float = 0.0,
    nodes: int = 256,
) -> float:
    """Flux that a point light sends through a flat rectangle of interface to the floor below, W.

    Integral of I T exp(-sigma_a d / cos t') cos t / (distance^2) over the rectangle centred under the light, by
    Gauss-Legendre quadrature.
    """
    node, weight = np.polynomial.legendre.leggauss(nodes)
    x, z = np.meshgrid(node * half_x_m, node * half_z_m)
    distance2 = x**2 + z**2 + height_m**2
    cos_i = height_m / np.sqrt(distance2)
    cos_t = _cos_inside(cos_i, 1.0, ior)
    passed = transmittance_dielectric(cos_i, 1.0, ior) * beer_lambert(sigma_a_per_m, depth_m / cos_t)
    integrand = intensity * passed * cos_i / distance2
    return float((np.outer(weight, weight) * integrand).sum() * half_x_m * half_z_m)
