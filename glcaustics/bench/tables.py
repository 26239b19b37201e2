"""What the parts found as tables, for the terminal and for the page alike."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from glcaustics.bench.analysis import solve_cost
from glcaustics.bench.equal_error import DENOISED, PTRACER, ratio_text

Report = Mapping[str, Any]


@dataclass(frozen=True)
class Table:
    """`rows` of texts under `head`; `note` in one line."""

    title: str
    head: tuple[str, ...]
    rows: Sequence[Sequence[str]]
    note: str = ""

    def text(self) -> str:
        """For a terminal: first column left, the others right."""
        lines = [self.head, *self.rows]
        widths = [max(len(line[k]) for line in lines) for k in range(len(self.head))]

        def padded(line: Sequence[str]) -> str:
            cells = [
                cell.ljust(w) if k == 0 else cell.rjust(w) for k, (cell, w) in enumerate(zip(line, widths, strict=True))
            ]
            return "  ".join(cells).rstrip()

        return "\n".join(
            [self.title, *(f"  {padded(line)}" for line in lines), *([f"  ({self.note})"] if self.note else [])]
        )


def all_tables(report: Report) -> Iterator[Table]:
    """Every table of a report, in the order of its parts; what was not measured is left out."""
    yield from equal_error_tables(report)
    yield from photon_tables(report)
    yield from mesh_tables(report)
    yield from eye_tables(report)
    yield from seen_tables(report)
    yield from mark_tables(report)


def equal_error_tables(report: Report) -> Iterator[Table]:
    """Per scene: how many times faster than the peers at equal error."""
    entries = report.get("equal_error") or []
    rows = []
    for e in entries:
        law = e["law"]
        slope = "" if law is None or law["exponent"] is None else f"{law['exponent']:+.2f}"
        need = f"{e[PTRACER]['ms'] / 1e3:.3g}" if PTRACER in e else ""
        cells = [
            f"{e['scene']} {e['method']} {e['quality']}",
            f"{e['pixels']}^2",
            f"{e['rrmse']:.4f}",
            f"{e['ms']:.0f}",
        ]
        rows.append([*cells, need, ratio_text(e, PTRACER), ratio_text(e, DENOISED), slope])
    if rows:
        head = (
            "at equal error",
            "map",
            "rel. RMSE",
            "our ms",
            "ptracer s",
            "faster than ptracer",
            "than ptracer + OIDN",
            "slope",
        )
        yield Table("Times faster than Mitsuba's ptracer at equal error", head, rows, PTRACER_NOTE)


PTRACER_NOTE = (
    "ptracer's error is taken as (photons)^-1/2 through the measured counts, extrapolated where said; slope: of its "
    "error against photons as measured; with OIDN interpolated, else > by its best measured error, < by its first"
)


def photon_tables(report: Report) -> Iterator[Table]:
    """Per scene: errors after static frames, equal error, cost of the stages, flicker of a pan."""
    for one in report.get("photons") or []:
        yield _static_table(one)
        if one.get("equal"):
            yield _equal_time_table(one)
        yield _stage_table(one)
        if one.get("flicker"):
            yield _flicker_table(one)


def _static_table(one: Mapping[str, Any]) -> Table:
    p, reference, rows = one["settings"], one["reference"], []
    flips = {f["photons"]: f["flip"] for f in one["final"]}
    for row in one["static"]:
        errors = [f"{s['rrmse']:.4f}" for s in row["series"]]
        flip = flips.get(row["photons"])
        cells = [f"{row['photons']}", *errors, f"{row['rrmse_plain']:.4f}", f"{row['bias']:+.2%}"]
        rows.append(
            [*cells, "" if flip is None else f"{flip:.4f}", f"{row['frame_ms']:.0f}", f"{row['processor_ms']:.0f}"]
        )
    frames = [_frames(s["frames"]) for s in one["static"][0]["series"]]
    head = ("photons a frame", *frames, "without edges", "bias", "FLIP of the picture", "frame ms", "processor ms")
    note = (
        f"picture {p['side']}^2, light views {p['view_size']}^2; {reference['source']}, noise "
        f"{reference['noise']:.2%}; FLIP against the same picture with the reference's irradiance in it"
    )
    if v := one.get("validation"):
        note += (
            f"; Mitsuba on what the eye sees directly: differs by {v['ratio']:.2f} times the noise of both, bias "
            f"{v['bias']:+.2%} +- {v['bias_sigma']:.2%}"
        )
    title = f"{one['scene']}: relative RMSE of photon_trace at the camera's pixels, filtered to {p['filtered']}^2"
    return Table(title, head, rows, note)


def _frames(number: int) -> str:
    return f"{number} frame" if number == 1 else f"{number} frames"


def _equal_time_table(one: Mapping[str, Any]) -> Table:
    equal, rows = one["equal"], []
    for e in equal["ours"]:
        cells = [f"photon_trace {e['quality']}, {_frames(e['frames'])}", f"{e['ms']:.0f}", f"{e['rrmse']:.4f}"]
        rows.append([*cells, ratio_text(e, PTRACER), ratio_text(e, DENOISED)])
    for name in (PTRACER, DENOISED):
        rows += [
            [f"{name}, {r['photons']} photons", f"{r['ms']:.0f}", f"{r['rrmse']:.4f}", "", ""] for r in equal[name]
        ]
    head = ("tool", "ms", "rel. RMSE", "faster than ptracer", "than ptracer + OIDN")
    pixels = f"{equal['share']:.0%} of {equal['pixels']}^2 pixels"
    note = f"ms by processor time, all threads; on the {pixels} that ptracer can show: seen directly, one surface alone"
    return Table(f"{one['scene']}: at equal error on what the eye sees directly", head, rows, note)


def _stage_table(one: Mapping[str, Any]) -> Table:
    rows = []
    dda = {r["photons"]: r["ms"] for r in one["stages"] if r["march"] == "dda"}
    for r in one["stages"]:
        ms = r["ms"]
        three = sum(ms[name] for name in ("tracing", "storing", "denoising"))
        shares = [f"{ms[name]:.0f} ({ms[name] / three:.0%})" for name in ("tracing", "storing", "denoising")]
        ours = r["march"] != "dda"
        hits = r["same_hits"]["share"] if ours else None
        ratio = ""
        if ours:
            whole, reflected = (ms[name] / dda[r["photons"]][name] for name in ("tracing", "reflected"))
            ratio = f"{whole:.2f} ({reflected:.2f})"
        cells = [f"{r['photons']} {r['march']}", *shares, f"{ms['buffers']:.0f}"]
        rows.append([*cells, ratio, "" if hits is None else f"{hits:.2%}"])
    first = one["stages"][0]
    head = (
        "photons",
        "tracing",
        "storing",
        "denoising",
        "views it needs",
        "tracing of dda's (reflected photons')",
        "same hits",
    )
    width, height = first["size"]
    views = f"light views {first['view_size']}^2"
    note = f"{width}x{height}, {views}; ms by {first['clock']}; median of {first['frames']} frames"
    return Table(f"{one['scene']}: milliseconds and shares of a frame", head, rows, note)


def _flicker_table(one: Mapping[str, Any]) -> Table:
    p, found = one["settings"]["flicker"], one["flicker"]
    rows = []
    for r in found["rows"]:
        cells = [r["name"], f"{r['flicker']:.4f}", f"{r['off_edges']:.4f}"]
        rows.append([*cells, "" if r["rmse"] is None else f"{r['rmse']:.3f}"])
    width, height = p["size"]
    note = (
        f"{width}x{height}, {p['photons']} photons, {found['motion_px']:.2f} px a frame over still light; "
        f"the last {p['shown']} of {p['frames']} frames at {found['points']} points of the surfaces, "
        f"{found['points_off_edges']} without edges; plain: of the same frames, unfiltered, alpha 0.2; "
        f"rel. RMSE at {p['reference_views']} views against {p['reference_frames']} frames of "
        f"{p['reference_photons']} photons ({found['reference_seconds']:.0f} s)"
    )
    head = ("irradiance", "flicker", "without edges", "rel. RMSE")
    return Table(f"{one['scene']}: flicker of the surfaces while the camera pans", head, rows, note)


def mesh_tables(report: Report) -> Iterator[Table]:
    """The displaced mesh, refined."""
    if not (mesh := report.get("mesh")):
        return
    rows = []
    for r in mesh["rows"]:
        cells = [f"s={r['strength']:g}, mesh {r['mesh']}^2, map {r['map']}^2", f"{r['rrmse']:.4f}", f"{r['mae']:.4f}"]
        rows.append([*cells, f"{r['bias']:+.2%}"])
    noise = ", ".join(f"{name} {value:.2%}" for name, value in mesh["noise"].items())
    orders = ", ".join(f"{order:.2f}" for order in mesh["orders"])
    note = f"peer-pool, slanted light, divided by the means; noise of the beams {noise}; order without folds {orders}"
    yield Table("The displaced mesh against beams", ("case", "rel. RMSE", "MAE", "bias"), rows, note)


# ---------------------------------------------------------------- eye and light rays


def eye_tables(report: Report) -> Iterator[Table]:
    """Convergence pooled over the views, and cost by view and solver."""
    eye = report.get("eye")
    if not eye:
        return
    p = eye["settings"]
    size = f"{p['size'][0]}x{p['size'][1]}"
    for key, name, share in (("eye_rays", "pixel", "within_1px"), ("light_rays", "texel", "within_1texel")):
        if eye[key]:
            yield _convergence_table(eye[key], name, share, f"{p['views']} seeded views a scene", size)
    if eye["costs"]:
        yield _cost_table(eye["costs"])


def _convergence_table(found: Sequence[Any], name: str, share: str, views: str, size: str) -> Table:
    rows = []
    for one in found:
        pooled = one["pooled"]
        label = one["scene"] + (f", {one['branch']}" if "branch" in one else "")
        last = [pooled["cascade"], pooled["hierarchical"]] if "cascade" in pooled else [pooled["marched"]]
        shares = [f"{v:.4f}" for v in pooled[share]]
        rows.append([label, *shares, f"{max(pooled['wrong']):.4f}", *(f"{v:.4f}" for v in last)])
        if one.get("by_ray_casting"):
            truth = one["by_ray_casting"]["pooled"]
            exact = [f"{v:.4f}" for v in truth[share]]
            rows.append([f"{label}, by ray casting", *exact, "", "", f"(dda {truth['dda']:.4f})"])
    counts = [str(k) for k in found[0]["pooled"]["iterations"]]
    ends = ("cascade", "hierarchical") if "cascade" in found[0]["pooled"] else ("as shipped",)
    kind, where = ("eye rays", f" at {size}") if name == "pixel" else ("light rays", "")
    note = f"{views}{where}; of the resolvable rays; wrong: said solved, but farther off"
    if name == "pixel":
        note += "; truth: pixel-exact marching, then float64 ray casting"
    title = f"Newton's share of {kind} within one {name} after k iterations"
    return Table(title, ("scene", *counts, "wrong", *ends), rows, note)


def _cost_table(costs: Sequence[Any]) -> Table:
    solvers, rows = list(costs[0]["with_reflections"]), []
    for one in costs:
        plain = one["without"]
        cells = [f"{one['scene']}, view {one['view']}"]
        cells += [f"{one['with_reflections'][s]['total']:.1f} / {plain[s]['total']:.1f}" for s in solvers]
        solves = [solve_cost(plain, name) for name in ("newton", "dda")]
        cells.append(f"{plain['cascade']['total'] / plain['dda']['total']:.2f}")
        cells.append("" if None in solves else " / ".join(f"{cost:.1f}" for cost in solves))
        rows.append(cells)
    width, height = costs[0]["size"]
    note = (
        f"{width}x{height}; whole passes with / without reflections; unit: one full-screen fetch of rgba32f; a solve "
        "alone: the solver's first stage less Sousa's, which estimates"
    )
    head = ("scene", *solvers, "cascade of dda's", "solve of newton / dda")
    return Table("Cost of eye rays in fetch passes", head, rows, note)


# ---------------------------------------------------------------- through water; marks


def seen_tables(report: Report) -> Iterator[Table]:
    """The caustic through water."""
    seen = report.get("seen")
    if not seen:
        return
    rows = []
    for e in seen["ours"]:
        cells = [f"glcaustics {e['quality']}", f"{e['time_ms']['median']:.0f}", f"{e['rrmse']:.4f}"]
        rows.append(
            [*cells, f"{e['bias']:+.2%}", f"{e['solved']:.1%}", ratio_text(e, PTRACER), ratio_text(e, DENOISED)]
        )
    for r in seen["peers"]:
        name = f"{r['method']}, {r['photons']} photons, {r['spp']} samples a pixel"
        rows.append([name, f"{r['ms']:.0f}", f"{r['rrmse']:.4f}", "", "", "", ""])
    head = ("tool", "ms", "rel. RMSE", "bias", "solved", "faster than ptracer", "than ptracer + OIDN")
    note = f"{seen['settings']['side']}^2; {seen['source']}, noise {seen['noise']:.2%}; peers: both stages by Mitsuba"
    yield Table(f"{seen['scene']}: the caustic seen through the water", head, rows, note)


def mark_tables(report: Report) -> Iterator[Table]:
    """What was aimed at, and what was measured."""
    rows = [
        [m["what"], m["mark"], m["measured"], "met" if m["met"] else "NOT met", m["at"]]
        for m in report.get("marks") or []
    ]
    if rows:
        yield Table("Marks", ("what", "mark", "measured", "", "at"), rows)
