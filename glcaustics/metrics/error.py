"""Errors of an image against a reference. Images are (H, W) or (H, W, C), linear, float; computed in float64.

Every function raises UsageError when the shapes differ, when nothing is left after masking, or when a value is not
finite: a NaN must not turn into a number. Count those with `non_finite_share` first.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError

FloatArray = npt.NDArray[np.float64]


def checked_pair(
    reference: npt.ArrayLike, test: npt.ArrayLike, mask: npt.ArrayLike | None = None, *, where: str = "metrics"
) -> tuple[FloatArray, FloatArray]:
    """Both as float64, (H, W, C), or (n, C) of the pixels in `mask` (H, W).

    Raises:
        UsageError: shapes that differ, an empty mask or image, values that are not finite.
    """
    a, b = np.asarray(reference, np.float64), np.asarray(test, np.float64)
    if a.shape != b.shape:
        raise UsageError(f"reference is {a.shape}, test is {b.shape}", where=where, remedy="compare equal shapes")
    if a.ndim not in (2, 3):
        raise UsageError(f"an image has shape {a.shape}", where=where, remedy="give (H, W) or (H, W, C)")
    if a.ndim == 2:
        a, b = a[..., None], b[..., None]
    if mask is not None:
        chosen = np.asarray(mask, bool)
        if chosen.shape != a.shape[:2]:
            raise UsageError(f"mask is {chosen.shape}, images are {a.shape[:2]}", where=where, remedy="give (H, W)")
        a, b = a[chosen], b[chosen]
    if a.size == 0:
        raise UsageError("there is no pixel to compare", where=where, remedy="widen the mask")
    for name, image in (("reference", a), ("test", b)):
        bad = int(np.count_nonzero(~np.isfinite(image)))
        if bad:
            raise UsageError(f"{name} has {bad} values that are not finite", where=where, remedy="mend or mask them")
    return a, b


def _positive_mean(image: FloatArray, where: str) -> float:
    mean = float(image.mean())
    if mean <= 0.0:
        raise UsageError(
            f"the reference's mean is {mean:g}", where=where, remedy="relative errors need a reference that is not dark"
        )
    return mean


def relative_rmse(
    reference: npt.ArrayLike,
    test: npt.ArrayLike,
    *,
    other_half: npt.ArrayLike | None = None,
    mask: npt.ArrayLike | None = None,
    normalise: bool = False,
) -> float:
    """Root of the mean squared error over the reference's mean, all channels together.

    Args:
        other_half: a second, independent rendering of the reference. Then the reference is the mean of both halves a,
            b, and its own noise is taken off: mean((t - a)(t - b)) is the squared error of t without the variance
            of the halves, since their noises are independent. May come out as 0 where the noise exceeds the error.
        mask: (H, W), pixels that count.
        normalise: divide each image by its mean first (error of the pattern alone; as published code is compared).
    """
    where = "relative_rmse"
    a, t = checked_pair(reference, test, mask, where=where)
    b = a if other_half is None else checked_pair(other_half, test, mask, where=where)[0]
    scale = _positive_mean(0.5 * (a + b), where)
    if normalise:
        t = t * (scale / _positive_mean(t, where))
    return math.sqrt(max(float(np.mean((t - a) * (t - b))), 0.0)) / scale


def mean_absolute_error(
    reference: npt.ArrayLike, test: npt.ArrayLike, *, mask: npt.ArrayLike | None = None, normalise: bool = False
) -> float:
    """Mean of |test - reference| over the reference's mean: robust where single pixels at folds own the RMSE."""
    where = "mean_absolute_error"
    a, t = checked_pair(reference, test, mask, where=where)
    scale = _positive_mean(a, where)
    if normalise:
        t = t * (scale / _positive_mean(t, where))
    return float(np.mean(np.abs(t - a))) / scale


def bias_of_mean(reference: npt.ArrayLike, test: npt.ArrayLike, *, mask: npt.ArrayLike | None = None) -> float:
    """mean(test) / mean(reference) - 1: energy that is missing (negative) or too much; blind to the pattern."""
    a, t = checked_pair(reference, test, mask, where="bias_of_mean")
    return float(t.mean()) / _positive_mean(a, "bias_of_mean") - 1.0


def psnr(
    reference: npt.ArrayLike, test: npt.ArrayLike, *, peak: float | None = None, mask: npt.ArrayLike | None = None
) -> float:
    """Peak signal to noise ratio 10 log10(peak^2 / MSE), decibels (Huynh-Thu, Ghanbari 2008); inf for equal images.

    Args:
        peak: value of full white; default: the reference's largest.
    """
    a, t = checked_pair(reference, test, mask, where="psnr")
    top = float(np.abs(a).max()) if peak is None else float(peak)
    if not top > 0.0:
        raise UsageError(f"the peak is {top:g}", where="psnr", remedy="give peak=, the value of white")
    mse = float(np.mean((t - a) ** 2))
    return math.inf if mse == 0.0 else 10.0 * math.log10(top * top / mse)


def flux_balance(irradiance: npt.ArrayLike, pixel_area_m2: npt.ArrayLike, flux_w: npt.ArrayLike) -> FloatArray:
    """Flux that the image holds over the flux that should have landed, minus 1, per channel (C,).

    Args:
        irradiance: (H, W, C), W/m^2. pixel_area_m2: a number, or (H, W), area of receiver that a pixel shows.
        flux_w: (C,) or a number, flux that must land on what the image shows.
    """
    image = np.asarray(irradiance, np.float64)
    image = image[..., None] if image.ndim == 2 else image
    area = np.broadcast_to(np.asarray(pixel_area_m2, np.float64), image.shape[:2])
    target = np.broadcast_to(np.asarray(flux_w, np.float64), image.shape[2:])
    if not np.isfinite(image).all():
        raise UsageError("the irradiance is not finite everywhere", where="flux_balance", remedy="mend it first")
    if not (target > 0.0).all():
        raise UsageError(f"flux {target} is not positive", where="flux_balance", remedy="give the flux that lands")
    return np.asarray(np.einsum("ijc,ij->c", image, area) / target - 1.0)


def non_finite_share(image: npt.ArrayLike) -> float:
    """Share of the pixels (H, W[, C]) in which any channel is NaN or infinite. Must be 0."""
    values = np.asarray(image)
    if values.size == 0:
        raise UsageError("the image is empty", where="non_finite_share", remedy="give at least one pixel")
    bad = ~np.isfinite(values)
    return float((bad.any(axis=-1) if values.ndim == 3 else bad).mean())
