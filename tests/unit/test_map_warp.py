"""Warps of caustic maps: texels crowd where light does, none is lost, and the table is what the shader needs."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from glcaustics.caustics.map_warp import SEGMENTS, MapWarp, fit_warp

FloatArray = npt.NDArray[Any]
WINDOW = (304, 200)


def lit(spot_share: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """An even grid of light, and a share of the flux in a spot a hundredth as wide, at (0.3, -0.2)."""
    side = np.linspace(-0.99, 0.99, 100)
    u, v = (x.ravel() for x in np.meshgrid(side, side))
    weights = np.full(2 * u.size, (1.0 - spot_share) / u.size)
    weights[u.size :] = spot_share / u.size
    return np.concatenate([u, 0.3 + 0.01 * u]), np.concatenate([v, -0.2 + 0.01 * v]), weights


def fitted() -> MapWarp:
    warp = fit_warp(*lit(0.8), WINDOW)
    assert warp is not None
    return warp


def in_map(table: FloatArray, axis: int, texels: int, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`warp_axis` of interface/map_warp.glsl: place in the map from its middle, and rate."""
    place = (at / texels + 0.5) * SEGMENTS
    segment = np.clip(np.floor(place), 0, SEGMENTS - 1).astype(int)
    s = table[axis, segment].astype(np.float64)
    t = place - segment
    inside = np.clip(t, 0.0, 1.0)
    rate = s[:, 1] + s[:, 2] * inside
    return s[:, 0] + s[:, 3] * ((s[:, 1] + 0.5 * s[:, 2] * inside) * inside + (t - inside) * rate), rate


def test_even_light_gets_no_warp() -> None:
    assert fit_warp(*lit(0.0), WINDOW) is None


def test_texels_crowd_at_the_spot_and_are_nowhere_wider_than_before() -> None:
    warp = fitted()
    for rate, at in zip(warp.rates, (0.3, -0.2), strict=True):
        spot = round((0.5 * at + 0.5) * SEGMENTS)
        assert rate[spot] > 5.0
        assert rate.min() >= 1.0 - 1e-9
        assert abs(int(np.argmax(rate)) - spot) <= 3


@pytest.mark.parametrize("axis", [0, 1])
def test_the_table_is_a_bijection_whose_widths_add_up(axis: int) -> None:
    warp = fitted()
    table, texels, size = warp.table(), warp.window[axis], warp.size[axis]
    widths = table[2 + axis, :size, 0].astype(np.float64)
    assert widths.min() > 0.0
    assert widths.sum() == pytest.approx(texels, rel=1e-6)
    edges = np.concatenate([[0.0], np.cumsum(widths)]) - 0.5 * texels
    places, rate = in_map(table, axis, texels, edges)
    np.testing.assert_allclose(places, np.arange(size + 1) - 0.5 * size, atol=2e-3 * rate.max())
    step = 1e-3
    slope = (in_map(table, axis, texels, edges + step)[0] - in_map(table, axis, texels, edges - step)[0]) / (2 * step)
    np.testing.assert_allclose(slope, rate, rtol=0.05)


def test_samples_that_move_by_rounding_change_nothing() -> None:
    u, v, weights = lit(0.8)
    one, other = fitted(), fit_warp(u * (1.0 + 1e-7), v * (1.0 - 1e-7), weights, WINDOW)
    assert other is not None and other.size == one.size
    for a, b in zip(one.rates, other.rates, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-4)
