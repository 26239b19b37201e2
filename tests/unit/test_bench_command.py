"""`glcaustics bench` without measuring: stored reports, their table, their comparison, and what it refuses."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import glcaustics
from glcaustics.bench.page import page
from glcaustics.bench.plan import FULL, QUICK
from glcaustics.bench.store import CACHE_ENV, Store, default_cache, digest, scene_key
from glcaustics.bench.study import SCHEMA, Study
from glcaustics.bench.targets import TARGETS, bench_scene
from glcaustics.cli import main
from glcaustics.errors import UsageError

ROOT = Path(glcaustics.__file__).resolve().parents[1]


def row(method: str, ms: float, rrmse: float | None, tool: str = "glcaustics", **more: Any) -> dict[str, Any]:
    e = {"rrmse": rrmse, "rrmse_regular": rrmse, "mae": rrmse, "bias": 0.0, "psnr_db": 30.0, "flip": 0.1}
    return {
        "scene": "pool",
        "tool": tool,
        "method": method,
        "quality": "draft",
        "pixels": 8,
        "time_ms": {"median": ms, "min": ms, "max": ms, "runs": 3, "clock": "wall clock"},
        "first_frame_ms": 5.0,
        "errors": {"non_finite": 0.0} | (e if rrmse is not None else {}),
        "overrides": {},
        "passes": [{"name": "shade", "ms": 1.0, "bytes": 100}],
        "bytes_allocated": 1000,
    } | more


def document(rrmse: float = 0.1) -> dict[str, Any]:
    rows = [row("none", 2.0, None), row("caustic_map", 4.0, rrmse)]
    rows.append(row("ptracer", 400.0, 0.5, tool="mitsuba", photons=64))
    state = {"cpu": "<cpu>", "cores": 2, "system": "Linux", "load_average": 0.1, "gl_renderer": "llvmpipe"}
    fit = {"exponent": 1.0, "factor": 1.0, "spread": 1.0}
    scaling = [
        {"what": "time against pixels", "scene": "pool", "method": "caustic_map", "points": [[1, 2]], "fit": fit}
    ]
    reference = {"scene": "pool", "source": "beams", "noise": 0.01, "singular_pixels": 0.0, "singular_flux": 0.0}
    checked = {"scene": "pool", "source": "Mitsuba", "rrmse": 0.1, "expected_noise": 0.1, "ratio": 1.0, "bias": 0.0}
    return {
        "schema": SCHEMA,
        "created": "now",
        "command": "glcaustics bench",
        "glcaustics": "0",
        "commit": "0123456789abcdef",
        "dirty": False,
        "machine": state,
        "versions": {"numpy": "2"},
        "plan": {"scenes": ["pool"], "qualities": ["draft"]},
        "notes": ["a note"],
        "references": [reference],
        "validation": [checked | {"bias_sigma": 0.001, "agree": False}],
        "rows": rows,
        "scaling": scaling,
    }


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    path = tmp_path / "stored.json"
    path.write_text(json.dumps(document()))
    return path


def test_table_of_a_stored_report(stored: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--table", str(stored)]) == 0
    assert "| pool | caustic_map | draft | 0.1000 |" in capsys.readouterr().out


def test_check_passes_and_fails_by_exit_code(stored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    same = ["bench", "--check", str(stored), "--report", str(stored)]
    assert main(same) == 0
    worse = tmp_path / "worse.json"
    worse.write_text(json.dumps(document(rrmse=0.2)))
    assert main(["bench", "--check", str(stored), "--report", str(worse)]) == 1
    assert "regression: pool glcaustics caustic_map draft 8px: relative RMSE 0.2000" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--table", "missing.json"], "cannot read"),
        (["--check", "{folder}/not.json"], "is not JSON"),
        (["--check", "{folder}/other.json"], "schema is None"),
        (["--report", "x.json"], "--check STORED.json"),
        (["--scenes", "poool"], "did you mean pool"),
        (["--methods", "caustic_mop"], "did you mean caustic_map"),
        (["--qualities", "best"], "there is no quality"),
        (["--sizes", "64", "100", "-o", "{folder}/out"], "does not divide"),
        (["--sizes", "0"], "whole number"),
        (["--parts", "eyes"], "did you mean eye"),
        (["--quick", "-o", "{folder}/not.json/deep"], "cannot make the folder"),
    ],
)
def test_wrong_input_is_one_line(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "not.json").write_text("{")
    (tmp_path / "other.json").write_text("[]")
    assert main(["bench", *(a.format(folder=tmp_path) for a in arguments)]) == 2
    told = capsys.readouterr().err.strip()
    assert words in told and "\n" not in told


def test_the_checkout_has_the_module(stored: Path) -> None:
    command = [sys.executable, "-m", "bench", "--table", str(stored)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert "caustic_map" in done.stdout


def test_the_page_is_self_contained_and_escaped() -> None:
    maps = {name: np.full((8, 8), 1.0) for name in ("pool reference", "pool caustic_map draft")}
    picture = {"pool": np.zeros((9, 16, 3), np.uint8)}
    text = page(document(), maps, {"error-pool.png": b"PNG", "time-against-pixels.png": b"PNG"}, picture)
    assert not re.findall(r"(?:src|href)=\"(?!data:)", text)
    assert "&lt;cpu&gt;" in text and "<cpu>" not in text
    assert text.count("<img") == 6, "the scene, reference, map, its error, and two plots"
    assert '<span class="bad">no</span>' in text and "a note" in text


def test_store_keeps_and_ignores_what_is_broken(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert store.load("a") is None
    store.save("a", {"x": 1}, {"image": np.arange(3.0)})
    kept = store.load("a")
    assert kept is not None and kept[0] == {"x": 1} and kept[1]["image"].tolist() == [0.0, 1.0, 2.0]
    whole = (tmp_path / "a.npz").read_bytes()
    for broken in (b"", b"PK broken", whole[: len(whole) // 2]):
        (tmp_path / "a.npz").write_bytes(broken)
        assert store.load("a") is None


def test_the_cache_is_where_it_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CACHE_ENV, str(tmp_path / "cache"))
    assert default_cache() == tmp_path / "cache" / "bench"
    monkeypatch.delenv(CACHE_ENV)
    assert default_cache() == Path.home() / ".cache" / "glcaustics" / "bench"


def test_keys_tell_scenes_apart() -> None:
    keys = {scene_key(bench_scene(name)) for name in ("peer-pool", "glass-sphere", "metal-ring")}
    assert len(keys) == 3
    assert scene_key(bench_scene("peer-pool")) in keys
    assert digest(np.zeros(4)) != digest(np.zeros((2, 2)))


@pytest.mark.parametrize("plan", [FULL, QUICK])
def test_plans_name_scenes_with_targets(plan: Any) -> None:
    assert set(plan.scenes) <= set(TARGETS) and len(plan.scenes) >= 4
    assert all(plan.largest % size == 0 for size in plan.sizes)


def test_a_scene_without_a_target_is_refused(tmp_path: Path) -> None:
    from dataclasses import replace

    with pytest.raises(UsageError, match="has no target"):
        Study(replace(QUICK, scenes=("dry-room",)), tmp_path)


def test_the_page_shows_the_parts_that_were_measured() -> None:
    """Without any target measured: pictures and maps of the flooded box, rays, the mesh, all as data URIs."""
    ms = {"tracing": 3.0, "storing": 1.0, "denoising": 5.0, "buffers": 2.0, "reflected": 2.0}
    stage = {"photons": 9, "size": [4, 4], "view_size": 4, "clock": "a clock", "frames": 1, "ms": ms}
    errors = {"frames": 2, "rrmse": 0.05, "rrmse_plain": 0.04, "bias": 0.0}
    photons = {
        "scene": "box",
        "settings": {"side": 8, "filtered": 8, "frames": 2, "view_size": 4},
        "reference": {"source": "beams", "noise": 0.01},
        "static": [{"photons": 9, "series": [errors], "frame_ms": 1.0, "processor_ms": 1.0, **errors}],
        "final": [{"photons": 9, "flip": 0.01}],
        "stages": [stage | {"march": "hierarchical", "same_hits": {"share": 1.0}}, stage | {"march": "dda"}],
    }
    pooled = {"iterations": [0, 1], "within_1px": [0.5, 1.0], "wrong": [0.0, 0.0], "cascade": 1.0, "hierarchical": 1.0}
    rays = [{"scene": "pool", "pooled": pooled, "views": []}]
    eye = {
        "settings": {"scenes": ["pool"], "views": 1, "size": [8, 8]},
        "eye_rays": rays,
        "light_rays": [],
        "costs": [],
    }
    mesh = {"strength": 1.0, "mesh": 128, "map": 512, "rrmse": 0.03, "mae": 0.01, "bias": 0.0}
    report = document() | {"rows": [], "scaling": [], "validation": [], "photons": [photons], "eye": eye}
    report |= {"mesh": {"rows": [mesh], "noise": {"s=1": 0.001}, "orders": [], "pixels": 8}}
    report |= {"marks": [{"what": "<what>", "mark": "1", "measured": "2", "met": False, "at": "8^2"}]}
    maps = {name: np.full((8, 8), 1.0) for name in ("box view reference", "box view 9")}
    shown = ("box with the reference", "box 9 photons", "pool view")
    text = page(report, maps, {"rays-pool.png": b"PNG"}, {name: np.zeros((8, 8, 3), np.uint8) for name in shown})
    assert not re.findall(r"(?:src|href)=\"(?!data:)", text)
    assert text.count("<img") == 3 + 3 + 2, "pictures and their difference; maps and their error; a view and its curve"
    assert '<span class="bad">NOT met</span>' in text and "&lt;what&gt;" in text
    for words in (
        "The displaced mesh against beams",
        "box: milliseconds and shares",
        "Newton&#x27;s share of eye rays",
    ):
        assert words in text
