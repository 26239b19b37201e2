"""Fresnel reflectance and Beer-Lambert absorption, float64, vectorised over arrays of any shape."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError

FloatArray = npt.NDArray[np.float64]


def fresnel_dielectric(cos_i: npt.ArrayLike, n_from: npt.ArrayLike, n_to: npt.ArrayLike) -> FloatArray:
    """Share of unpolarised light that a smooth dielectric interface reflects; 1 under total internal reflection.

    R = (r_s^2 + r_p^2) / 2 (Born and Wolf 1999, section 1.5.2, eqs. 20, 21; the same in pbrt-v4, eq. 9.5).

    Args:
        cos_i: cosine between the ray and the normal on the ray's side, 0 (grazing) to 1; the sign is ignored.
        n_from, n_to: index of refraction of the medium the ray comes from, and beyond the interface; above 0.

    Returns:
        Reflectance in [0, 1], shape of the broadcast arguments. Transmittance is 1 minus it.

    Raises:
        UsageError: an index that is not above 0, or a cosine beyond 1.
    """
    cosine, n_1, n_2 = np.broadcast_arrays(
        np.abs(np.asarray(cos_i, np.float64)), np.asarray(n_from, np.float64), np.asarray(n_to, np.float64)
    )
    if np.any(n_1 <= 0.0) or np.any(n_2 <= 0.0):
        raise UsageError("an index of refraction is not above 0", where="fresnel_dielectric", remedy="give n > 0")
    if np.any(cosine > 1.0 + 1e-9):
        raise UsageError(
            f"cos_i {float(cosine.max()):g} is above 1", where="fresnel_dielectric", remedy="normalise the vectors"
        )
    cosine = np.minimum(cosine, 1.0)
    sin2_t = (n_1 / n_2) ** 2 * (1.0 - cosine**2)
    tir = sin2_t >= 1.0
    cos_t = np.sqrt(np.where(tir, 0.0, 1.0 - sin2_t))
    # Where the ray grazes equal media both sums vanish: no interface there, so nothing is reflected.
    denominator_s = n_1 * cosine + n_2 * cos_t
    denominator_p = n_2 * cosine + n_1 * cos_t
    none = (denominator_s == 0.0) | (denominator_p == 0.0)
    r_s = (n_1 * cosine - n_2 * cos_t) / np.where(none, 1.0, denominator_s)
    r_p = (n_2 * cosine - n_1 * cos_t) / np.where(none, 1.0, denominator_p)
    reflectance = np.where(tir, 1.0, 0.5 * (r_s**2 + r_p**2))
    return np.where(n_1 == n_2, 0.0, reflectance)


def transmittance_dielectric(cos_i: npt.ArrayLike, n_from: npt.ArrayLike, n_to: npt.ArrayLike) -> FloatArray:
    """Share of unpolarised flux that passes a smooth dielectric interface: 1 - `fresnel_dielectric`."""
    return 1.0 - fresnel_dielectric(cos_i, n_from, n_to)


def fresnel_schlick(cos_i: npt.ArrayLike, f0: npt.ArrayLike) -> FloatArray:
    """Reflectance of a metal, F = F0 + (1 - F0)(1 - cos_i)^5 (Schlick 1994, eq. 15; glTF 2.0, appendix B.3.2).

    Args:
        cos_i: cosine between ray and normal, 0 to 1; the sign is ignored.
        f0: reflectance at normal incidence: the base colour of a glTF metal. Broadcasts against `cos_i`.
    """
    cosine = np.clip(np.abs(np.asarray(cos_i, np.float64)), 0.0, 1.0)
    f0 = np.asarray(f0, np.float64)
    return np.asarray(f0 + (1.0 - f0) * (1.0 - cosine) ** 5)


def beer_lambert(sigma_a_per_m: npt.ArrayLike, distance_m: npt.ArrayLike) -> FloatArray:
    """Share of flux left after `distance_m` of an absorbing medium: exp(-sigma_a d) (Beer-Lambert's law).

    Raises:
        UsageError: a negative coefficient or distance.
    """
    sigma_a, distance = np.asarray(sigma_a_per_m, np.float64), np.asarray(distance_m, np.float64)
    if np.any(sigma_a < 0.0) or np.any(distance < 0.0):
        raise UsageError(
            "an absorption coefficient or a distance is negative",
            where="beer_lambert",
            remedy="give values of 0 or more",
        )
    return np.exp(-sigma_a * distance)
