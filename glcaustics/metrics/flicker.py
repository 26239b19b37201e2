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
