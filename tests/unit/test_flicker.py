"""Flicker at surface points, on sequences whose flicker is known."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from glcaustics.errors import UsageError
from glcaustics.metrics import surface_flicker

T, H, W = 24, 40, 60
FloatArray = npt.NDArray[np.float64]


def panned(shift_px: float, pattern_px: float = 9.0) -> tuple[FloatArray, FloatArray]:
    """A wall with stripes, passing by: pictures (T, H, W) of mean 1 and where its points are in each, (T, N, 2)."""
    x, y = np.meshgrid(np.arange(W) + 0.5, np.arange(H) + 0.5)
    pictures = np.stack([1.0 + 0.5 * np.sin(2 * np.pi * (x + k * shift_px) / pattern_px) for k in range(T)])
    start = np.stack([x.ravel(), y.ravel()], axis=1)
    return pictures, np.stack([start - (k * shift_px, 0.0) for k in range(T)])


def test_the_truth_and_a_steady_error_do_not_flicker() -> None:
    truth, points = panned(0.7)
    assert surface_flicker(truth, truth, points) == 0.0
    assert surface_flicker(truth + 0.3, truth, points) == pytest.approx(0.0, abs=1e-12)


def test_an_error_that_sticks_to_the_surface_does_not_flicker_and_one_that_sticks_to_the_screen_does() -> None:
    """Pan by whole pixels, so that looking up does not blur."""
    truth, points = panned(1.0)
    x = np.arange(W) + 0.5
    on_surface = np.stack([0.2 * np.sin((x + k) * 0.9) * np.ones((H, 1)) for k in range(T)])
    on_screen = 0.2 * np.sin(x * 0.9) * np.ones((T, H, 1))
    assert surface_flicker(truth + on_surface, truth, points) == pytest.approx(0.0, abs=1e-12)
    assert surface_flicker(truth + on_screen, truth, points) == pytest.approx(0.2 / np.sqrt(2), rel=0.1)


@pytest.mark.parametrize(("shift_px", "left"), [(0.0, 1.0), (1.0, 1.0), (0.37, np.sqrt(2.0 / 3.0))])
def test_noise_flickers_by_its_standard_deviation(shift_px: float, left: float) -> None:
    """Along one axis a bilinear look-up leaves 2/3 of the variance; 0.37 T covers the pixel evenly."""
    truth, points = panned(shift_px)
    noise = np.random.default_rng(3).normal(0.0, 0.1, truth.shape)
    assert surface_flicker(truth + noise, truth, points) == pytest.approx(0.1 * left, rel=0.03)


def test_points_that_are_not_seen_do_not_count() -> None:
    truth, points = panned(0.0)
    frames = truth.copy()
    frames[3:9, :, :20] += 5.0
    hidden = points.copy()
    hidden[:, points[0, :, 0] < 20.5] = np.nan
    assert surface_flicker(frames, truth, points) > 0.5
    assert surface_flicker(frames, truth, hidden) == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(UsageError, match="no point"):
        surface_flicker(frames, truth, np.full_like(points, np.nan))
    with pytest.raises(UsageError, match="points"):
        surface_flicker(frames, truth, points[1:])
