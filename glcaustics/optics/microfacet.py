"""Rough interfaces: GGX microfacets (Walter et al. 2007), float64. `alpha`: width of the lobe, roughness squared."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from glcaustics.optics.fresnel import fresnel_dielectric

FloatArray = npt.NDArray[np.float64]


def ggx_density(cos_m: npt.ArrayLike, alpha: float) -> FloatArray:
    """D(m), 1/sr (eq. 33), for the cosine of the microfacet's normal with the surface's, in [0, 1]."""
    c2 = np.asarray(cos_m, np.float64) ** 2
    return np.asarray(alpha**2 / (np.pi * (c2 * (alpha**2 - 1.0) + 1.0) ** 2))


def ggx_visible_share(cosine: npt.ArrayLike, alpha: npt.ArrayLike) -> FloatArray:
    """Smith's G1 (eq. 34) for the cosine of a direction with the surface's normal, in (0, 1]."""
    c = np.asarray(cosine, np.float64)
    tan2 = (1.0 - c * c) / np.maximum(c * c, 1e-300)
    return np.asarray(2.0 / (1.0 + np.sqrt(1.0 + np.asarray(alpha) ** 2 * tan2)))


def rough_reflection(
    incoming: FloatArray, outgoing: FloatArray, normal: FloatArray, alpha: float, ior: float | None
) -> FloatArray:
    """Reflected radiant intensity per unit of flux that arrives, 1/sr: f_r cos(outgoing) (eq. 20).

    Args:
        incoming, outgoing: (..., 3) unit directions of travel, towards and away from the surface.
        normal: (3,) or (..., 3), against `incoming`.
        ior: beyond over before; None: a perfect mirror (Fresnel's share is 1).
    """
    cos_i, cos_o = -np.sum(incoming * normal, axis=-1), np.sum(outgoing * normal, axis=-1)
    half = outgoing - incoming
    half = half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-300)
    cos_m = -np.sum(incoming * half, axis=-1)
    fresnel = np.ones_like(cos_m) if ior is None else fresnel_dielectric(np.clip(cos_m, 0.0, 1.0), 1.0, ior)
    masking = ggx_visible_share(np.abs(cos_i), alpha) * ggx_visible_share(np.abs(cos_o), alpha)
    value = fresnel * masking * ggx_density(np.sum(half * normal, axis=-1), alpha) / (4.0 * np.abs(cos_i))
    return np.where((cos_i > 0.0) & (cos_o > 0.0), value, 0.0)


def rough_transmission(
    incoming: FloatArray, outgoing: FloatArray, normal: FloatArray, alpha: float, ior: float
) -> FloatArray:
    """Transmitted radiant intensity per unit of flux that arrives, 1/sr: f_s cos(outgoing) (eq. 21).

    Args:
        as `rough_reflection`; `ior`: of the side beyond over that before.
    """
    cos_i, cos_o = -np.sum(incoming * normal, axis=-1), -np.sum(outgoing * normal, axis=-1)
    half = incoming - ior * outgoing  # -(eta_i i + eta_o o), with i = -incoming
    half = half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-300)
    half = half * np.sign(np.sum(half * normal, axis=-1, keepdims=True))
    i_m, o_m = -np.sum(incoming * half, axis=-1), np.sum(outgoing * half, axis=-1)
    masking = ggx_visible_share(np.abs(cos_i), alpha) * ggx_visible_share(np.abs(cos_o), alpha)
    jacobian = ior**2 * np.abs(o_m) / np.maximum((i_m + ior * o_m) ** 2, 1e-300)
    share = 1.0 - fresnel_dielectric(np.clip(i_m, 0.0, 1.0), 1.0, ior)
    value = np.abs(i_m) / np.abs(cos_i) * jacobian * share * masking
    value = value * ggx_density(np.sum(half * normal, axis=-1), alpha)
    return np.where((cos_i > 0.0) & (cos_o > 0.0) & (i_m > 0.0) & (o_m < 0.0), value, 0.0)


def visible_normals(
    normal: FloatArray, direction: FloatArray, alpha: FloatArray, sample: FloatArray, axis: FloatArray
) -> FloatArray:
    """Microfacet normals (n, 3) as often as light along `direction` meets them (Heitz 2018; the mapping is that of
    Dupuy and Benyoub 2023): one and the same `sample` gives normals that vary smoothly with normal and direction.

    Args:
        normal, direction: (n, 3) unit vectors, `normal` against `direction`. alpha: (n,).
        sample: (2,) or (n, 2) in [0, 1).
        axis: (3,), any unit vector; only where the normal is along it the frame turns abruptly.
    """
    t = np.cross(axis, normal)
    t /= np.maximum(np.linalg.norm(t, axis=1, keepdims=True), 1e-300)
    b = np.cross(normal, t)
    a = alpha[:, None]

    def along(v: FloatArray) -> FloatArray:
        return np.asarray(-np.einsum("ij,ij->i", direction, v)[:, None])

    w = np.concatenate([a * along(t), a * along(b), along(normal)], axis=1)
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    phi, z = 2.0 * np.pi * sample[..., 0], (1.0 - sample[..., 1]) * (1.0 + w[:, 2]) - w[:, 2]
    r = np.sqrt(np.clip(1.0 - z * z, 0.0, 1.0))
    h = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1) + w
    m = a * h[:, :1] * t + a * h[:, 1:2] * b + np.maximum(h[:, 2:], 0.0) * normal
    return np.asarray(m / np.linalg.norm(m, axis=1, keepdims=True))
