"""LuxCore as a peer: what it is given, and what it gives back, held against the beams."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from glcaustics.bench.caustics_part import CausticsPart
from glcaustics.bench.cells import Cells
from glcaustics.bench.luxcore_peer import BORDER, has_luxcore, luxcore_rows, luxcore_scene
from glcaustics.bench.plan import QUICK
from glcaustics.bench.references import beam_reference
from glcaustics.bench.store import Store
from glcaustics.bench.targets import bench_scene, target_of


def test_floor_fills_the_film() -> None:
    target = target_of("pool")
    given = luxcore_scene(bench_scene("pool"), target, 32)
    step = 2.0 * target.half_m / 32
    film_m = 2.0 * math.tan(math.radians(0.5 * given["fov_deg"])) * (target.pinhole_ws[1] - target.centre_ws[1])
    assert given["pixels"] == 32 + 2 * BORDER
    assert film_m == pytest.approx(given["pixels"] * step)
    assert np.ptp(given["floor_points"][:, 0]) == pytest.approx(film_m)


def test_light_that_reaches_the_target_goes_through_the_kept_water() -> None:
    scene, target = bench_scene("pool"), target_of("pool")
    given = luxcore_scene(scene, target, 32)
    points, d = given["water_points"], given["sun_direction"]
    centre, drop = np.asarray(target.centre_ws)[[0, 2]], points[:, 1].mean() - target.centre_ws[1]
    unrefracted = d[[0, 2]] / -d[1] * drop  # light that slipped past the water would land so much farther on
    for shift in (unrefracted, unrefracted / 1.333):
        assert (points[:, [0, 2]].min(axis=0) < centre - target.half_m - shift).all()
        assert (points[:, [0, 2]].max(axis=0) > centre + target.half_m - shift).all()
    assert given["water_triangles"].max() == len(points) - 1


@pytest.mark.skipif(not has_luxcore(), reason="pyluxcore is not installed")
def test_picture_agrees_with_the_beams_in_absolute_units(tmp_path: Path) -> None:
    scene, target = bench_scene("pool"), target_of("pool")
    truth = beam_reference(scene, target, 32, 160, Store(tmp_path)).mean
    rows, images = luxcore_rows(scene, target, 32, (1.0,))
    assert rows[0]["quality"] == "1 s"
    assert images[0].mean() == pytest.approx(truth.mean(), rel=0.01)
    assert np.sqrt(np.mean((images[0] - truth) ** 2)) < 0.2 * truth.mean()


def test_absence_is_announced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("glcaustics.bench.caustics_part.has_luxcore", lambda: False)
    part = CausticsPart(QUICK, Cells(tmp_path, "auto", 1))
    part._luxcore(bench_scene("pool"), target_of("pool"), None)  # type: ignore[arg-type]
    assert part.rows == []
    assert part.cells.notes == ["pyluxcore is not installed (extra luxcore): LuxCore's LIGHTCPU is left out"]
