"""The bench's arithmetic: fits, fronts, regressions by ratio, the README's table."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from glcaustics.bench.analysis import caustics_ms, cost_at_error, fit_power, pareto, regressions
from glcaustics.bench.measure import errors, reduced, regular
from glcaustics.bench.mitsuba_truth import Halves, agreement
from glcaustics.bench.readme import table
from glcaustics.errors import UsageError


def row(method: str, ms: float, rrmse: float | None = None, **more: Any) -> dict[str, Any]:
    clock = {"median": ms, "min": 0.9 * ms, "max": 1.3 * ms, "runs": 5, "clock": "wall clock"}
    found = {"non_finite": 0.0} | ({} if rrmse is None else {"rrmse": rrmse, "flip": 0.01, "bias": -0.001})
    base = {"scene": "pool", "tool": "glcaustics", "method": method, "quality": "low", "pixels": 64}
    return base | {"time_ms": clock, "errors": found, "overrides": {}} | more


def report(*rows: dict[str, Any]) -> dict[str, Any]:
    machine = {"gl_renderer": "llvmpipe", "cpu": "a cpu", "cores": 2}
    return {"rows": list(rows), "machine": machine, "commit": "0123456789ab", "dirty": False, "command": "bench"}


def test_fit_power_finds_the_exponent_and_how_far_points_are_off() -> None:
    x = [1.0, 10.0, 100.0, 1000.0]
    fit = fit_power(x, [3.0 * v**-0.5 for v in x])
    assert fit is not None
    assert fit["exponent"] == pytest.approx(-0.5) and fit["factor"] == pytest.approx(3.0)
    assert fit["spread"] == pytest.approx(1.0)
    off = fit_power(x, [1.0, 10.0, 200.0, 1000.0])
    assert off is not None and off["spread"] > 1.3


@pytest.mark.parametrize(
    ("x", "y"), [([1.0, 2.0], [1.0, 2.0]), ([1.0, 2.0, 3.0], [1.0, 0.0, 3.0]), ([5.0] * 3, [1.0] * 3)]
)
def test_fit_power_refuses_too_little(x: list[float], y: list[float]) -> None:
    assert fit_power(x, y) is None


def test_pareto_keeps_what_nothing_beats() -> None:
    points = [(5.0, 0.1), (1.0, 0.9), (2.0, 0.95), (3.0, 0.3), (9.0, 0.1)]
    assert pareto(points) == [1, 3, 0]


def test_cost_at_error_interpolates_and_never_extrapolates() -> None:
    rows = [row("ptracer", 10.0, 1.0), row("ptracer", 1000.0, 0.1)]
    assert cost_at_error(rows, 1.0 / np.sqrt(10.0)) == pytest.approx(100.0)
    assert cost_at_error(rows, 0.05) is None and cost_at_error(rows, 2.0) is None


def test_caustics_ms_takes_the_frame_without_caustics_off() -> None:
    rows = [row("none", 4.0), row("caustic_map", 10.0, 0.1)]
    assert caustics_ms(rows, rows[1]) == pytest.approx(6.0)
    assert caustics_ms(rows[1:], rows[1]) is None


def test_the_same_report_has_no_regression_on_a_slower_machine() -> None:
    old = report(row("none", 4.0), row("caustic_map", 10.0, 0.1))
    slow = report(row("none", 40.0), row("caustic_map", 100.0, 0.1))
    assert regressions(old, slow) == ([], 1)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (row("caustic_map", 10.0, 0.125), "relative RMSE"),
        (row("caustic_map", 19.0, 0.1), "1.90 times as slow"),
        (row("caustic_map", 10.0) | {"errors": {"non_finite": 0.01}}, "not finite"),
    ],
)
def test_a_regression_is_told(changed: dict[str, Any], words: str) -> None:
    old = report(row("none", 4.0), row("caustic_map", 10.0, 0.1))
    worse, compared = regressions(old, report(row("none", 4.0), changed))
    assert compared == 1 and len(worse) == 1 and words in worse[0]


def test_one_slow_row_of_three_counts_only_when_it_is_far_off() -> None:
    scenes = ("a", "b", "c")

    def run(*ms: float) -> dict[str, Any]:
        mine = [row("caustic_map", t, 0.1, scene=s) for s, t in zip(scenes, ms, strict=True)]
        return report(*(row("none", 4.0, scene=s) for s in scenes), *mine)

    assert regressions(run(10.0, 10.0, 10.0), run(10.0, 25.0, 10.0)) == ([], 3)
    worse, _ = regressions(run(10.0, 10.0, 10.0), run(10.0, 40.0, 10.0))
    assert len(worse) == 1 and worse[0].startswith("b glcaustics caustic_map low 64px: 10.00 times")


def test_rows_of_other_sizes_and_peers_are_not_compared() -> None:
    old = report(row("caustic_map", 10.0, 0.1), row("ptracer", 10.0, 0.1, tool="mitsuba"))
    new = report(row("caustic_map", 10.0, 9.0, pixels=128), row("ptracer", 10.0, 9.0, tool="mitsuba"))
    assert regressions(old, new) == ([], 0)


def peer(ms: float, rrmse: float, photons: int, method: str = "ptracer") -> dict[str, Any]:
    return row(method, ms, rrmse, tool="mitsuba", photons=photons)


def test_table_has_a_line_per_row_and_says_where_it_is_from() -> None:
    peers = [peer(100.0, 0.5, 1000), peer(10000.0, 0.05, 100000)]
    text = table(report(row("none", 4.0), row("caustic_map", 10.0, 0.1), *peers))
    lines = text.splitlines()
    assert lines[2].startswith("| pool | caustic_map | low | 0.1000 |") and "| 10 | 6 | 250 x |" in lines[2]
    assert len({line.count("|") for line in lines[:3]}) == 1
    assert "llvmpipe" in text and "0123456789" in text


def test_table_says_what_is_extrapolated_or_not_reached() -> None:
    peers = [peer(100.0, 0.5, 1000), peer(10000.0, 0.05, 100000), peer(2000.0, 0.2, 1000, "ptracer+oidn")]
    text = table(report(row("caustic_map", 10.0, 0.01), *peers))
    assert "| 25000 x (extr.) | > 200 x (then 0.2) |" in text


def test_table_without_targets_is_refused() -> None:
    with pytest.raises(UsageError, match="no measurement"):
        table(report())


# ---------------------------------------------------------------- references


def halves(noise: float, bias: float = 0.0, seed: int = 0, pixels: int = 64) -> Halves:
    generator = np.random.default_rng(seed)
    truth = 1.0 + 0.5 * np.sin(np.arange(pixels))[None, :] * np.ones((pixels, 1))
    first, second = (truth * (1.0 + bias) + noise * generator.standard_normal(truth.shape) for _ in range(2))
    return Halves(first, second)


def test_halves_know_their_noise() -> None:
    assert halves(0.2).noise == pytest.approx(0.2 / np.sqrt(2.0), rel=0.05)


def test_references_that_differ_by_noise_agree() -> None:
    found = agreement(halves(0.01), halves(0.2, seed=1))
    assert found["agree"] and found["ratio"] == pytest.approx(1.0, abs=0.1)


def test_references_that_differ_by_more_do_not() -> None:
    assert not agreement(halves(0.01), halves(0.05, bias=0.02, seed=1))["agree"]
    other = halves(0.05, seed=1)
    shifted = Halves(np.roll(other.first, 1, axis=1), np.roll(other.second, 1, axis=1))
    assert not agreement(halves(0.01), shifted)["agree"]


def test_errors_take_the_reference_noise_off() -> None:
    noisy, clean = halves(0.3), halves(0.0).mean
    found = errors(noisy, clean * 1.1)
    expected = float(np.sqrt(np.mean((0.1 * clean) ** 2)) / clean.mean())
    assert found["rrmse"] == pytest.approx(expected, abs=0.03)
    assert found["bias"] == pytest.approx(0.1, abs=0.02)


def test_errors_of_a_broken_map_are_its_share_alone() -> None:
    truth = halves(0.0)
    broken = copy.deepcopy(truth.mean)
    broken[3, 4] = np.nan
    assert errors(truth, broken) == {"non_finite": 1 / broken.size}


def test_foci_and_their_neighbours_are_not_regular() -> None:
    image = np.ones((32, 32))
    image[10, 20] = 100.0
    mask = regular(image)
    assert (~mask).sum() == 9 and not mask[9, 19] and mask[8, 20]


def test_reduced_keeps_the_mean() -> None:
    small = reduced(halves(0.2), 16)
    assert small.first.shape == (16, 16) and small.mean.mean() == pytest.approx(halves(0.2).mean.mean())
