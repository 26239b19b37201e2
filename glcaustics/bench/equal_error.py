"""How many times faster than what people use today, at equal error: per scene, from the rows of one run.

Raw `ptracer` has a law: its squared error is v / n for n photons, its time t0 + a n. Both are fitted over the measured
counts, so that a time is known for any error; where that lies beyond the last measured error it is extrapolated, and
said to be. Denoised, the error has no law, and stalls: it is interpolated, else bounded by the best measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from glcaustics.bench.analysis import Row, cost_at_error, cost_ms, fit_power

PTRACER, DENOISED = "ptracer", "ptracer+oidn"


@dataclass(frozen=True)
class PhotonLaw:
    """error^2 = `variance` / photons; time = `overhead_ms` + `ms_per_photon` photons. `exponent`: of error against
    photons as measured, freely fitted (-0.5 if the law holds; None with fewer than three counts)."""

    variance: float
    overhead_ms: float
    ms_per_photon: float
    least_error: float
    most_error: float
    exponent: float | None

    def time_ms(self, error: float) -> float:
        """For an error above 0."""
        return self.overhead_ms + self.ms_per_photon * self.variance / error**2

    def kind(self, error: float) -> str:
        """Whether the error lies within the measured ones."""
        if error < self.least_error:
            return "extrapolated"
        return "measured" if error <= self.most_error else "fewer photons than measured"


def photon_law(rows: Sequence[Row]) -> PhotonLaw | None:
    """The law of raw `ptracer`'s rows of one scene and size; None with fewer than two counts.

    The variance is the geometric mean over the counts. The time's line is fitted relative to each time, and neither
    its overhead nor its slope may be negative.
    """
    points = [(r["photons"], r["errors"]["rrmse"], r["time_ms"]["median"]) for r in rows if r["errors"].get("rrmse")]
    points.sort()
    if len({n for n, _, _ in points}) < 2:
        return None
    count, error, time_ms = (np.array(column, np.float64) for column in zip(*points, strict=True))
    variance = float(np.exp(np.mean(np.log(error**2 * count))))
    slope, overhead = np.polyfit(count, time_ms, 1, w=1.0 / time_ms)
    if overhead < 0.0 or slope <= 0.0:
        slope, overhead = time_ms[-1] / count[-1], 0.0
    fit = fit_power(count.tolist(), error.tolist())
    return PhotonLaw(
        variance,
        float(overhead),
        float(slope),
        float(error.min()),
        float(error.max()),
        None if fit is None else fit["exponent"],
    )


def denoised_cost(rows: Sequence[Row], error: float) -> dict[str, Any] | None:
    """Milliseconds of the denoised peer for an error: `ms`, `bound` ("", ">" its best is worse, "<" its first is
    better), `error` that it has then; None without rows."""
    points = [(r["time_ms"]["median"], r["errors"]["rrmse"]) for r in rows if r["errors"].get("rrmse")]
    if not points:
        return None
    cost = cost_at_error(rows, error)
    if cost is not None:
        return {"ms": cost, "bound": "", "error": error}
    best = min(points, key=lambda p: p[1])
    if best[1] > error:
        return {"ms": best[0], "bound": ">", "error": best[1]}
    first = min(points)
    return {"ms": first[0], "bound": "<", "error": first[1]}


def compare(error: float, time_ms: float, raw: Sequence[Row], clean: Sequence[Row]) -> dict[str, Any]:
    """What the peers need for an error that took us `time_ms`; `ratio`: their time over ours."""
    law, found = photon_law(raw), denoised_cost(clean, error)
    result: dict[str, Any] = {"rrmse": error, "ms": time_ms, "law": None if law is None else asdict(law)}
    if law is not None:
        cost = law.time_ms(error)
        result[PTRACER] = {"ms": cost, "ratio": cost / time_ms, "kind": law.kind(error)}
    if found is not None:
        result[DENOISED] = found | {"ratio": found["ms"] / time_ms}
    return result


def equal_error(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """One entry for each of our rows with an error that has a peer at the same scene and size.

    `ms` is of the whole frame, of all frames for an image that took several.
    """
    found = []
    for row in rows:
        error = row["errors"].get("rrmse")
        if row["tool"] != "glcaustics" or row["method"] == "none" or not error or row.get("overrides"):
            continue
        same = [r for r in rows if r["tool"] == "mitsuba" and all(r[k] == row[k] for k in ("scene", "pixels"))]
        raw, clean = ([r for r in same if r["method"] == name] for name in (PTRACER, DENOISED))
        if not raw:
            continue
        entry = compare(error, cost_ms(row), raw, clean)
        entry |= {name: row[name] for name in ("scene", "method", "quality", "pixels")}
        found.append(entry)
    return found


def best_of(entries: Iterable[dict[str, Any]], scene: str, method: str) -> dict[str, Any] | None:
    """The entry of a scene and method with the largest ratio to raw `ptracer`."""
    mine = [e for e in entries if (e["scene"], e["method"]) == (scene, method) and PTRACER in e]
    return max(mine, key=lambda e: float(e[PTRACER]["ratio"]), default=None)


def ratio_text(entry: dict[str, Any] | None, peer: str) -> str:
    """Such as "2600 x (extrapolated)", "> 1.4 x (then 0.108)"; empty without the peer."""
    if entry is None or entry.get(peer) is None:
        return ""
    told = entry[peer]
    number = _short(told["ratio"])
    if peer == PTRACER:
        return f"{number} x" + ("" if told["kind"] == "measured" else f" ({told['kind']})")
    bound = f"{told['bound']} " if told["bound"] else ""
    return f"{bound}{number} x" + (f" (then {told['error']:.3g})" if told["bound"] else "")


def _short(value: float) -> str:
    """Two significant digits without an exponent."""
    if value <= 0.0:
        return "0"
    digits = max(0, 1 - math.floor(math.log10(value)))
    return f"{round(value, 1 - math.floor(math.log10(value))):.{digits}f}"
