"""The table of a report for the README."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from glcaustics.bench.analysis import caustics_ms
from glcaustics.bench.equal_error import DENOISED, PTRACER, equal_error, ratio_text
from glcaustics.errors import UsageError

_NAMES = ("scene", "method", "quality")
_HEAD = (
    *_NAMES,
    *("relative RMSE", "without foci", "FLIP", "bias", "frame ms", "of it caustics"),
    *("times faster than ptracer", "than ptracer + OIDN"),
)


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
    entries = {tuple(e[k] for k in _NAMES): e for e in equal_error(rows)}
    lines = [f"| {' | '.join(_HEAD)} |", "|" + "---|" * len(_HEAD)]
    for row in rows:
        if row["tool"] == "glcaustics" and row["method"] != "none":
            entry = entries.get(tuple(row[k] for k in _NAMES))
            lines.append(f"| {' | '.join(_cells(row, caustics_ms(rows, row), entry))} |")
    return "\n".join([*lines, "", _origin(report, rows)])


def _cells(row: Mapping[str, Any], caustics_ms: float | None, entry: dict[str, Any] | None) -> list[str]:
    errors = row["errors"]
    return [
        *(row[name] for name in _NAMES),
        *(_number(errors.get(name), ".4f") for name in ("rrmse", "rrmse_regular", "flip")),
        _number(errors.get("bias"), "+.2%"),
        f"{row['time_ms']['median']:.0f}",
        _number(caustics_ms, ".0f"),
        *(ratio_text(entry, peer).replace("extrapolated", "extr.") for peer in (PTRACER, DENOISED)),
    ]


def _origin(report: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> str:
    """What was measured, with what, where and by which command."""
    state = report["machine"]
    commit = str(report["commit"] or "no checkout")[:10] + (" with changes" if report["dirty"] else "")
    side = rows[0]["pixels"]
    clock = next(r["time_ms"]["clock"] for r in rows if r["tool"] == "glcaustics")
    text = (
        f"Irradiance at {side}x{side} of each scene's target; {state['gl_renderer']} by {clock}, "
        f"{state['cpu']}, {state['cores']} cores; commit {commit}; `{report['command']}`."
    )
    frames = max(r.get("frames", 1) for r in rows)
    if frames > 1:
        text += f" Noisy methods: error after {frames} frames of a still, which all count for the ratio."
    return text


def _number(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)
