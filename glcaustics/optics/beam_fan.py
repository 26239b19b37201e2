"""One-parameter families of beams: irradiance by summing over preimages, and flux binned without noise.

Every closed form whose light map is one-dimensional (water waves along x, a sphere along its radius) is such a family.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
COMPLEX_STEP = 1e-30  # derivative by Im f(u + ih) / h: exact to rounding, since nothing is subtracted
BISECTIONS = 60
QUERIES_PER_CHUNK = 4096


@dataclass(frozen=True)
class BeamFan:
    """Beams with parameter u, which land at `landing_m(u)` and carry `flux_per_u(u)` du.

    `landing_m` must be analytic (it is evaluated off the real axis for its derivative) and may give NaN where a beam
    does not land. `radial`: the landing coordinate is a signed radius and the flux that of the whole ring.
    """

    landing_m: Callable[[npt.NDArray[np.complexfloating] | FloatArray], npt.NDArray[np.inexact]]
    flux_per_u: Callable[[FloatArray], FloatArray]
    u_min: float
    u_max: float
    radial: bool = False

    def landing_derivative(self, u: FloatArray) -> FloatArray:
        """d landing / du at real parameters, same shape."""
        return np.asarray(self.landing_m(u + 1j * COMPLEX_STEP).imag / COMPLEX_STEP, np.float64)

    def irradiance(self, at_m: npt.ArrayLike, intervals: int = 4096) -> FloatArray:
        """Irradiance at landing coordinates (or radii > 0): sum over preimages of flux_per_u / |d landing / du|.

        Args:
            at_m: receiver coordinates, any shape, metres.
            intervals: parameter intervals searched for one sign change each. Pairs of preimages closer than one
                interval (at a fold) are missed, on a strip of width O(intervals^-2).

        Returns:
            W/m^2 for a radial family, else W/m per metre along the invariant axis, which is W/m^2 as well.
        """
        at = np.asarray(at_m, np.float64)
        flat = np.abs(at).ravel() if self.radial else at.ravel()
        u = np.linspace(self.u_min, self.u_max, intervals + 1)
        landing = np.asarray(self.landing_m(u), np.float64)
        total = np.zeros_like(flat)
        for start in range(0, flat.size, QUERIES_PER_CHUNK):
            chunk = flat[start : start + QUERIES_PER_CHUNK]
            for sign in (1.0, -1.0) if self.radial else (1.0,):
                total[start : start + QUERIES_PER_CHUNK] += self._sum_preimages(u, landing, sign * chunk)
        return (total / (2.0 * np.pi * flat) if self.radial else total).reshape(at.shape)

    def _sum_preimages(self, u: FloatArray, landing: FloatArray, targets: FloatArray) -> FloatArray:
        with np.errstate(invalid="ignore"):
            above = landing[None, :] > targets[:, None]
        finite = np.isfinite(landing)
        crossing = (above[:, 1:] != above[:, :-1]) & (finite[1:] & finite[:-1])[None, :]
        query, interval = np.nonzero(crossing)
        low, high, target = u[interval], u[interval + 1], targets[query]
        low_above = above[query, interval]
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            same = (np.asarray(self.landing_m(middle), np.float64) > target) == low_above
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        root = 0.5 * (low + high)
        density = self.flux_per_u(root) / np.abs(self.landing_derivative(root))
        return np.asarray(np.bincount(query, density, minlength=targets.size), np.float64)

    def bin_flux(self, edges_m: FloatArray, beams: int = 1 << 19) -> FloatArray:
        """Flux that lands in each bin (or ring), (B,), from B + 1 ascending edges; noise free, error O(beams^-2)."""
        u = np.linspace(self.u_min, self.u_max, beams + 1)
        landing = np.asarray(self.landing_m(u), np.float64)
        edges = np.asarray(edges_m, np.float64)
        if self.radial:  # a ring's area grows with r^2, so constant irradiance within a beam is linear in r^2
            landing, edges = landing**2, edges**2
        return deposit_segments(landing[:-1], landing[1:], self.beam_flux(u), edges)

    def beam_flux(self, u: FloatArray) -> FloatArray:
        """Flux of the beams between ascending parameters (B + 1,), by Simpson's rule, (B,)."""
        middle = self.flux_per_u(0.5 * (u[1:] + u[:-1]))
        ends = self.flux_per_u(u)
        return np.asarray((ends[1:] + ends[:-1] + 4.0 * middle) * np.diff(u) / 6.0)

    def total_flux(self, beams: int = 1 << 16) -> float:
        """Flux of all beams, whether they land or not."""
        return float(self.beam_flux(np.linspace(self.u_min, self.u_max, beams + 1)).sum())


def deposit_segments(start: FloatArray, end: FloatArray, flux: FloatArray, edges: FloatArray) -> FloatArray:
    """Spread the flux of each segment evenly over its length and sum it per bin: conservative box filtering in 1-D.

    Args:
        start, end: (S,) ends of the segments in either order; a segment with an end that is NaN is left out.
        flux: (S,) flux of each segment.
        edges: (B + 1,) ascending bin edges. What falls outside is not counted.

    Returns:
        (B,) flux per bin.
    """
    keep = np.isfinite(start) & np.isfinite(end)
    low, high, flux = np.minimum(start, end)[keep], np.maximum(start, end)[keep], flux[keep]
    bins = edges.size - 1
    first = np.searchsorted(edges, low, side="right")  # 0: below the first edge
    last = np.searchsorted(edges, high, side="right")
    inside = first == last
    total = np.bincount(first[inside], flux[inside], minlength=bins + 2)
    low, high, flux, first, last = low[~inside], high[~inside], flux[~inside], first[~inside], last[~inside]
    count = last - first + 1
    owner = np.repeat(np.arange(low.size), count)
    cell = np.arange(owner.size) - np.repeat(np.cumsum(count) - count, count) + first[owner]
    padded = np.concatenate(([-np.inf], edges, [np.inf]))
    overlap = np.minimum(high[owner], padded[cell + 1]) - np.maximum(low[owner], padded[cell])
    total += np.bincount(cell, flux[owner] * overlap / (high - low)[owner], minlength=bins + 2)
    return np.asarray(total[1:-1])
