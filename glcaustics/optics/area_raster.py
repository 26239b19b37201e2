"""Exact area coverage: spreads the flux of triangles evenly over their area and sums it per pixel, without sampling.

Signed areas to the right of every edge are accumulated per pixel and summed along the rows, as font rasterisers do
(R. Levien, font-rs, 2016): each pixel gets the exact area of its overlap, so the sum of all pixels is the flux.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
MIN_AREA_PX = 1e-9  # below it density * rounding would matter: such a triangle is a point
EDGES_PER_CHUNK = 1 << 17


class AreaRaster:
    """Sum of triangles and points in pixel coordinates: x in [0, width), y in [0, height), pixel (0, 0) at the origin.

    Args:
        width, height: pixels. channels: of the flux.
    """

    def __init__(self, width: int, height: int, channels: int = 3) -> None:
        self.width, self.height, self.channels = width, height, channels
        self._slope = np.zeros((channels, height * (width + 2)))
        self._points = np.zeros((channels, height * width))

    def add_triangles(self, xy_px: FloatArray, flux: FloatArray) -> None:
        """Triangles (n, 3, 2) in pixels and their flux (n, C). What falls outside is not counted."""
        for start in range(0, len(xy_px), EDGES_PER_CHUNK // 3):
            self._add_chunk(xy_px[start : start + EDGES_PER_CHUNK // 3], flux[start : start + EDGES_PER_CHUNK // 3])

    def _add_chunk(self, xy: FloatArray, flux: FloatArray) -> None:
        low = np.minimum(np.minimum(xy[:, 0], xy[:, 1]), xy[:, 2])
        high = np.maximum(np.maximum(xy[:, 0], xy[:, 1]), xy[:, 2])
        near = (high[:, 0] > 0.0) & (low[:, 0] < self.width) & (high[:, 1] > 0.0) & (low[:, 1] < self.height)
        xy, flux = xy[near], flux[near]
        a, b = xy[:, 1] - xy[:, 0], xy[:, 2] - xy[:, 0]
        signed = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        thin = np.abs(signed) < MIN_AREA_PX
        if thin.any():
            self.add_points(xy[thin].reshape(-1, 2), np.repeat(flux[thin] / 3.0, 3, axis=0))
            xy, flux, signed = xy[~thin], flux[~thin], signed[~thin]
        density = flux / signed[:, None]
        start = xy.reshape(-1, 2)
        end = np.roll(xy, -1, axis=1).reshape(-1, 2)
        self._add_edges(start, end, np.repeat(density, 3, axis=0))

    def add_points(self, xy_px: FloatArray, flux: FloatArray) -> None:
        """Points (n, 2) in pixels and their flux (n, C)."""
        column, row = np.floor(xy_px[:, 0]).astype(np.int64), np.floor(xy_px[:, 1]).astype(np.int64)
        inside = (column >= 0) & (column < self.width) & (row >= 0) & (row < self.height)
        pixel = row[inside] * self.width + column[inside]
        for channel in range(self.channels):
            self._points[channel] += np.bincount(pixel, flux[inside, channel], minlength=self._points.shape[1])

    def _add_edges(self, start: FloatArray, end: FloatArray, density: FloatArray) -> None:
        x0, y0, x1, y1 = start[:, 0], start[:, 1], end[:, 0], end[:, 1]
        rate = np.divide(x1 - x0, y1 - y0, out=np.zeros_like(x0), where=y1 != y0)
        low, high = np.minimum(y0, y1), np.maximum(y0, y1)
        first = np.maximum(np.floor(low), 0.0).astype(np.int64)
        last = np.minimum(np.ceil(high) - 1.0, self.height - 1.0).astype(np.int64)
        edge, row = spread_ranges(first, np.where(y1 != y0, last - first + 1, 0))
        y_low, y_high = np.maximum(low[edge], row), np.minimum(high[edge], row + 1.0)
        x_low, x_high = x0[edge] + (y_low - y0[edge]) * rate[edge], x0[edge] + (y_high - y0[edge]) * rate[edge]
        upwards = y1[edge] > y0[edge]
        self._add_row_pieces(x_low, x_high, np.where(upwards, y_low - y_high, y_high - y_low), row, density, edge)

    def _add_row_pieces(
        self, xa: FloatArray, xb: FloatArray, signed_dy: FloatArray, row: IntArray, density: FloatArray, edge: IntArray
    ) -> None:
        """Pieces within one row each, from x = xa to xb, split at the pixel columns; column -1 is all that is left."""
        left, right = np.minimum(xa, xb), np.maximum(xa, xb)
        first = np.clip(np.floor(left), -1.0, self.width).astype(np.int64)
        last = np.clip(np.floor(right), -1.0, self.width).astype(np.int64)
        piece, column = spread_ranges(first, last - first + 1)
        lo = np.where(column == first[piece], left[piece], column)
        hi = np.where(column == last[piece], right[piece], column + 1.0)
        span = (right - left)[piece]
        share = np.divide(hi - lo, span, out=np.ones_like(span), where=span > 0.0)
        dy = signed_dy[piece] * share
        keep = column < self.width
        piece, column, dy = piece[keep], column[keep], dy[keep]
        # area to the right of the piece within its own pixel; a piece left of the image covers column 0 wholly
        own = np.where(column >= 0, column + 1.0 - 0.5 * (lo + hi)[keep], 0.0) * dy
        cell = row[piece] * (self.width + 2) + column + 1
        weights = density[edge[piece]]
        size = self._slope.shape[1]
        for channel in range(self.channels):
            w = weights[:, channel]
            self._slope[channel] += np.bincount(cell, w * own, minlength=size)[:size]
            self._slope[channel] += np.bincount(cell + 1, w * (dy - own), minlength=size)[:size]

    def flux(self) -> FloatArray:
        """Flux per pixel (height, width, C)."""
        rows = self._slope.reshape(self.channels, self.height, self.width + 2)
        areas = np.cumsum(rows, axis=2)[:, :, 1 : self.width + 1]
        return np.asarray(np.moveaxis(areas + self._points.reshape(areas.shape), 0, -1))


def spread_ranges(first: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
    """For each i the numbers first[i] ... first[i] + count[i] - 1: owner index and number, flattened."""
    count = np.maximum(count, 0)
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(owner.size) - np.repeat(np.cumsum(count) - count, count) + first[owner]
