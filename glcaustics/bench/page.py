"""The report as one self-contained HTML page: pictures, error maps, curves and tables; images are data URIs."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.analysis import caustics_ms
from glcaustics.bench.measure import SINGULAR, WHITE, display
from glcaustics.bench.page_parts import eye_section, mark_section, photon_section, seen_section, table_section
from glcaustics.bench.page_tools import ERROR_SPAN, difference_map, figure, image_tag, png, show, table
from glcaustics.bench.plots import judged
from glcaustics.bench.tables import equal_error_tables, mesh_tables

FloatArray = npt.NDArray[np.float64]
Report = Mapping[str, Any]

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1c1c1c; background: #fff; margin: 2rem auto; max-width: 72rem;
  padding: 0 1rem; }
h1 { font-size: 1.7rem; margin-bottom: 0.2rem; } h2 { margin-top: 2.5rem; border-bottom: 1px solid #ddd; }
h3 { margin-bottom: 0.3rem; } p { max-width: 46rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: 0.8rem 0; }
th, td { padding: 0.2rem 0.7rem; text-align: right; border-bottom: 1px solid #e5e5e5; }
th { border-bottom-color: #999; } td:first-child, th:first-child, td.text, th.text { text-align: left; }
.maps { display: flex; flex-wrap: wrap; gap: 0.8rem; } figure { margin: 0; }
.maps img { width: 12.5rem; image-rendering: pixelated; display: block; }
figcaption { font-size: 0.8rem; color: #444; max-width: 12.5rem; }
.large img { width: 22rem; } .large figcaption { max-width: 22rem; }
.plot { max-width: 100%; } .wide { overflow-x: auto; } .bad { color: #b00020; font-weight: 600; } small { color: #555; }
"""


def page(
    report: Report,
    images: Mapping[str, FloatArray],
    plots: Mapping[str, bytes],
    pictures: Mapping[str, npt.NDArray[np.uint8]],
) -> str:
    """The whole page.

    Args:
        images: maps (P, P) by "SCENE reference" and "SCENE METHOD STEP", and as the parts name them.
        plots: PNG by file name.
        pictures: (H, W, 3) uint8 by scene, as its camera sees it, and as the parts name them.
    """
    body = [_head(report), mark_section(report), _validation(report)]
    if report["rows"]:
        body += [table_section("At equal error", equal_error_tables(report))]
        body += [_scene(report, name, images, plots, pictures[name]) for name in report["plan"]["scenes"]]
    body.append(table_section("Displaced mesh", mesh_tables(report)))
    body += [photon_section(report, images, plots, pictures), seen_section(report, images)]
    body += [eye_section(report, plots, pictures)]
    if report["rows"]:
        body += [_curves(report, plots), _passes(report)]
    body.append(_notes(report))
    title = "glcaustics: error against run time"
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head>'
        f"<body>\n{''.join(body)}\n</body></html>\n"
    )


def _head(report: Report) -> str:
    state, text = report["machine"], html.escape
    commit = (report["commit"] or "no checkout")[:12] + (" with local changes" if report["dirty"] else "")
    facts = [
        ("Command", report["command"]),
        ("Made", report["created"]),
        ("Commit", f"{commit}, glcaustics {report['glcaustics']}"),
        ("Machine", f"{state['cpu']}, {state['cores']} cores, {state['system']}; load {state['load_average']}"),
        ("OpenGL", str(state["gl_renderer"])),
        ("Packages", ", ".join(f"{k} {v}" for k, v in report["versions"].items() if v)),
    ]
    rows = "".join(f'<tr><td>{text(k)}</td><td class="text">{text(v)}</td></tr>' for k, v in facts)
    return (
        "<h1>Error against run time</h1><p>Caustic irradiance on a square of a flat receiver in each scene, held "
        "against float64 reference beams, for every method and quality, and for what people use today. Errors are "
        "relative to the mean irradiance; the references' own noise is taken off the RMSE.</p>"
        f"<table>{rows}</table>"
    )


def _validation(report: Report) -> str:
    if not report["validation"]:
        return ""
    rows = []
    for v in report["validation"]:
        verdict = "yes" if v["agree"] else '<span class="bad">no</span>'
        numbers = [f"{v['rrmse']:.4f}", f"{v['expected_noise']:.4f}", f"{v['ratio']:.2f}"]
        bias = f"{v['bias']:+.3%} &plusmn; {v['bias_sigma']:.3%}"
        rows.append([html.escape(v["scene"]), *numbers, bias, verdict, html.escape(v["source"])])
    head = ["scene", "relative RMSE", "expected from noise", "ratio", "bias of the mean", "agree", "outside truth"]
    return "<h2>Beams against Mitsuba</h2>" + table(head, rows)


# ---------------------------------------------------------------- a scene


