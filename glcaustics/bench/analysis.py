"""What rows say together: scaling exponents, Pareto front, regressions against a stored report."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

Row = Mapping[str, Any]
ERROR_RATIO, ERROR_FLOOR = 1.15, 0.003  # noise of random methods and of the references stays below these
# Growth of a frame's time over the run without caustics, which takes the machine's speed out. A single row on a busy
# machine is off by a factor of two now and then; the median over a method's rows is not.
TIME_RATIO, TIME_RATIO_MEDIAN = 3.0, 1.4
SOLVE, BASE = "refraction/first", "sousa"  # the stage that solves, and the solver that only estimates


def fit_power(x: Sequence[float], y: Sequence[float]) -> dict[str, float] | None:
    """Least squares of log y = exponent log x + log factor; None with fewer than three usable points.

    `spread`: largest factor by which a point is off the line.
    """
    points = [(a, b) for a, b in zip(x, y, strict=True) if a > 0 and b > 0]
    if len(points) < 3:
        return None
    lx, ly = np.log(np.array(points)).T
    if np.ptp(lx) == 0.0:
        return None
    exponent, offset = np.polyfit(lx, ly, 1)
    spread = float(np.exp(np.abs(ly - exponent * lx - offset).max()))
    return {"exponent": float(exponent), "factor": float(np.exp(offset)), "spread": spread}


def pareto(points: Iterable[tuple[float, float]]) -> list[int]:
    """Indices of the points (cost, error) that no other one beats in both, by rising cost."""
    listed = list(points)
    front: list[int] = []
    best = math.inf
    for index in sorted(range(len(listed)), key=lambda i: listed[i]):
        if listed[index][1] < best:
            front.append(index)
            best = listed[index][1]
    return front


def cost_at_error(rows: Sequence[Row], error: float) -> float | None:
    """Milliseconds that a tool needs for an error, interpolated on the log-log line between its rows.

    None when its rows do not reach that far: nothing is extrapolated.
    """
    points = sorted((r["time_ms"]["median"], r["errors"]["rrmse"]) for r in rows if r["errors"].get("rrmse"))
    for (t0, e0), (t1, e1) in zip(points, points[1:], strict=False):
        if e1 <= error <= e0 and e0 > e1:
            share = math.log(e0 / error) / math.log(e0 / e1)
            return float(t0 * (t1 / t0) ** share)
    return None


def solve_cost(costs: Mapping[str, Mapping[str, float]], solver: str) -> float | None:
    """Fetch passes of a solver's solve alone: its first stage less that of Sousa's estimate, which shades the same."""
    first, base = (costs.get(name, {}).get(SOLVE) for name in (solver, BASE))
    return None if first is None or base is None else max(first - base, 0.0)


def cost_ms(row: Row) -> float:
    """Milliseconds that a row's image took: one frame's, times its frames."""
    return float(row["time_ms"]["median"]) * int(row.get("frames", 1))


def row_id(row: Row) -> str:
    """What makes two rows of two reports the same measurement."""
    parts = [row["scene"], row["tool"], row["method"], row["quality"], f"{row['pixels']}px"]
    return " ".join(str(p) for p in parts)


def caustics_ms(rows: Sequence[Row], row: Row) -> float | None:
    """The frame's median less that of the same frame without caustics; None without such a row."""
    base = _without_caustics(rows, row)
    return None if base is None else float(row["time_ms"]["median"] - base["time_ms"]["median"])


def relative_time(rows: Sequence[Row], row: Row) -> float | None:
    """The frame's least time over that of the same frame without caustics; None without such a row."""
    base = _without_caustics(rows, row)
    return None if base is None else float(row["time_ms"]["min"] / base["time_ms"]["min"])


def _without_caustics(rows: Sequence[Row], row: Row) -> Row | None:
    same = ("scene", "tool", "quality", "pixels")
    found = (r for r in rows if r["method"] == "none" and all(r[k] == row[k] for k in same))
    return next(found, None)


def regressions(stored: Mapping[str, Any], new: Mapping[str, Any]) -> tuple[list[str], int]:
    """What got worse, one line each, and how many rows were compared.

    Errors are compared by ratio with a floor. Times are compared as ratios to the same run's frame without caustics, so
    that a faster or busier machine does not count.
    """
    before = {row_id(r): r for r in stored["rows"]}
    worse, compared = [], 0
    growth: dict[str, list[float]] = {}
    for row in new["rows"]:
        old = before.get(row_id(row))
        if old is None or row["tool"] != "glcaustics" or row["method"] == "none":
            continue
        compared += 1
        worse += _error_regression(old, row)
        was, now = relative_time(stored["rows"], old), relative_time(new["rows"], row)
        if was and now:
            growth.setdefault(row["method"], []).append(now / was)
            if now > TIME_RATIO * was:
                worse.append(f"{row_id(row)}: {now:.2f} times the frame without caustics, was {was:.2f}")
    for method, ratios in growth.items():
        if (middle := statistics.median(ratios)) > TIME_RATIO_MEDIAN:
            worse.append(
                f"{method}: {middle:.2f} times as slow, beside the frame without caustics, in the median of rows"
            )
    return worse, compared


def _error_regression(old: Row, row: Row) -> list[str]:
    if row["errors"]["non_finite"] > old["errors"]["non_finite"]:
        return [f"{row_id(row)}: {row['errors']['non_finite']:.2%} of the pixels are not finite"]
    was, now = old["errors"].get("rrmse"), row["errors"].get("rrmse")
    if was is None or now is None or now <= ERROR_RATIO * was + ERROR_FLOOR:
        return []
    return [f"{row_id(row)}: relative RMSE {now:.4f}, was {was:.4f} (allowed {ERROR_RATIO * was + ERROR_FLOOR:.4f})"]
