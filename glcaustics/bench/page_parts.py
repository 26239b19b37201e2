"""Sections of the page beside the scenes': marks, photons in the flooded scenes, eye and light rays, through water."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.measure import WHITE, display
from glcaustics.bench.page_tools import ERROR_SPAN, difference_map, figure, image_tag, png, table
from glcaustics.bench.tables import Table, eye_tables, mark_tables, photon_tables, seen_tables

FloatArray = npt.NDArray[np.float64]
Report = Mapping[str, Any]
Pictures = Mapping[str, npt.NDArray[np.uint8]]
PICTURE_ERROR = 6.0  # times brighter than the difference of two pictures is shown


def table_section(title: str, tables: Iterable[Table]) -> str:
    """A heading and tables under it; nothing without tables."""
    parts = [_html(one) for one in tables]
    return f"<h2>{html.escape(title)}</h2>{''.join(parts)}" if parts else ""


def mark_section(report: Report) -> str:
    """What was aimed at and what was measured."""
    text = table_section("Marks", mark_tables(report))
    return text.replace("<td>NOT met</td>", '<td><span class="bad">NOT met</span></td>')


def _html(one: Table) -> str:
    rows = [[html.escape(cell) for cell in row] for row in one.rows]
    note = f"<p><small>{html.escape(one.note)}</small></p>" if one.note else ""
    return f"<h3>{html.escape(one.title)}</h3>{table(one.head, rows)}{note}"


def photon_section(
    report: Report, images: Mapping[str, FloatArray], plots: Mapping[str, bytes], pictures: Pictures
) -> str:
    """A heading a scene: pictures, maps with their errors, curves and tables."""
    parts = []
    for one in report.get("photons") or []:
        name = one["scene"]
        parts.append(f"<h2>{html.escape(name)}: photons</h2>{_photon_pictures(one, pictures)}")
        parts.append(_photon_maps(one, images))
        if (plot := plots.get(f"photons-{name}.png")) is not None:
            parts.append(image_tag(plot, "plot", f"error against time, {name}"))
        parts += [_html(each) for each in photon_tables({"photons": [one]})]
    return "".join(parts)


def _photon_pictures(one: Mapping[str, Any], pictures: Pictures) -> str:
    name = one["scene"]
    reference = pictures[f"{name} with the reference"]
    shown = [figure(png(reference / 255.0), "the picture with the reference's irradiance in it")]
    for row in one["final"]:
        ldr = pictures[f"{name} {row['photons']} photons"]
        flip = "" if row["flip"] is None else f": FLIP {row['flip']:.4f}"
        shown.append(figure(png(ldr / 255.0), f"{row['photons']} photons a frame{flip}"))
        difference = np.abs(ldr.astype(np.float64) - reference) / 255.0
        shown.append(figure(png(PICTURE_ERROR * difference), f"difference, {PICTURE_ERROR:g} times as bright"))
    return f'<div class="maps large">{"".join(shown)}</div>'


def _photon_maps(one: Mapping[str, Any], images: Mapping[str, FloatArray]) -> str:
    name = one["scene"]
    reference = images[f"{name} view reference"]
    mean = float(reference.mean())
    shown = [
        figure(png(display(reference, mean)), f"reference irradiance at the camera's pixels: white is {WHITE:g} means")
    ]
    for row in one["static"]:
        image = images[f"{name} view {row['photons']}"]
        shown.append(figure(png(display(image, mean)), f"{row['photons']} photons, {row['frames']} frames"))
        words = f"its error, relative RMSE {row['rrmse']:.4f}; full colour at {ERROR_SPAN:g} times the mean"
        shown.append(figure(png(difference_map(image - reference, mean)), words))
    return f'<div class="maps large">{"".join(shown)}</div>'


def seen_section(report: Report, images: Mapping[str, FloatArray]) -> str:
    """The caustic through water: maps, their errors, table."""
    seen = report.get("seen")
    if not seen:
        return ""
    name = seen["scene"]
    reference = images[f"{name} seen reference"]
    mean = float(reference.mean())
    shown = [figure(png(display(reference, mean)), f"reference: white is {WHITE:g} times the mean")]
    for row in seen["ours"]:
        image = images[f"{name} seen {row['quality']}"]
        shown.append(figure(png(display(image, mean)), f"{row['quality']}: {row['time_ms']['median']:.0f} ms"))
        words = f"its error, relative RMSE {row['rrmse']:.3f}, bias {row['bias']:+.2%}"
        shown.append(figure(png(difference_map(image - reference, mean)), words))
    maps = f'<div class="maps">{"".join(shown)}</div>'
    return table_section("Through water", seen_tables(report)) + maps


def eye_section(report: Report, plots: Mapping[str, bytes], pictures: Pictures) -> str:
    """Pictures of the scenes, convergence of eye and light rays, cost."""
    eye = report.get("eye")
    if not eye:
        return ""
    parts = ["<h2>Eye rays and light rays</h2>"]
    for name in eye["settings"]["scenes"]:
        parts.append(f"<h3>{html.escape(name)}</h3>")
        if (shown := pictures.get(f"{name} view")) is not None:
            parts.append(image_tag(png(shown / 255.0), "plot", name))
        if (plot := plots.get(f"rays-{name}.png")) is not None:
            parts.append(image_tag(plot, "plot", f"convergence, {name}"))
    return "".join(parts) + "".join(_html(one) for one in eye_tables(report))
