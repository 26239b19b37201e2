"""The table of a report for the README."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glcaustics.bench.analysis import caustics_ms
from glcaustics.bench.equal_error import DENOISED, PTRACER, equal_error, ratio_text
from glcaustics.errors import UsageError

_NAMES = ("scene", "method", "quality")


def table(report: Mapping[str, Any]) -> str:
    """Markdown for the README: per scene and quality the error, the times, and the ratio to the peers' at that error.

    Raises:
        UsageError: the report has no such rows.
    """
    rows = [r for r in report["rows"] if not r.get("overrides")]
    if not any(r["tool"] == "glcaustics" for r in rows):
        remedy = "measure with --parts caustics among them"
        raise UsageError("the report has no measurement of a target", where="--table", remedy=remedy)
    pixels = max(r["pixels"] for r in rows)
    rows = [r for r in rows if r["pixels"] == pixels]
    names = [
        "scene",
        "method",
        "quality",
        "relative RMSE",
        "without foci",
        "FLIP",
        "bias",
        "frame ms",
        "of it caustics",
    ]
    head = " | ".join(["", *names, "times faster than ptracer", "than ptracer + OIDN", ""]).strip()
    entries = {tuple(e[k] for k in _NAMES): e for e in equal_error(rows)}
    lines = [head, "|" + "---|" * 11]
    for row in rows:
        if row["tool"] != "glcaustics" or row["method"] == "none":
            continue
        e = row["errors"]
        own = caustics_ms(rows, row)
        entry = entries.get(tuple(row[k] for k in _NAMES))
        peers = [ratio_text(entry, peer).replace("extrapolated", "extr.") for peer in (PTRACER, DENOISED)]
        cells = [row["scene"], row["method"], row["quality"]]
        cells += [_number(e.get(name), ".4f") for name in ("rrmse", "rrmse_regular", "flip")]
        cells += [_number(e.get("bias"), "+.2%")]
        cells += [f"{row['time_ms']['median']:.0f}", _number(own, ".0f"), *peers]
        lines.append("| " + " | ".join(cells) + " |")
    state = report["machine"]
    several = max((r.get("frames", 1) for r in rows), default=1)
    still = (
        f" Noisy methods: error after {several} frames of a still, which all count for the ratio."
        if several > 1
        else ""
    )
    commit = str(report["commit"] or "no checkout")[:10] + (" with changes" if report["dirty"] else "")
    clock = next(r["time_ms"]["clock"] for r in rows if r["tool"] == "glcaustics")
    lines += [
        "",
        f"Irradiance at {pixels}x{pixels} of each scene's target; {state['gl_renderer']} by {clock}, {state['cpu']}, "
        f"{state['cores']} cores; commit {commit}; `{report['command']}`.{still}",
    ]
    return "\n".join(lines)


def _number(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)
