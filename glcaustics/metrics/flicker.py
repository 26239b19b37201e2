"""Temporal flicker: what changes from frame to frame beyond what truly changes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError

FloatArray = npt.NDArray[np.float64]


def _frames(frames: npt.ArrayLike, where: str) -> FloatArray:
    stack = np.asarray(frames, np.float64)
    if stack.ndim not in (3, 4) or len(stack) < 2:
        raise UsageError(f"a sequence has shape {stack.shape}", where=where, remedy="give (T >= 2, H, W[, C])")
    if not np.isfinite(stack).all():
        raise UsageError("the sequence has values that are not finite", where=where, remedy="mend or mask them")
    return stack


def _relative_rms(change: FloatArray, level: FloatArray, where: str) -> float:
    mean = float(level.mean())
    if mean <= 0.0:
        raise UsageError(f"the sequence's mean is {mean:g}", where=where, remedy="flicker needs light")
    return float(np.sqrt(np.mean(change**2))) / mean


def static_flicker(frames: npt.ArrayLike) -> float:
    """RMS of the change between consecutive frames of a scene that stands still, over the mean level.

    For independent noise of relative standard deviation s it is s sqrt(2); 0 for a method that repeats itself.

    Args:
        frames: (T, H, W[, C]), linear.
    """
    stack = _frames(frames, "static_flicker")
    return _relative_rms(np.diff(stack, axis=0), stack, "static_flicker")


def moving_flicker(frames: npt.ArrayLike, references: npt.ArrayLike) -> float:
    """The same for a moving scene, after compensation for the true change: RMS of (f' - f) - (r' - r) over mean r.

    A constant error cancels, since it does not flicker; error that jumps about does not. Equal to `static_flicker` if
    the references stand still.

    Args:
        frames, references: (T, H, W[, C]), linear; converged references at the same times and from the same views.
    """
    stack, truth = _frames(frames, "moving_flicker"), _frames(references, "moving_flicker")
    if stack.shape != truth.shape:
        raise UsageError(
            f"frames are {stack.shape}, references {truth.shape}",
            where="moving_flicker",
            remedy="render both at the same times and sizes",
        )
    return _relative_rms(np.diff(stack, axis=0) - np.diff(truth, axis=0), truth, "moving_flicker")


def surface_flicker(frames: npt.ArrayLike, points_px: npt.ArrayLike, truth: npt.ArrayLike | None = None) -> float:
    """Temporal standard deviation of the error at points of the surfaces, over the mean of the light there.

    For a camera that moves. Every point is followed through the pictures, as by an eye, and seen there through a
    footprint of about a pixel that stays on the surface: the cubic B-spline. What changes there and not in the light is
    flicker: noise, the shimmer of detail finer than a pixel, lag. What sticks to the surfaces does not flicker, be it
    wrong or blurred; so this number says nothing without an error beside it. The truth is the surfaces' and not the
    pixels' of a converged picture: such a picture aliases, too, and would count its shimmer for the truth and a steady
    picture for flicker. Where the light stands still this is the error of warping (Lai et al. 2018) over all frames.

    The footprint looks alike wherever the point lies between pixels: it leaves 0.46 to 0.50 of the standard deviation
    of noise that is independent from pixel to pixel, and 0.65 to 0.67 of a pattern of 4 pixels a period along one axis.
    (A bilinear look-up: 0.50 to 1 and 0.71 to 1, which is flicker of its own making.)

    Args:
        frames: (T, H, W[, C]), linear.
        points_px: (T, N, 2) column and row of N surface points in each picture, in pixels, (0.5, 0.5) the middle of the
            pixel at the top left; NaN where a point is not seen. Points that are seen in fewer than half of the
            pictures, or two of them, do not count.
        truth: (T, N[, C]), the light at these points, of the frames' unit; None: it stands still.

    Raises:
        UsageError: shapes that do not fit, or no point that is seen often enough.
    """
    where = "surface_flicker"
    stack, points = _frames(frames, where), np.asarray(points_px, np.float64)
    if points.ndim != 3 or points.shape[0] != len(stack) or points.shape[2] != 2:
        raise UsageError(f"frames are {stack.shape}, points {points.shape}", where=where, remedy="points: (T, N, 2)")
    shown = np.stack([_footprint(f, p) for f, p in zip(stack, points, strict=True)])
    light = shown
    if truth is not None:
        light = np.asarray(truth, np.float64).reshape(*np.shape(truth)[:2], -1)
        if light.shape != shown.shape:
            raise UsageError(f"truth is {np.shape(truth)}, points {points.shape}", where=where, remedy="(T, N[, C])")
    error = shown if truth is None else shown - light
    counted = np.isfinite(error).all(axis=2).sum(axis=0) >= max(0.5 * len(stack), 2.0)
    if not counted.any():
        raise UsageError("no point is seen in half of the pictures", where=where, remedy="move the camera less")
    variance = np.nanvar(error[:, counted], axis=0, ddof=1)
    mean = float(np.nanmean(light[:, counted]))
    if mean <= 0.0:
        raise UsageError(f"the light's mean is {mean:g}", where=where, remedy="flicker needs light")
    return float(np.sqrt(variance.mean())) / mean


def _footprint(image: FloatArray, points_px: FloatArray) -> FloatArray:
    """Mean by a cubic B-spline about each point, (N, C); NaN for NaN and for points within 1.5 pixels of the border."""
    height, width = image.shape[:2]
    pixels = image.reshape(height, width, -1)
    at = points_px - 0.5
    inside = np.asarray(np.isfinite(at).all(axis=1))
    inside[inside] = ((at[inside] >= 1.0) & (at[inside] <= (width - 2, height - 2))).all(axis=1)
    found = np.full((len(at), pixels.shape[2]), np.nan)
    first = np.clip(np.floor(at[inside]).astype(int) - 1, 0, (max(width - 4, 0), max(height - 4, 0)))
    found[inside] = 0.0
    for row in range(4 if inside.any() else 0):
        for column in range(4):
            pixel = first + (column, row)
            weight = np.prod(_b_spline(at[inside] - pixel), axis=1)
            found[inside] += weight[:, None] * pixels[pixel[:, 1], pixel[:, 0]]
    return found


def _b_spline(x: FloatArray) -> FloatArray:
    """The cubic B-spline at x pixels from its middle; those at whole distances from each other add up to 1."""
    x = np.abs(x)
    near, far = 2.0 / 3.0 - x**2 + 0.5 * x**3, np.maximum(2.0 - x, 0.0) ** 3 / 6.0
    return np.where(x < 1.0, near, far)
