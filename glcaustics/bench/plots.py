"""The curves as PNG: error against time with the Pareto front, convergence of the peers, scaling of the methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from glcaustics.bench.analysis import cost_ms, fit_power, pareto
from glcaustics.bench.plots_parts import part_plots
from glcaustics.bench.plots_tools import COLORS, MARKERS, log_axes, to_png
from glcaustics.errors import UsageError

Report = Mapping[str, Any]


def plots(report: Report) -> dict[str, bytes]:
    """File name -> PNG.

    Raises:
        UsageError: matplotlib is not installed.
    """
    try:
        import matplotlib
    except ImportError:
        remedy = "pip install 'glcaustics[bench]'"
        raise UsageError("plots need the matplotlib package", where="bench", remedy=remedy) from None
    matplotlib.use("Agg")
    drawn = {}
    if report["rows"]:
        for scene in report["plan"]["scenes"]:
            drawn[f"error-{scene}.png"] = _error_against_time(report, scene)
        drawn["convergence.png"] = _convergence(report)
    for what in dict.fromkeys(s["what"] for s in report["scaling"]):
        if what != "error against time":
            drawn[f"{what.replace(' ', '-')}.png"] = _scaling(report, what)
    return drawn | part_plots(report)


def tools(report: Report) -> list[tuple[str, str]]:
    """(tool, method) of every curve, ours first."""
    names = dict.fromkeys((r["tool"], r["method"]) for r in report["rows"] if r["method"] != "none")
    return sorted(names, key=lambda name: name[0] != "glcaustics")


def judged(report: Report, scene: str) -> list[Mapping[str, Any]]:
    """A scene's rows with an error, at the largest size."""
    rows = [r for r in report["rows"] if r["scene"] == scene and r["errors"].get("rrmse")]
    largest = max((r["pixels"] for r in rows), default=0)
    return [r for r in rows if r["pixels"] == largest]


def _style(report: Report, name: tuple[str, str]) -> dict[str, str]:
    index = tools(report).index(name)
    ours = name[0] == "glcaustics"
    label = name[1] if ours else f"{name[0]} {name[1]}"
    return {
        "color": COLORS[index % len(COLORS)],
        "marker": MARKERS[index % len(MARKERS)],
        "linestyle": "-" if ours else "--",
        "label": label,
    }


def _error_against_time(report: Report, scene: str) -> bytes:
    rows = judged(report, scene)
    clock = next((r["time_ms"]["clock"] for r in rows if r["tool"] == "glcaustics"), "wall clock")
    pixels = rows[0]["pixels"] if rows else 0
    figure, axes = log_axes(
        f"{scene}, {pixels} x {pixels}", f"time of the image, ms ({clock})", "relative RMSE of irradiance"
    )
    points = [(cost_ms(r), r["errors"]["rrmse"]) for r in rows]
    for name in tools(report):
        mine = [(p, r) for p, r in zip(points, rows, strict=True) if (r["tool"], r["method"]) == name]
        mine.sort(key=lambda item: item[0])
        if not mine:
            continue
        x, y = zip(*(p for p, _ in mine), strict=True)
        low = [p[0] - r["time_ms"]["min"] * r.get("frames", 1) for p, r in mine]
        high = [r["time_ms"]["max"] * r.get("frames", 1) - p[0] for p, r in mine]
        style = _style(report, name)
        axes.plot(x, y, markersize=5, linewidth=1.4, **style)
        axes.errorbar(x, y, xerr=(low, high), fmt="none", ecolor=style["color"], elinewidth=0.8, alpha=0.6)
        if name[0] == "glcaustics":
            for point, row in mine:
                axes.annotate(row["quality"], point, textcoords="offset points", xytext=(5, 5), fontsize=7)
    front = [points[i] for i in pareto(points)]
    if len(front) > 1:
        axes.plot(*zip(*front, strict=True), color="black", alpha=0.12, linewidth=9, zorder=0, label="Pareto front")
    if points:
        axes.legend(fontsize=8, frameon=False)
    return to_png(figure)


def _convergence(report: Report) -> bytes:
    figure, axes = log_axes("Convergence of the peers", "photons", "relative RMSE of irradiance")
    for index, scene in enumerate(report["plan"]["scenes"]):
        for method, line in (("ptracer", "-"), ("ptracer+oidn", ":")):
            rows = [r for r in judged(report, scene) if r["tool"] == "mitsuba" and r["method"] == method]
            if not rows:
                continue
            x, y = [r["photons"] for r in rows], [r["errors"]["rrmse"] for r in rows]
            fit = fit_power(x, y)
            slope = f", slope {fit['exponent']:.2f}" if fit else ""
            color = COLORS[index % len(COLORS)]
            axes.plot(
                x,
                y,
                color=color,
                linestyle=line,
                marker=MARKERS[index % len(MARKERS)],
                markersize=4,
                label=f"{scene} {method}{slope}",
            )
    if axes.lines:
        axes.legend(fontsize=7, frameon=False)
    return to_png(figure)


def _scaling(report: Report, what: str) -> bytes:
    series: Sequence[Any] = [s for s in report["scaling"] if s["what"] == what]
    figure, axes = log_axes(f"{what[0].upper()}{what[1:]} ({series[0]['scene']})", what.split(" against ")[1], "ms")
    for index, one in enumerate(series):
        x, y = zip(*one["points"], strict=True)
        slope = f", exponent {one['fit']['exponent']:.2f}" if one["fit"] else ""
        axes.plot(
            x,
            y,
            marker=MARKERS[index % len(MARKERS)],
            color=COLORS[index % len(COLORS)],
            label=f"{one['method']}{slope}",
        )
    axes.legend(fontsize=8, frameon=False)
    return to_png(figure)
