"""Caustic maps whose texels crowd where the caustic is sharp (rectilinear texture warping, Rosen 2012, for caustics).

A map's error is at its folds and foci: the irradiance there changes from texel to texel. Each axis of the window is
stretched on its own, by the caustic's energy that a coarse light found along it; nowhere is the warped map coarser than
the map without warp, since texels are added, not moved. One map takes the place of a cascade of nested ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from glcaustics.scene.model import FloatArray

SEGMENTS = 512  # of an axis, between which the density of texels is piecewise linear
LEVELS = (128, 512)  # bins of the window's axes: the coarse light shows folds in wide ones, foci in narrow ones
SMOOTHING = 1.0  # standard deviation, bins: the coarse light's grain must not show
GROWTH = 0.5  # texels that are added to an axis, as a share
FLAT, SHARP = 2.0, 4.0  # largest share of energy over its mean at which an axis begins to be warped, and is in full
TABLE_ROWS = 4  # of the texture: two of segments, two of texel widths


@dataclass(frozen=True, eq=False)
class MapWarp:
    """From the texels of a window (a receiver view with one face) to those of its warped map.

    `window`, `size`: texels (width, height) of both. `rates`: for each axis (SEGMENTS + 1,), texels of the map in one
    of the window, at the segments' ends, linear between.
    """

    window: tuple[int, int]
    size: tuple[int, int]
    rates: tuple[FloatArray, FloatArray]

    def table(self) -> FloatArray:
        """(4, `table_width`, 4) float32 for `interface/map_warp.glsl`: a row of segments an axis (first texel from the
        map's middle, rate there, its growth over the segment, texels of the window in it), then a row an axis of the
        widths of the map's columns and rows in texels of the window.
        """
        table = np.zeros((TABLE_ROWS, self.table_width, 4), np.float32)
        for axis, (texels, size, rate) in enumerate(zip(self.window, self.size, self.rates, strict=True)):
            step = texels / SEGMENTS
            knots = _knots(rate, step)
            table[axis, :SEGMENTS, 0] = knots[:-1] - 0.5 * size
            table[axis, :SEGMENTS, 1] = rate[:-1]
            table[axis, :SEGMENTS, 2] = np.diff(rate)
            table[axis, :SEGMENTS, 3] = step
            table[2 + axis, :size, 0] = np.diff(_unwarped(np.arange(size + 1.0), knots, rate, step))
        return table

    @property
    def table_width(self) -> int:
        return max(SEGMENTS, *self.size)


def _knots(rate: FloatArray, step: float) -> FloatArray:
    """Texels of the map up to each end of a segment."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * step)])


def _unwarped(places: FloatArray, knots: FloatArray, rate: FloatArray, step: float) -> FloatArray:
    """Texels of the window for places in the map: the root of a quadratic in each segment."""
    segment = np.clip(np.searchsorted(knots, places, side="right") - 1, 0, SEGMENTS - 1)
    beyond = np.maximum(places - knots[segment], 0.0) / step
    start, growth = rate[segment], np.diff(rate)[segment]
    root = np.sqrt(np.maximum(start**2 + 2.0 * growth * beyond, 0.0))
    return (segment + np.minimum(2.0 * beyond / (start + root), 1.0)) * step


def fit_warp(u: FloatArray, v: FloatArray, weights: FloatArray, window: tuple[int, int]) -> MapWarp | None:
    """The warp for light that lands at (u, v), clip space, with these fluxes; None where none is called for.

    The error that texels of width h(x) leave is about the sum of q h, q the marginal of the irradiance's square; with
    the number of texels given, h ~ q^-1/2 makes it least. That is what the added texels follow.
    """
    sizes, rates = [], []
    for axis, texels in enumerate(window):
        share = np.mean([_need(u, v, weights, axis, bins) for bins in LEVELS], axis=0)
        t = min(max((float(share.max()) - FLAT) / (SHARP - FLAT), 0.0), 1.0)
        growth = GROWTH * t * t * (3.0 - 2.0 * t)
        size = 8 * math.ceil(texels * (1.0 + growth) / 8.0 - 1e-9)
        rate = 1.0 + growth * share
        sizes.append(size)
        rates.append(rate * (size / texels / _mean(rate)))
    if tuple(sizes) == tuple(window):
        return None
    return MapWarp(window, (sizes[0], sizes[1]), (rates[0], rates[1]))


def _need(u: FloatArray, v: FloatArray, weights: FloatArray, axis: int, bins: int) -> FloatArray:
    """q^1/2 at the segments' ends (SEGMENTS + 1,), of mean 1, by a histogram of bins x bins."""
    energy = _histogram(u, v, weights, bins) ** 2
    need = _smooth(np.sqrt(_smooth(energy.sum(axis=1 - axis))))
    ends = np.interp(np.linspace(0.0, 1.0, SEGMENTS + 1), (np.arange(bins) + 0.5) / bins, need)
    return ends / max(_mean(ends), 1e-300)


def _histogram(u: FloatArray, v: FloatArray, weights: FloatArray, bins: int) -> FloatArray:
    """(bins, bins); each sample is shared among the four nearest bins, so that rounding moves no sample as a whole."""
    places = [np.clip((0.5 * x + 0.5) * bins - 0.5, 0.0, bins - 1.000001) for x in (u, v)]
    low = [np.floor(x).astype(np.int64) for x in places]
    part = [x - i for x, i in zip(places, low, strict=True)]
    total = np.zeros(bins * bins)
    for i in (0, 1):
        for j in (0, 1):
            share = np.abs(1 - i - part[0]) * np.abs(1 - j - part[1])
            total += np.bincount((low[0] + i) * bins + low[1] + j, weights * share, bins * bins)
    return total.reshape(bins, bins)


def _mean(ends: FloatArray) -> float:
    """Of what is linear between the segments' ends."""
    return float((0.5 * (ends[1:] + ends[:-1])).mean())


def _smooth(values: FloatArray) -> FloatArray:
    reach = math.ceil(3.0 * SMOOTHING)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / SMOOTHING) ** 2)
    return np.asarray(np.convolve(np.pad(values, reach, mode="edge"), kernel / kernel.sum(), mode="valid"))
