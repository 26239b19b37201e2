"""Flicker at surface points, on sequences whose flicker is known."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from glcaustics.errors import UsageError
from glcaustics.metrics import surface_flicker

T, H, W = 24, 40, 60
FloatArray = npt.NDArray[np.float64]
X, Y = np.meshgrid(np.arange(W) + 0.5, np.arange(H) + 0.5)
SINE = np.sqrt(0.5 * T / (T - 1))  # sample standard deviation of one over whole periods
STEADY_LEFT, EVEN_LEFT = np.sqrt(0.5), np.sqrt(151.0 / 315.0)  # of noise along one axis: at a pixel, at any place


def followed(shift_px: float) -> FloatArray:
    """Points of a wall that passes by, (T, N, 2)."""
    start = np.stack([X.ravel(), Y.ravel()], axis=1)
    return np.stack([start - (k * shift_px, 0.0) for k in range(T)])


def stripes(shift_px: float, pattern_px: float = 9.0, amplitude: float = 0.5) -> FloatArray:
    """Pictures (T, H, W) of that wall's stripes, mean 1, sampled at the pixels' middles."""
    return np.stack([1.0 + amplitude * np.sin(2 * np.pi * (X + k * shift_px) / pattern_px) for k in range(T)])


@pytest.mark.parametrize(("pattern_px", "most"), [(9.0, 2e-4), (4.0, 6e-3)])
def test_what_sticks_to_the_surface_does_not_flicker(pattern_px: float, most: float) -> None:
    """The picture itself, too bright, too flat, or with an error: no reference is sampled at pixels. 0.37 px: no two
    frames alike."""
    shown, points = stripes(0.37, pattern_px), followed(0.37)
    wrong = stripes(0.37, pattern_px * 1.3, 0.2)
    for frames in (shown, shown + 0.3, 1.0 + 0.2 * (shown - 1.0), shown + wrong - 1.0):
        assert surface_flicker(frames, points) < most


def test_detail_finer_than_a_pixel_shimmers_even_if_a_converged_picture_shows_it_so() -> None:
    """Sampled at pixels, stripes of 10 / 11 px look like stripes of 10 px, that run over the wall as the pixels do."""
    shift, amplitude = 0.37, 0.5
    shimmer = surface_flicker(stripes(shift, 10.0 / 11.0, amplitude), followed(shift))
    assert shimmer == pytest.approx(amplitude * SINE * np.sinc(0.1) ** 4, rel=0.02)
    assert surface_flicker(np.ones((T, H, W)), followed(shift)) == pytest.approx(0.0, abs=1e-12)


def test_an_error_that_sticks_to_the_screen_flickers() -> None:
    on_screen = 0.2 * np.sin(2 * np.pi * X / 8.0) * np.ones((T, H, 1))
    expected = 0.2 * SINE * np.sinc(1 / 8) ** 4
    assert surface_flicker(1.0 + on_screen, followed(1.0)) == pytest.approx(expected, rel=0.03)


def test_lag_behind_moving_light_flickers_and_the_light_itself_does_not() -> None:
    """Stripes of light run over a wall that stands still. One frame behind: the difference of two sines."""
    period_px, speed_px = 12.0, 1.5
    pictures, points = stripes(speed_px, period_px), followed(0.0)
    footprint = np.sinc(1 / period_px) ** 4
    truth = 1.0 + footprint * (pictures.reshape(T, -1) - 1.0)
    assert surface_flicker(pictures, points) == pytest.approx(0.5 * SINE * footprint, rel=0.02)
    assert surface_flicker(pictures, points, truth) < 1e-3
    late = np.concatenate([stripes(speed_px, period_px)[:1], pictures[:-1]])[1:]
    expected = 0.5 * SINE * 2.0 * np.sin(np.pi * speed_px / period_px) * footprint
    assert surface_flicker(late, points[1:], truth[1:]) == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(("shift_px", "left"), [(0.0, STEADY_LEFT), (1.0, STEADY_LEFT), (0.37, EVEN_LEFT)])
def test_noise_flickers_by_its_standard_deviation_alike_between_pixels(shift_px: float, left: float) -> None:
    noise = np.random.default_rng(3).normal(0.0, 0.1, (T, H, W))
    expected = 0.1 * STEADY_LEFT * left
    assert surface_flicker(1.0 + noise, followed(shift_px)) == pytest.approx(expected, rel=0.03)
    assert EVEN_LEFT == pytest.approx(STEADY_LEFT, rel=0.04)


def test_points_that_are_not_seen_do_not_count() -> None:
    frames, points = np.ones((T, H, W, 3)), followed(0.0)
    frames[3:9, :, :20] += 5.0
    hidden = points.copy()
    hidden[:, points[0, :, 0] < 22.5] = np.nan
    assert surface_flicker(frames, points) > 0.5
    assert surface_flicker(frames, hidden) == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(UsageError, match="no point"):
        surface_flicker(frames, np.full_like(points, np.nan))
    with pytest.raises(UsageError, match="points"):
        surface_flicker(frames, points[1:])
    with pytest.raises(UsageError, match="truth"):
        surface_flicker(frames, points, np.ones((T, 3)))
