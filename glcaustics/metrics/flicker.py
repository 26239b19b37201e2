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


def surface_flicker(frames: npt.ArrayLike, references: npt.ArrayLike, points_px: npt.ArrayLike) -> float:
    """Temporal standard deviation of the error at points of the surfaces, over the mean of the reference.

    For a camera that moves: every point is followed through the pictures, and what changes of (frame - reference) there
    is flicker. An error that sticks to the surface cancels; so does what the reference itself changes by, the sampling
    of fine detail by the pixels included. For independent noise of relative standard deviation s it is s, times what
    the bilinear look-up between pixels leaves of it (2/3 on average; the same for all that are looked up alike).

    Args:
        frames, references: (T, H, W[, C]), linear; converged references at the same times and from the same views.
        points_px: (T, N, 2) column and row of N surface points in each picture, in pixels, (0.5, 0.5) the middle of the
            pixel at the top left; NaN where a point is not seen. Points that are seen in fewer than half of the
            pictures do not count.

    Raises:
        UsageError: shapes that do not fit, or no point that is seen often enough.
    """
    where = "surface_flicker"
    stack, truth = _frames(frames, where), _frames(references, where)
    points = np.asarray(points_px, np.float64)
    if stack.shape != truth.shape or points.ndim != 3 or points.shape[0] != len(stack) or points.shape[2] != 2:
        raise UsageError(
            f"frames are {stack.shape}, references {truth.shape}, points {points.shape}",
            where=where,
            remedy="give as many references and rows of points as frames",
        )
    error = np.stack([_look_up(f - r, p) for f, r, p in zip(stack, truth, points, strict=True)])
    level = np.stack([_look_up(r, p) for r, p in zip(truth, points, strict=True)])
    seen = np.isfinite(error).all(axis=2)
    counted = seen.sum(axis=0) >= max(0.5 * len(stack), 2.0)
    if not counted.any():
        raise UsageError("no point is seen in half of the pictures", where=where, remedy="move the camera less")
    variance = np.nanvar(error[:, counted], axis=0, ddof=1)
    mean = float(np.nanmean(level[:, counted]))
    if mean <= 0.0:
        raise UsageError(f"the references' mean is {mean:g}", where=where, remedy="flicker needs light")
    return float(np.sqrt(variance.mean())) / mean


def _look_up(image: FloatArray, points_px: FloatArray) -> FloatArray:
    """Bilinear look-up, (N, C); NaN for points that are NaN or nearer to the border than half a pixel."""
    height, width = image.shape[:2]
    pixels = image.reshape(height, width, -1)
    at = points_px - 0.5
    inside = np.asarray(np.isfinite(at).all(axis=1))
    inside[inside] = ((at[inside] >= 0.0) & (at[inside] <= (width - 1, height - 1))).all(axis=1)
    low = np.minimum(np.floor(np.where(inside[:, None], at, 0.0)).astype(int), (max(width - 2, 0), max(height - 2, 0)))
    high = np.minimum(low + 1, (width - 1, height - 1))
    f = np.where(inside[:, None], at - low, 0.0)
    upper = pixels[low[:, 1], low[:, 0]] * (1.0 - f[:, :1]) + pixels[low[:, 1], high[:, 0]] * f[:, :1]
    lower = pixels[high[:, 1], low[:, 0]] * (1.0 - f[:, :1]) + pixels[high[:, 1], high[:, 0]] * f[:, :1]
    found = upper * (1.0 - f[:, 1:]) + lower * f[:, 1:]
    return np.where(inside[:, None], found, np.nan)
