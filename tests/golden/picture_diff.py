"""Compares two 8-bit pictures and keeps what a human needs when they differ."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

Picture = npt.NDArray[np.uint8]

# In 8-bit steps. The same code on another CPU or Mesa rounds differently: nearly every pixel stays within one step, and
# a few at silhouettes and caustic folds, where a sample falls on the other side of an edge, move by more: 0.1 % of the
# values may. A wrong cosine, Fresnel or exposure term moves whole regions by several steps and fails the mean.
MEAN_LIMIT = 0.5
PERCENTILE = 99.9
PERCENTILE_LIMIT = 4.0
DIFF_GAIN = 32  # the stored difference picture is multiplied by this, or four steps would look black


@dataclass(frozen=True)
class Difference:
    """Absolute difference of two pictures in 8-bit steps: mean, 99.9th percentile, maximum over all values."""

    mean: float
    percentile: float
    maximum: int

    @property
    def within_tolerance(self) -> bool:
        return self.mean < MEAN_LIMIT and self.percentile < PERCENTILE_LIMIT

    def __str__(self) -> str:
        return (
            f"mean {self.mean:.3f} (limit {MEAN_LIMIT}), {PERCENTILE}th percentile {self.percentile:.1f} "
            f"(limit {PERCENTILE_LIMIT}), maximum {self.maximum}, in 8-bit steps"
        )


def load(path: Path) -> Picture:
    """(H, W, 3) uint8 of a PNG."""
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB"))


def difference(actual: Picture, expected: Picture) -> Difference:
    """How far two pictures of one size, (H, W, 3) uint8, are apart."""
    assert actual.shape == expected.shape, f"sizes differ: {actual.shape} and {expected.shape}"
    steps = np.abs(actual.astype(np.int16) - expected.astype(np.int16))
    return Difference(float(steps.mean()), float(np.percentile(steps, PERCENTILE)), int(steps.max()))


def keep_failure(folder: Path, name: str, actual: Picture, expected: Picture | None) -> list[Path]:
    """Writes NAME.actual.png, and NAME.diff.png when there is something to compare with; returns the paths."""
    folder.mkdir(exist_ok=True)
    kept = [folder / f"{name}.actual.png"]
    Image.fromarray(actual).save(kept[0])
    if expected is not None and expected.shape == actual.shape:
        steps = np.abs(actual.astype(np.int32) - expected.astype(np.int32)) * DIFF_GAIN
        kept.append(folder / f"{name}.diff.png")
        Image.fromarray(np.minimum(steps, 255).astype(np.uint8)).save(kept[1])
    return kept
