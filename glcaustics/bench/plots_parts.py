"""Curves of the parts: shares of solved rays against iterations, and photons' error against time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glcaustics.bench.plots_tools import COLORS, MARKERS, log_axes, to_png

Report = Mapping[str, Any]


def part_plots(report: Report) -> dict[str, bytes]:
    """File name -> PNG; matplotlib must be there."""
    drawn = {f"photons-{one['scene']}.png": _photons(one) for one in report.get("photons") or [] if one.get("equal")}
    if eye := report.get("eye"):
        for name in eye["settings"]["scenes"]:
            drawn[f"rays-{name}.png"] = _convergence(eye, name)
    return drawn


def _photons(one: Mapping[str, Any]) -> bytes:
    equal = one["equal"]
    figure, axes = log_axes(
        f"{one['scene']}, what the eye sees directly",
        "time, ms (processor time, all threads)",
        "relative RMSE of irradiance",
    )
    label = f"photon_trace {equal['ours'][0]['quality']}" if equal["ours"] else ""
    curves = [
        (label, equal["ours"], "-"),
        ("ptracer", equal["ptracer"], "--"),
        ("ptracer + OIDN", equal["ptracer+oidn"], "--"),
    ]
    for index, (name, rows, line) in enumerate(curves):
        if rows:
            x, y = [r["ms"] for r in rows], [r["rrmse"] for r in rows]
            axes.plot(x, y, line, color=COLORS[index], marker=MARKERS[index], markersize=5, label=name)
    for entry in equal["ours"]:
        axes.annotate(
            f"{entry['frames']} frames",
            (entry["ms"], entry["rrmse"]),
            textcoords="offset points",
            xytext=(5, 5),
            fontsize=7,
        )
    axes.legend(fontsize=8, frameon=False)
    return to_png(figure)


def _convergence(eye: Mapping[str, Any], scene: str) -> bytes:
    """Eye rays on the left, light rays on the right: thin a view each, thick all views together."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, rows, share, what in (
        (left, eye["eye_rays"], "within_1px", "eye rays within one pixel"),
        (right, eye["light_rays"], "within_1texel", "light rays within one texel"),
    ):
        mine = [one for one in rows if one["scene"] == scene]
        for index, one in enumerate(mine):
            color, name = COLORS[index], one.get("branch", "all views")
            for view in one["views"]:
                axes.plot(view["iterations"], view[share], color=color, linewidth=0.7, alpha=0.5)
            if one.get("by_ray_casting"):
                truth = one["by_ray_casting"]["pooled"]
                label = "against ray casting"
                axes.plot(truth["iterations"], truth[share], "--", color="#525252", linewidth=1.6, label=label)
            pooled = one["pooled"]
            axes.plot(
                pooled["iterations"],
                pooled[share],
                color=color,
                linewidth=2.4,
                marker=MARKERS[index],
                label=name,
                zorder=5,
            )
        axes.set(title=f"{scene}: {what}", xlabel="iterations", ylim=(0.0, 1.02))
        axes.grid(True, color="#d4d4d4", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
    if scene == "pool":
        for index, (name, one) in enumerate(eye["published"].items()):
            left.plot(
                one["iterations"],
                one["within_1px"],
                ":",
                color=COLORS[index + 3],
                marker=MARKERS[index + 3],
                label=name,
            )
    left.set_ylabel("share of the resolvable rays")
    for axes in (left, right):
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=8, frameon=False, loc="lower right")
    return to_png(figure)
