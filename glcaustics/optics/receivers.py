"""Where reference beams are added up: a pixel grid on a plane, or single receiver points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from glcaustics.optics.area_raster import AreaRaster, spread_ranges

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
ON_PLANE = 1e-5  # of the plane's larger side: farther off, light has landed on something else
SAME_SIDE = 0.5  # least cosine between a beam's normal and a point's
PAIRS_PER_CHUNK = 1 << 21


def _max3(corners: FloatArray) -> FloatArray:  # along so short an axis, NumPy's own reductions are ten times slower
    return np.asarray(np.maximum(np.maximum(corners[:, 0], corners[:, 1]), corners[:, 2]))


def _min3(corners: FloatArray) -> FloatArray:
    return np.asarray(np.minimum(np.minimum(corners[:, 0], corners[:, 1]), corners[:, 2]))


def _any(mask: BoolArray) -> BoolArray:
    return np.asarray(np.logical_or.reduce([mask[:, k] for k in range(mask.shape[1])]))


def _longest_edge(corners: FloatArray) -> FloatArray:
    edges = [corners[:, k] - corners[:, k - 1] for k in range(3)]
    squares = [np.einsum("ij,ij->i", e, e) for e in edges]
    return np.asarray(np.sqrt(np.maximum(np.maximum(squares[0], squares[1]), squares[2])))


class Receiver(Protocol):
    """What adds up landed beams. Triangles (n, 3, 3), points (n, 3), normals as given by Landings, flux (n, 3)."""

    def catches(self, point_ws: FloatArray, normal_ws: FloatArray) -> BoolArray: ...

    def size_px(self, triangle_ws: FloatArray) -> FloatArray:
        """Longest edge (n,) of landed triangles, in units of the finest detail that the receiver resolves."""

    def add_triangles(self, triangle_ws: FloatArray, normal_ws: FloatArray, flux: FloatArray) -> None: ...

    def add_points(self, point_ws: FloatArray, normal_ws: FloatArray, flux: FloatArray) -> None: ...

    def irradiance(self) -> FloatArray: ...


@dataclass(frozen=True)
class PlaneGrid:
    """A rectangle in world space with pixels: corner + u side_u + v side_v; row 0 at v = 0, column 0 at u = 0.

    `normal_ws`: unit, the side that is lit. `side_u_ws`, `side_v_ws`: perpendicular, metres.
    """

    corner_ws: tuple[float, float, float]
    side_u_ws: tuple[float, float, float]
    side_v_ws: tuple[float, float, float]
    normal_ws: tuple[float, float, float]
    width: int
    height: int

    @staticmethod
    def floor(half_extent_m: float, y_m: float, pixels: int, centre_xz: tuple[float, float] = (0.0, 0.0)) -> PlaneGrid:
        """A horizontal square, u along +x, v along +z, lit from above."""
        h, (x, z) = half_extent_m, centre_xz
        return PlaneGrid((x - h, y_m, z - h), (2.0 * h, 0.0, 0.0), (0.0, 0.0, 2.0 * h), (0.0, 1.0, 0.0), pixels, pixels)

    def points_ws(self) -> FloatArray:
        """Centres of the pixels (height, width, 3)."""
        u = (np.arange(self.width) + 0.5) / self.width
        v = (np.arange(self.height) + 0.5) / self.height
        u, v = np.meshgrid(u, v)
        sides = u[..., None] * np.asarray(self.side_u_ws) + v[..., None] * np.asarray(self.side_v_ws)
        return np.asarray(self.corner_ws) + sides


class PlaneReceiver:
    """Adds beams up on a PlaneGrid."""

    def __init__(self, grid: PlaneGrid) -> None:
        self.grid = grid
        self._corner = np.asarray(grid.corner_ws, np.float64)
        sides = np.array([grid.side_u_ws, grid.side_v_ws], np.float64)
        lengths = np.linalg.norm(sides, axis=1)
        self._per_m = np.array([grid.width, grid.height]) / lengths
        self._axes = sides / lengths[:, None] * self._per_m[:, None]
        self._normal = np.asarray(grid.normal_ws, np.float64)
        self._tolerance_m = ON_PLANE * float(lengths.max())
        self._raster = AreaRaster(grid.width, grid.height)

    def catches(self, point_ws: FloatArray, normal_ws: FloatArray) -> BoolArray:
        off = (point_ws - self._corner) @ self._normal
        return np.asarray((np.abs(off) < self._tolerance_m) & (normal_ws @ self._normal > SAME_SIDE))

    def _pixels(self, point_ws: FloatArray) -> FloatArray:
        return np.asarray((point_ws - self._corner) @ self._axes.T)

    def size_px(self, triangle_ws: FloatArray) -> FloatArray:
        """Longest edge (n,); 0 where the triangle misses the grid and needs no care."""
        xy = self._pixels(triangle_ws)
        size = np.array([self.grid.width, self.grid.height])
        away = _any(_max3(xy) < 0.0) | _any(_min3(xy) > size)
        return np.where(away, 0.0, _longest_edge(xy))

    def add_triangles(self, triangle_ws: FloatArray, normal_ws: FloatArray, flux: FloatArray) -> None:
        self._raster.add_triangles(self._pixels(triangle_ws), flux)

    def add_points(self, point_ws: FloatArray, normal_ws: FloatArray, flux: FloatArray) -> None:
        self._raster.add_points(self._pixels(point_ws), flux)

    def irradiance(self) -> FloatArray:
        """(height, width, 3), W/m^2."""
        return self._raster.flux() * float(self._per_m.prod())

    def flux_w(self) -> FloatArray:
        """Flux on the grid, (3,)."""
        return np.asarray(self._raster.flux().sum(axis=(0, 1)))


class PointReceiver:
    """Irradiance at single points: the density, flux over area, of every landed triangle that covers the point.

    Args:
        points_ws, normals_ws: (n, 3); normals on the lit side.
        detail_m: length that counts as one pixel when beams are refined.
    """

    def __init__(self, points_ws: FloatArray, normals_ws: FloatArray, detail_m: float) -> None:
        self._points, self._normals, self._detail_m = points_ws, normals_ws, detail_m
        self._low = points_ws.min(axis=0) - 4.0 * detail_m
        self._high = points_ws.max(axis=0) + 4.0 * detail_m
        self._cell_m = 4.0 * detail_m
        self._dims = np.ceil((self._high - self._low) / self._cell_m).astype(np.int64) + 1
        cell = self._cell_number(np.floor((points_ws - self._low) / self._cell_m).astype(np.int64))
        self._order = np.argsort(cell, kind="stable")
        self._cells, self._start = np.unique(cell[self._order], return_index=True)
        self._count = np.diff(np.append(self._start, len(cell)))
        self._sum = np.zeros((len(points_ws), 3))

    def _cell_number(self, ijk: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        return np.asarray((ijk[:, 0] * self._dims[1] + ijk[:, 1]) * self._dims[2] + ijk[:, 2])

    def catches(self, point_ws: FloatArray, normal_ws: FloatArray) -> BoolArray:
        return np.ones(len(point_ws), bool)

    def size_px(self, triangle_ws: FloatArray) -> FloatArray:
        away = _any(_max3(triangle_ws) < self._low) | _any(_min3(triangle_ws) > self._high)
        return np.where(away, 0.0, _longest_edge(triangle_ws) / self._detail_m)

    def add_points(self, point_ws: FloatArray, normal_ws: FloatArray, flux: FloatArray) -> None:
        """Point-like light has no density at a point; it is the finest triangles at silhouettes, and is left out."""

    def add_triangles(self, triangle_ws: FloatArray, normal_ws: FloatArray, flux: FloatArray) -> None:
        low, high = triangle_ws.min(axis=1), triangle_ws.max(axis=1)
        reach = 0.25 * (high - low).max(axis=1, keepdims=True)
        low, high = low - reach, high + reach
        near = np.flatnonzero((high > self._low).all(axis=1) & (low < self._high).all(axis=1))
        first = np.maximum(np.floor((low[near] - self._low) / self._cell_m), 0).astype(np.int64)
        last = np.minimum(np.floor((high[near] - self._low) / self._cell_m), self._dims - 1).astype(np.int64)
        span = last - first + 1
        owner, number = spread_ranges(np.zeros(len(near), np.int64), span.prod(axis=1))
        ijk = np.stack(
            [
                number // (span[owner, 1] * span[owner, 2]),
                number // span[owner, 2] % span[owner, 1],
                number % span[owner, 2],
            ],
            axis=1,
        )
        cell = self._cell_number(first[owner] + ijk)
        slot = np.minimum(np.searchsorted(self._cells, cell), len(self._cells) - 1)
        held = self._cells[slot] == cell
        owner, slot = owner[held], slot[held]
        pair, place = spread_ranges(self._start[slot], self._count[slot])
        for begin in range(0, len(pair), PAIRS_PER_CHUNK):
            part = slice(begin, begin + PAIRS_PER_CHUNK)
            self._add_pairs(near[owner[pair[part]]], self._order[place[part]], triangle_ws, normal_ws, flux)

    def _add_pairs(
        self,
        triangle: npt.NDArray[np.int64],
        point: npt.NDArray[np.int64],
        triangle_ws: FloatArray,
        normal_ws: FloatArray,
        flux: FloatArray,
    ) -> None:
        a, b, c = (triangle_ws[triangle, k] for k in range(3))
        e1, e2, offset = b - a, c - a, self._points[point] - a
        face = np.cross(e1, e2)
        area4 = np.maximum(np.einsum("ij,ij->i", face, face), 1e-300)
        v = np.einsum("ij,ij->i", np.cross(offset, e2), face) / area4
        w = np.einsum("ij,ij->i", np.cross(e1, offset), face) / area4
        area2 = np.sqrt(area4)
        longest = np.sqrt(np.maximum(np.einsum("ij,ij->i", e1, e1), np.einsum("ij,ij->i", e2, e2)))
        height = np.abs(np.einsum("ij,ij->i", offset, face)) / area2
        inside = (v >= 0.0) & (w > 0.0) & (v + w <= 1.0) & (height <= 0.25 * longest)
        inside &= np.einsum("ij,ij->i", self._normals[point], normal_ws[triangle]) > SAME_SIDE
        for channel in range(3):
            density = flux[triangle[inside], channel] * 2.0 / area2[inside]
            self._sum[:, channel] += np.bincount(point[inside], density, minlength=len(self._sum))

    def irradiance(self) -> FloatArray:
        """(n, 3), W/m^2."""
        return self._sum
