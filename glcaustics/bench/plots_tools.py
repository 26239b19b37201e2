"""What all curves share: colours, axes, the way to PNG."""

from __future__ import annotations

import io
from typing import Any

COLORS = ("#0b6e99", "#c2410c", "#4d7c0f", "#7e22ce", "#b45309", "#be185d", "#0f766e", "#525252")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


def log_axes(title: str, x: str, y: str) -> Any:
    """A figure and its axes, both logarithmic."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    axes = figure.add_subplot()
    axes.set(xscale="log", yscale="log", xlabel=x, ylabel=y, title=title)
    axes.grid(True, which="major", color="#d4d4d4", linewidth=0.6)
    axes.grid(True, which="minor", color="#ececec", linewidth=0.4)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def to_png(figure: Any) -> bytes:
    """The figure's bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()
