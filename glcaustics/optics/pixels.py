"""Box filters: exact averages of radial irradiance over pixels, coverage of a strip, and reduction of images."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError

FloatArray = npt.NDArray[np.float64]


def pixel_edges(half_extent_m: float, pixels: int, centre_m: float = 0.0) -> FloatArray:
    """Edges (pixels + 1,) of equal pixels over centre +- half extent, metres."""
    return np.linspace(centre_m - half_extent_m, centre_m + half_extent_m, pixels + 1)


def pixel_areas(x_edges_m: FloatArray, z_edges_m: FloatArray) -> FloatArray:
    """Area of each pixel, (Z, X), m^2."""
    return np.outer(np.diff(z_edges_m), np.diff(x_edges_m))


def interval_coverage(edges_m: FloatArray, low_m: float, high_m: float) -> FloatArray:
    """Share of each bin (B,) that the interval [low, high] covers."""
    overlap = np.minimum(edges_m[1:], high_m) - np.maximum(edges_m[:-1], low_m)
    return np.asarray(np.clip(overlap, 0.0, None) / np.diff(edges_m))


def box_filter(image: npt.ArrayLike, size: tuple[int, int]) -> FloatArray:
    """Mean over whole blocks: (H, W, ...) -> (rows, columns, ...), float64.

    Raises:
        UsageError: a size that does not divide the image's.
    """
    pixels = np.asarray(image, np.float64)
    rows, columns = size
    height, width = pixels.shape[:2]
    if height % rows or width % columns:
        raise UsageError(
            f"an image of {width}x{height} does not reduce to {columns}x{rows}",
            where="box_filter",
            remedy="choose a size that divides the image's",
        )
    blocks = pixels.reshape(rows, height // rows, columns, width // columns, *pixels.shape[2:])
    return np.asarray(blocks.mean(axis=(1, 3)))


def bin_points(
    x: FloatArray, z: FloatArray, flux: npt.NDArray[np.floating], x_edges: FloatArray, z_edges: FloatArray
) -> FloatArray:
    """Sum of the flux of points per pixel of an even grid, flattened (Z * X,); points outside are left out."""
    columns, rows = x_edges.size - 1, z_edges.size - 1
    column = np.floor((x - x_edges[0]) * (columns / (x_edges[-1] - x_edges[0]))).astype(np.int64)
    row = np.floor((z - z_edges[0]) * (rows / (z_edges[-1] - z_edges[0]))).astype(np.int64)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    total = np.bincount((row * columns + column)[inside], flux[inside], minlength=rows * columns)
    return np.asarray(total, np.float64)


def disc_quadrant_area(x: npt.ArrayLike, z: npt.ArrayLike, radius: npt.ArrayLike) -> FloatArray:
    """Signed area of the part of a disc at the origin between the axes and (x, z), any signs; broadcast arrays.

    Area of the disc over [x0, x1] x [z0, z1] is A(x1, z1) - A(x0, z1) - A(x1, z0) + A(x0, z0). For positive x, z
    inside the circle's box: x z if the corner lies inside the disc, else the rectangle up to the two intersections
    plus the sector between them (elementary geometry).
    """
    x, z, radius = np.broadcast_arrays(np.asarray(x, float), np.asarray(z, float), np.asarray(radius, float))
    a, b = np.minimum(np.abs(x), radius), np.minimum(np.abs(z), radius)
    b_at_a, a_at_b = np.sqrt(radius**2 - a**2), np.sqrt(radius**2 - b**2)
    angle = np.arctan2(b, a_at_b) - np.arctan2(b_at_a, a)
    outside = 0.5 * (a * b_at_a + b * a_at_b + radius**2 * angle)
    return np.asarray(np.sign(x) * np.sign(z) * np.where(a**2 + b**2 <= radius**2, a * b, outside))


def radial_to_pixels(
    ring_flux: FloatArray, ring_edges_m: FloatArray, x_edges_m: FloatArray, z_edges_m: FloatArray
) -> FloatArray:
    """Average irradiance (Z, X) of pixels, W/m^2, from the flux of thin rings around the origin.

    Each ring's flux is spread evenly over the ring, and cut by the exact area of ring and pixel; so the error is that
    of rings much thinner than a pixel, and no flux is lost.
    """
    x_low, z_low = np.meshgrid(x_edges_m[:-1], z_edges_m[:-1])
    x_high, z_high = np.meshgrid(x_edges_m[1:], z_edges_m[1:])
    nearest = np.hypot(np.maximum(np.maximum(x_low, -x_high), 0.0), np.maximum(np.maximum(z_low, -z_high), 0.0)).ravel()
    farthest = np.hypot(np.maximum(np.abs(x_low), np.abs(x_high)), np.maximum(np.abs(z_low), np.abs(z_high))).ravel()
    corners = [side.ravel() for side in (x_low, x_high, z_low, z_high)]
    flux = np.zeros(nearest.size)
    ring_area = np.pi * np.diff(ring_edges_m**2)
    for ring in np.flatnonzero(ring_flux):
        inner, outer = ring_edges_m[ring], ring_edges_m[ring + 1]
        cut = np.flatnonzero((nearest < outer) & (farthest > inner))
        x0, x1, z0, z1 = (side[cut] for side in corners)
        area = _disc_pixel_area(x0, x1, z0, z1, outer) - _disc_pixel_area(x0, x1, z0, z1, inner)
        flux[cut] += ring_flux[ring] / ring_area[ring] * area
    return flux.reshape(x_low.shape) / pixel_areas(x_edges_m, z_edges_m)


def _disc_pixel_area(x0: FloatArray, x1: FloatArray, z0: FloatArray, z1: FloatArray, radius: float) -> FloatArray:
    return np.asarray(
        disc_quadrant_area(x1, z1, radius)
        - disc_quadrant_area(x0, z1, radius)
        - disc_quadrant_area(x1, z0, radius)
        + disc_quadrant_area(x0, z0, radius)
    )
