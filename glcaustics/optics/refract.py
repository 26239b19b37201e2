"""Reflection and refraction of unit vectors, float64, vectorised over leading axes.

`direction` is the direction the ray travels along (as GLSL's `reflect` and `refract` take it), not a `wi` vector.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


def reflect(direction: npt.ArrayLike, normal: npt.ArrayLike) -> FloatArray:
    """Mirrored direction d - 2 (d.n) n.

    Args:
        direction: (..., 3) unit vectors along the ray.
        normal: (..., 3) unit normals, on either side.
    """
    d, n = np.asarray(direction, np.float64), np.asarray(normal, np.float64)
    return np.asarray(d - 2.0 * np.sum(d * n, axis=-1, keepdims=True) * n)


def refract(
    direction: npt.ArrayLike, normal: npt.ArrayLike, n_from: npt.ArrayLike, n_to: npt.ArrayLike
) -> tuple[FloatArray, BoolArray]:
    """Direction beyond an interface, by Snell's law in vector form (Glassner 1989, chapter 4; pbrt-v4, eq. 9.4).

    Args:
        direction: (..., 3) unit vectors along the ray.
        normal: (..., 3) unit normals; they may point to either side, the indices say which medium is which.
        n_from, n_to: index of refraction of the medium the ray leaves and of the one it enters; broadcast.

    Returns:
        Unit directions (..., 3), and a mask (...) that is True under total internal reflection. Where it is True the
        direction is the mirrored one, so that no entry is ever zero or NaN.
    """
    d, n = np.broadcast_arrays(np.asarray(direction, np.float64), np.asarray(normal, np.float64))
    d_dot_n = np.sum(d * n, axis=-1)
    n = np.where((d_dot_n > 0.0)[..., None], -n, n)
    cos_i = np.abs(d_dot_n)
    eta = np.asarray(n_from, np.float64) / np.asarray(n_to, np.float64)
    cos2_t = 1.0 - eta**2 * (1.0 - cos_i**2)
    tir = cos2_t <= 0.0
    cos_t = np.sqrt(np.where(tir, 0.0, cos2_t))
    eta = np.broadcast_to(eta, cos_i.shape)
    refracted = eta[..., None] * d + (eta * cos_i - cos_t)[..., None] * n
    return np.where(tir[..., None], reflect(d, n), refracted), tir
