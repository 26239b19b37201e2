"""Times at equal error: the law of raw photons, bounds of the denoised, marks, and tables for terminal and page."""

from __future__ import annotations

import re
from dataclasses import asdict
from typing import Any

import pytest

from glcaustics.bench.equal_error import compare, denoised_cost, equal_error, photon_law, ratio_text
from glcaustics.bench.flicker import EXPONENTIAL, FILTER, PLAIN
from glcaustics.bench.marks import marks
from glcaustics.bench.plan import FlickerPlan
from glcaustics.bench.tables import Table, all_tables

VARIANCE, OVERHEAD_MS, MS_PER_PHOTON = 4000.0, 50.0, 0.001


def peer(photons: int, method: str = "ptracer", error: float | None = None, **more: Any) -> dict[str, Any]:
    """A row of Mitsuba that keeps the law exactly."""
    ms = OVERHEAD_MS + MS_PER_PHOTON * photons
    row = {"scene": "peer-pool", "tool": "mitsuba", "method": method, "quality": f"{photons}", "pixels": 64}
    found = {"rrmse": (VARIANCE / photons) ** 0.5 if error is None else error}
    return row | {"photons": photons, "time_ms": {"median": ms, "min": ms}, "errors": found} | more


def ours(error: float, ms: float, method: str = "displaced_mesh", **more: Any) -> dict[str, Any]:
    row = {"scene": "peer-pool", "tool": "glcaustics", "method": method, "quality": "low", "pixels": 64}
    return row | {"time_ms": {"median": ms, "min": ms}, "errors": {"rrmse": error}, "overrides": {}} | more


RAW = [peer(1 << k) for k in (14, 16, 18)]
CLEAN = [peer(1 << 14, "ptracer+oidn", 0.2), peer(1 << 16, "ptracer+oidn", 0.1), peer(1 << 18, "ptracer+oidn", 0.09)]


def test_the_law_is_found_again() -> None:
    law = photon_law(RAW)
    assert law is not None
    assert law.variance == pytest.approx(VARIANCE) and law.exponent == pytest.approx(-0.5)
    assert law.overhead_ms == pytest.approx(OVERHEAD_MS) and law.ms_per_photon == pytest.approx(MS_PER_PHOTON)
    assert law.time_ms(0.01) == pytest.approx(OVERHEAD_MS + MS_PER_PHOTON * VARIANCE / 1e-4)


def test_it_says_where_it_is_extrapolated() -> None:
    law = photon_law(RAW)
    assert law is not None
    assert [law.kind(e) for e in (0.01, 0.2, 0.9)] == ["extrapolated", "measured", "fewer photons than measured"]
    assert photon_law(RAW[:1]) is None and photon_law([]) is None


def test_times_that_do_not_grow_give_no_negative_cost() -> None:
    """Measured on a busy machine, more photons may seem to take no longer."""
    odd = [row | {"time_ms": {"median": ms, "min": ms}} for row, ms in zip(RAW, (300.0, 200.0, 250.0), strict=True)]
    law = photon_law(odd)
    assert law is not None and law.overhead_ms >= 0.0 and law.ms_per_photon > 0.0


def test_denoised_is_interpolated_or_bounded_never_extrapolated() -> None:
    between = denoised_cost(CLEAN, 0.15)
    assert between is not None and between["bound"] == ""
    assert CLEAN[0]["time_ms"]["median"] < between["ms"] < CLEAN[1]["time_ms"]["median"]
    stalled = denoised_cost(CLEAN, 0.01)
    assert stalled == {"ms": CLEAN[2]["time_ms"]["median"], "bound": ">", "error": 0.09}
    easy = denoised_cost(CLEAN, 0.5)
    assert easy is not None and easy["bound"] == "<" and denoised_cost([], 0.5) is None


def test_the_ratio_is_of_whole_frames_and_told_in_words() -> None:
    rows = [ours(0.01, 40.0), ours(0.3, 10.0, "none"), *RAW, *CLEAN]
    (entry,) = equal_error(rows)
    expected = (OVERHEAD_MS + MS_PER_PHOTON * VARIANCE / 1e-4) / 40.0
    assert entry["ptracer"]["ratio"] == pytest.approx(expected)
    assert ratio_text(entry, "ptracer") == "1000 x (extrapolated)"
    assert ratio_text(entry, "ptracer+oidn") == "> 7.8 x (then 0.09)"
    assert ratio_text(compare(0.2, 50.0, RAW, []), "ptracer") == "3.0 x"
    assert ratio_text(None, "ptracer") == "" and ratio_text(entry, "another") == ""
    assert equal_error([ours(0.01, 40.0)]) == [], "without a peer there is nothing to compare"
    assert equal_error([ours(0.01, 40.0, pixels=32), *RAW]) == [], "other sizes are not compared"


