"""What is aimed at and what a run measured, side by side: one line a mark, judged at the sizes of the run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from glcaustics.bench.analysis import solve_cost
from glcaustics.bench.equal_error import PTRACER, best_of, ratio_text
from glcaustics.bench.flicker import FILTER, PLAIN

Report = Mapping[str, Any]
Mark = dict[str, Any]  # what, mark, measured, at: texts; met: whether

PAPER_ITERATIONS = 5  # most that Mayer, Assarsson, Sintorn 2026 use
NEWTON_SHARE = {"pool": 0.99, "glass-statue": 0.90, "boat": 0.95}
CASCADE_SHARE, CASCADE_COST, NEWTON_COST, WATER_COST = 0.995, 1.0 / 3.0, 0.1, 10.0
FULL_OF_WATER = 0.9  # share of the picture that is specular
SAME_HITS, MARCH_COST = 0.995, 1.0 / 3.0
PHOTON_RRMSE, PHOTON_FLIP = 0.10, 0.05
FLICKER = 0.5  # of a plain exponential mean's
EQUAL_ERROR = 1000.0
MESH_RRMSE = {(128, 512): 0.035, (256, 1024): 0.010}  # (mesh, map) without folds
FOLDED_MAE, FOLDED_MAP, STEADY_ORDER = 0.08, 1024, 1.0


def marks(report: Report) -> list[Mark]:
    """Every mark that the report has numbers for."""
    return [*_equal_error(report), *_mesh(report), *_photons(report), *_eye(report)]


def _mark(what: str, mark: str, measured: str, met: bool, at: str) -> Mark:
    return {"what": what, "mark": mark, "measured": measured, "met": bool(met), "at": at}


def _equal_error(report: Report) -> Iterator[Mark]:
    best = best_of(report.get("equal_error") or [], "peer-pool", "displaced_mesh")
    if best is not None:
        at = f"{best['quality']}, {best['pixels']}^2, relative RMSE {best['rrmse']:.4f}"
        ratio = best[PTRACER]["ratio"]
        what = "displaced_mesh on peer-pool, times faster than ptracer at equal error"
        yield _mark(what, f">= {EQUAL_ERROR:.0f}", ratio_text(best, PTRACER), ratio >= EQUAL_ERROR, at)


def _mesh(report: Report) -> Iterator[Mark]:
    mesh = report.get("mesh")
    if not mesh:
        return
    for r in mesh["rows"]:
        what = f"displaced_mesh on peer-pool, s={r['strength']:g}, mesh {r['mesh']}^2, map {r['map']}^2"
        limit = MESH_RRMSE.get((r["mesh"], r["map"]))
        if r["strength"] == 1.0 and limit is not None:
            yield _mark(
                f"{what}: relative RMSE", f"<= {limit:.3f}", f"{r['rrmse']:.4f}", r["rrmse"] <= limit, "slanted"
            )
        if r["strength"] == 2.0 and r["map"] == FOLDED_MAP:
            yield _mark(f"{what}: MAE", f"<= {FOLDED_MAE:.2f}", f"{r['mae']:.4f}", r["mae"] <= FOLDED_MAE, "slanted")
    if mesh["orders"]:
        least = min(mesh["orders"])
        what = "displaced_mesh on peer-pool: order of the error's fall"
        yield _mark(what, f">= {STEADY_ORDER:.1f}", f"{least:.2f}", least >= STEADY_ORDER, "mesh and map together")


def _photons(report: Report) -> Iterator[Mark]:
    for one in report.get("photons") or []:
        name, p = one["scene"], one["settings"]
        at = f"{p['side']}^2 filtered to {p['filtered']}^2, {p['frames']} frames"
        if name == "flooded-cornell":
            for row in one["static"]:
                what = f"{name}, {row['photons']} photons, relative RMSE of irradiance"
                yield _mark(what, f"<= {PHOTON_RRMSE:.2f}", f"{row['rrmse']:.4f}", row["rrmse"] <= PHOTON_RRMSE, at)
            for row in one["final"]:
                if row["flip"] is not None:
                    what = f"{name}, {row['photons']} photons, FLIP of the picture"
                    met = row["flip"] < PHOTON_FLIP
                    yield _mark(what, f"< {PHOTON_FLIP:.2f}", f"{row['flip']:.4f}", met, f"{p['side']}^2")
            yield from _equal_time(one)
        yield from _stages(one)
        yield from _flicker(one)


def _flicker(one: Mapping[str, Any]) -> Iterator[Mark]:
    """Away from the surfaces' edges: a footprint over an edge holds two surfaces, which part as the camera moves, so
    that there even a perfect picture is not still. The ratio with them stands beside it.
    """
    if one.get("flicker"):
        p, found = one["settings"]["flicker"], {r["name"]: r for r in one["flicker"]["rows"]}
        ratio, with_edges = (found[FILTER][key] / found[PLAIN][key] for key in ("off_edges", "flicker"))
        what = f"{one['scene']}: flicker away from edges, the filter's over a plain exponential mean's"
        at = f"{p['size'][0]}x{p['size'][1]}, {p['photons']} photons, {p['pan_px']:g} px a frame"
        yield _mark(what, f"<= {FLICKER:.2f}", f"{ratio:.2f} (with edges {with_edges:.2f})", ratio <= FLICKER, at)


def _equal_time(one: Mapping[str, Any]) -> Iterator[Mark]:
    """After the last frame: a ratio of times at equal error above 1 is a lower error at equal time."""
    ours = one.get("equal", {}).get("ours", [])
    if ours and PTRACER in ours[-1]:
        last = ours[-1]
        what = f"{one['scene']}, {last['frames']} frames: lower error than ptracer at equal time"
        at = f"{one['equal']['pixels']}^2, what the eye sees directly"
        yield _mark(what, "> 1 x", ratio_text(last, PTRACER), last[PTRACER]["ratio"] > 1.0, at)


def _stages(one: Mapping[str, Any]) -> Iterator[Mark]:
    dda = {r["photons"]: r["ms"]["tracing"] for r in one["stages"] if r["march"] == "dda"}
    for r in one["stages"]:
        if r["march"] == "dda":
            continue
        name, (width, height), ms = f"{one['scene']}, {r['photons']} photons", r["size"], r["ms"]
        at = f"{width}x{height}, light views {r['view_size']}^2"
        hits, cost = r["same_hits"]["share"], ms["tracing"] / dda[r["photons"]]
        yield _mark(f"{name}: hits as pixel by pixel", f">= {SAME_HITS:.1%}", f"{hits:.2%}", hits >= SAME_HITS, at)
        yield _mark(f"{name}: tracing over dda's", f"<= {MARCH_COST:.2f}", f"{cost:.2f}", cost <= MARCH_COST, at)
        largest = max(("tracing", "storing", "denoising"), key=lambda stage: float(ms[stage]))
        yield _mark(f"{name}: largest stage", "not tracing", largest, largest != "tracing", at)


def _eye(report: Report) -> Iterator[Mark]:
    eye = report.get("eye")
    if not eye:
        return
    p = eye["settings"]
    at = f"{p['size'][0]}x{p['size'][1]}, {p['views']} views"
    for one in eye["eye_rays"]:
        name, pooled = one["scene"], one["pooled"]
        if (least := NEWTON_SHARE.get(name)) is not None:
            share = max(
                v for k, v in zip(pooled["iterations"], pooled["within_1px"], strict=True) if k <= PAPER_ITERATIONS
            )
            what = f"{name}: Newton within 1 px in {PAPER_ITERATIONS} iterations"
            yield _mark(what, f">= {least:.0%}", f"{share:.2%}", share >= least, at)
        cascade = pooled["cascade"]
        what = f"{name}: cascade's share of what dda solves"
        yield _mark(what, f">= {CASCADE_SHARE:.1%}", f"{cascade:.2%}", cascade >= CASCADE_SHARE, at)
    area = p["size"][0] * p["size"][1]
    water = {  # a view that shows no refraction has no entry: then which is which is not known
        one["scene"]: [v["pixels"] / area for v in one["views"]]
        for one in eye["eye_rays"]
        if len(one["views"]) == p["views"]
    }
    yield from _eye_cost(eye["costs"], water)


def _eye_cost(costs: list[Any], water: Mapping[str, list[float]]) -> Iterator[Mark]:
    for name in dict.fromkeys(one["scene"] for one in costs):
        mine = [one for one in costs if one["scene"] == name]
        width, height = mine[0]["size"]
        at = f"{width}x{height}, worst of {len(mine)} views"
        ratio = max(one["without"]["cascade"]["total"] / one["without"]["dda"]["total"] for one in mine)
        what = f"{name}: cascade's cost over dda's, without reflections"
        yield _mark(what, f"<= {CASCADE_COST:.2f}", f"{ratio:.2f}", ratio <= CASCADE_COST, at)
        full = [
            one for one in mine if one["view"] < len(water.get(name, [])) and water[name][one["view"]] >= FULL_OF_WATER
        ]
        if full:
            cost = max(one["with_reflections"]["cascade"]["total"] for one in full)
            what = f"{name}: fetch passes of a view full of water"
            yield _mark(what, f"<= {WATER_COST:.0f}", f"{cost:.1f}", cost <= WATER_COST, at)
        solves = [(solve_cost(one["without"], "newton"), solve_cost(one["without"], "dda")) for one in mine]
        ratios = [newton / dda for newton, dda in solves if newton is not None and dda]
        if ratios:
            what = f"{name}: Newton's solve alone over dda's"
            yield _mark(what, f"<= {NEWTON_COST:.2f}", f"{max(ratios):.2f}", max(ratios) <= NEWTON_COST, at)
