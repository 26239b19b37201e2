"""What the convergence instruments of eye rays and light rays share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

ITERATIONS = tuple(range(8))  # 0: the solver's start alone; as the graphs of Mayer 2026, table 2


def pooled(rows: Sequence[Mapping[str, Any]], weights: Sequence[float]) -> dict[str, Any]:
    """One row for all: numbers of things are summed, shares are averaged by weight.

    Args:
        rows: with equal keys; values are int (summed), float or tuples of float (shares); `iterations`, texts kept.
        weights: of the rows, such as the number of rays that a share counts.
    """
    total = max(float(np.sum(weights)), 1e-30)
    found: dict[str, Any] = {}
    for name, first in rows[0].items():
        values = [row[name] for row in rows]
        if name == "iterations" or isinstance(first, str):
            found[name] = first
        elif isinstance(first, int):
            found[name] = int(sum(values))
        else:
            mean = np.asarray(weights, np.float64) @ np.asarray(values, np.float64) / total
            found[name] = float(mean) if np.ndim(mean) == 0 else tuple(float(v) for v in mean)
    return found