def _scene(
    report: Report,
    scene: str,
    images: Mapping[str, FloatArray],
    plots: Mapping[str, bytes],
    picture: npt.NDArray[np.uint8],
) -> str:
    rows = judged(report, scene)
    reference = images[f"{scene} reference"]
    mean = float(reference.mean())
    source = next(r for r in report["references"] if r["scene"] == scene)
    figures = [figure(png(display(reference, mean)), f"reference: white is {WHITE:g} times the mean")]
    for row in rows:
        name = f"{scene} {row['method']} {row['quality']}"
        if name not in images or not _shown(row, rows):
            continue
        caption = f"{row['method']} {_step(row)}: {row['time_ms']['median']:.0f} ms"
        figures.append(figure(png(display(images[name], mean)), caption))
        figures.append(figure(png(difference_map(images[name] - reference, mean)), f"its error, {_errors(row)}"))
    plot = image_tag(plots[f"error-{scene}.png"], "plot", f"error against time, {scene}")
    shown = image_tag(png(picture / 255.0), "plot", scene)
    return (
        f"<h2>{html.escape(scene)}</h2>{shown}"
        f"<p><small>{html.escape(source['source'])}; noise {source['noise']:.2%} of the "
        f"mean. Error maps: red is too bright, blue too dark, full colour at {ERROR_SPAN:g} times the mean. "
        f"Foci (pixels above {SINGULAR:g} times the mean, and their neighbours): {source['singular_pixels']:.2%} of "
        f"the pixels, {source['singular_flux']:.1%} of the flux."
        f'</small></p><div class="maps">{"".join(figures)}</div>{plot}{_numbers(report, scene)}'
    )


def _shown(row: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> bool:
    """The cheapest and the best step of each method: more pictures would say no more."""
    same = [r for r in rows if (r["tool"], r["method"]) == (row["tool"], row["method"])]
    return row is same[-1] or (row["tool"] == "glcaustics" and row is same[0])


def _step(row: Mapping[str, Any]) -> str:
    return f"{row['photons']} photons" if "photons" in row else str(row["quality"])


def _errors(row: Mapping[str, Any]) -> str:
    e = row["errors"]
    return f"relative RMSE {e['rrmse']:.3f}, bias {e['bias']:+.2%}"


def _numbers(report: Report, scene: str) -> str:
    head = ["tool", "step", "pixels", "relative RMSE", "without foci", "MAE", "bias", "FLIP", "PSNR dB"]
    head += ["median ms", "min-max ms", "of it caustics", "set-up ms", "MB"]
    lines = []
    for r in (r for r in report["rows"] if r["scene"] == scene):
        e, t = r["errors"], r["time_ms"]
        own = caustics_ms(report["rows"], r) if r["tool"] == "glcaustics" and r["method"] != "none" else None
        memory = r.get("bytes_allocated")
        numbers = [show(e.get(name), ".4f") for name in ("rrmse", "rrmse_regular", "mae")]
        numbers += [show(e.get("bias"), "+.2%")]
        numbers += [show(e.get("flip"), ".4f"), show(e.get("psnr_db"), ".1f")]
        times = [
            f"{t['median']:.1f}",
            f"{t['min']:.1f}-{t['max']:.1f}",
            show(own, ".1f"),
            f"{r['first_frame_ms']:.0f}",
        ]
        size = "" if memory is None else f"{memory / 1e6:.1f}"
        name = r["method"] if r["tool"] == "glcaustics" else f"{r['tool']} {r['method']}"
        lines.append([html.escape(name), html.escape(_step(r)), f"{r['pixels']}&sup2;", *numbers, *times, size])
    return table(head, lines)


# ---------------------------------------------------------------- the rest


def _curves(report: Report, plots: Mapping[str, bytes]) -> str:
    shown = [
        image_tag(data, "plot", name) for name, data in plots.items() if name.startswith(("time-", "convergence."))
    ]
    rows = []
    for one in report["scaling"]:
        fit, tool = one["fit"], one.get("tool", "glcaustics")
        numbers = [f"{fit['exponent']:.2f}", f"{fit['spread']:.2f}"] if fit else ["too few points", ""]
        rows.append([html.escape(x) for x in (one["what"], one["scene"], f"{tool} {one['method']}")] + numbers)
    head = ["what", "scene", "method", "exponent", "largest factor off the line"]
    return "<h2>Scaling</h2>" + "".join(shown) + table(head, rows)


def _passes(report: Report) -> str:
    parts = ["<h2>Passes</h2><p>Milliseconds of each pass, measured one by one, and bytes that it writes.</p>"]
    rows = [r for r in report["rows"] if r["tool"] == "glcaustics" and r["method"] != "none"]
    largest = max((r["pixels"] for r in rows), default=0)
    for r in rows:
        if r["pixels"] != largest or r["quality"] != report["plan"]["qualities"][-1]:
            continue
        lines = [[html.escape(p["name"]), show(p["ms"], ".2f"), f"{p['bytes'] / 1e6:.2f}"] for p in r["passes"]]
        title = f"{r['scene']}, {r['method']} {r['quality']}, {r['pixels']}&sup2;"
        parts.append(f"<details><summary>{title}</summary>{table(['pass', 'ms', 'MB'], lines)}</details>")
    return "".join(parts)


def _notes(report: Report) -> str:
    notes = [
        "Every tool gets the same meshes and the same clear media; absorption is left out, since ptracer has none.",
        "Our times are whole frames with every pass; Mitsuba's are the photon pass alone, its photons aimed at the "
        "casters, scene set-up told apart.",
        *report["notes"],
    ]
    return "<h2>Notes</h2><ul>" + "".join(f"<li>{html.escape(n)}</li>" for n in notes) + "</ul>"