def test_all_frames_of_a_still_count() -> None:
    one, eight = (equal_error([ours(0.01, 40.0, frames=n), *RAW])[0] for n in (1, 8))
    assert eight["ms"] == 320.0 and one["ptracer"]["ratio"] == pytest.approx(8.0 * eight["ptracer"]["ratio"])


def test_marks_are_judged_and_listed() -> None:
    for ms, met in ((30.0, True), (300.0, False)):
        report = {"equal_error": equal_error([ours(0.01, ms), *RAW])}
        (mark,) = marks(report)
        assert mark["met"] is met and mark["mark"] == ">= 1000"
        text = "\n\n".join(table.text() for table in all_tables(report | {"marks": [mark]}))
        assert ("NOT met" in text) is not met and "(extrapolated)" in text
    assert marks({"rows": []}) == [] and list(all_tables({"rows": []})) == []


def photons(rrmse: float, flip: float, share: float, tracing_ms: float, flicker: float) -> dict[str, Any]:
    """A report's entry for a flooded scene."""
    ms = {"tracing": tracing_ms, "storing": 1.0, "denoising": 5.0, "buffers": 2.0, "reflected": 2.0}
    stage = {"photons": 1000, "size": [64, 48], "view_size": 32, "clock": "processor time", "frames": 2}
    series = [{"frames": 16, "rrmse": rrmse, "rrmse_plain": rrmse, "bias": 0.0}]
    settings = {"side": 64, "filtered": 32, "frames": 16, "view_size": 32, "flicker": asdict(FlickerPlan())}
    rows = [
        {"name": n, "flicker": f, "off_edges": f, "rmse": None}
        for n, f in ((EXPONENTIAL, 0.2), (PLAIN, 0.05), (FILTER, flicker))
    ]
    panned = {
        "rows": rows,
        "points": 900,
        "points_off_edges": 800,
        "motion_px": 0.3,
        "seconds": 2.0,
        "reference_seconds": 1.0,
    }
    return {
        "scene": "flooded-cornell",
        "settings": settings,
        "reference": {"source": "beams", "noise": 0.01},
        "flicker": panned,
        "static": [{"photons": 1000, "series": series, "frame_ms": 9.0, "processor_ms": 9.0, **series[0]}],
        "final": [{"photons": 1000, "flip": flip}],
        "stages": [
            stage | {"march": "hierarchical", "ms": ms, "same_hits": {"share": share}},
            stage | {"march": "dda", "ms": ms | {"tracing": 12.0}},
        ],
    }


@pytest.mark.parametrize(
    ("changed", "failed"),
    [
        ({}, set()),
        ({"rrmse": 0.11}, {"relative RMSE of irradiance"}),
        ({"flip": 0.06}, {"FLIP of the picture"}),
        ({"share": 0.99}, {"hits as pixel by pixel"}),
        ({"tracing_ms": 6.0}, {"tracing over dda's", "largest stage"}),
        ({"flicker": 0.026}, {"the filter's over a plain exponential mean's"}),
    ],
)
def test_marks_of_the_flooded_box(changed: dict[str, float], failed: set[str]) -> None:
    good = {"rrmse": 0.05, "flip": 0.02, "share": 0.999, "tracing_ms": 3.0, "flicker": 0.02}
    report = {"photons": [photons(**(good | changed))]}
    found = marks(report)
    assert len(found) == 6
    assert {
        next(words for words in m["what"].replace(":", ",").split(", ")[::-1]) for m in found if not m["met"]
    } == failed
    assert len(list(all_tables(report))) == 3


def test_a_report_without_a_pan_has_no_flicker() -> None:
    one = photons(0.05, 0.02, 0.999, 3.0, 0.02)
    text = "".join(table.text() for table in all_tables({"photons": [one]}))
    assert "0.30 px a frame" in text and re.search(r"plain exponential mean +0\.0500 +0\.0500\n", text)
    del one["flicker"]
    assert not any("flicker" in m["what"] for m in marks({"photons": [one]}))
    assert len(list(all_tables({"photons": [one]}))) == 2


def test_a_table_is_aligned() -> None:
    text = Table("title", ("name", "n"), [["a", "1"], ["long", "100"]], "a note").text()
    assert text.splitlines() == ["title", "  name    n", "  a       1", "  long  100", "  (a note)"]
