"""`plan`, `scenes`, `methods` and `doctor`: what they print and with which exit code."""

from __future__ import annotations

import json
import re
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from glcaustics import cli
from glcaustics.cli import doctor
from glcaustics.scene.load import builtin_scenes

METHOD = SimpleNamespace(
    summary="Splats light on what it hits.",
    paper="Shah, Konttinen, Pattanaik 2007",
    ladder={"draft": {"map_size": 128}, "medium": {"map_size": 512, "estimate": "hybrid"}},
)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """Puts fakes in the place of the registry and the planner; returns what the planner is asked."""
    calls: list[tuple[Any, ...]] = []

    def plan_frame(scene: Any, *rest: Any, options: dict[str, Any]) -> SimpleNamespace:
        calls.append((scene.name, *rest, options))
        return SimpleNamespace(explain=lambda: "the table", to_dot=lambda: "digraph {}")

    for name, members in {
        "glcaustics.renderer": {"AOVS": {"depth_m": "distance"}, "plan_frame": plan_frame},
        "glcaustics.caustics.registry": {"METHODS": {"caustic_map": METHOD}},
    }.items():
        module = ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    return calls


def test_plan_prints_the_table(asked: list[Any], capsys: pytest.CaptureFixture[str]) -> None:
    argv = "plan peer-pool --size 64x32 --method caustic_map --quality high --aov depth_m --set depth_layers=2"
    assert cli.main(argv.split()) == 0
    assert asked == [("peer-pool", (64, 32), "caustic_map", "high", ("depth_m",), {"depth_layers": 2})]
    assert capsys.readouterr().out == "the table\n"


def test_plan_prints_graphviz(asked: list[Any], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["plan", "peer-pool", "--dot"]) == 0
    assert capsys.readouterr().out == "digraph {}\n"


def test_plan_refuses_an_unknown_scene(asked: list[Any], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["plan", "peer-poll"]) == 2
    assert "peer-pool" in capsys.readouterr().err
    assert asked == []


def test_methods_names_paper_and_ladder(asked: list[Any], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["methods"]) == 0
    out = capsys.readouterr().out
    assert "Shah, Konttinen, Pattanaik 2007" in out
    assert "medium     map_size=512  estimate=hybrid" in out
    assert re.search(r"^ +depth_layers +2: eye rays that end behind", out, re.MULTILINE)


def test_every_option_of_the_frame_has_its_help() -> None:
    from glcaustics.passes.options import OPTION_HELP
    from glcaustics.renderer.options import BASE_LADDER

    for options in BASE_LADDER.values():
        assert set(options) == set(OPTION_HELP)


def test_scenes_lists_every_built_in_scene_with_its_licence(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["scenes"]) == 0
    out = capsys.readouterr().out
    assert {"pool", "peer-pool", "glass-sphere", "glass-bunny", "metal-ring", "dry-room"} <= set(out.split())
    for name, purpose, licence in builtin_scenes():
        assert purpose and licence, f"{name} says neither why it exists nor whose it is"
        assert purpose in out and f"licence: {licence}" in out


WORKS = {
    "works": True,
    "software": True,
    "float_blend_measured": True,
    "info": {"renderer": "llvmpipe", "max_viewport": [64, 64], "features": {"compute shaders": False}},
}
FAILS = {"works": False, "error": "backend 'glfw' gave no context; apt-get install xvfb"}


def test_doctor_tells_what_works_and_what_mends_the_rest(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor, "_probe_apart", lambda backend: WORKS if backend == "egl" else FAILS)
    assert cli.main(["doctor"]) == 0
    out = capsys.readouterr().out
    assert "backend egl: works, software" in out
    assert re.search(r"compute shaders +no$", out, re.MULTILINE)
    assert "apt-get install xvfb" in out
    assert out.endswith("ready: rendering works with --backend egl\n")


def test_doctor_exits_2_when_nothing_works(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    no_blending = WORKS | {"float_blend_measured": False}
    monkeypatch.setattr(doctor, "_probe_apart", lambda backend: no_blending if backend == "egl" else FAILS)
    assert cli.main(["doctor", "--json"]) == 2
    backends = json.loads(capsys.readouterr().out)["backends"]
    assert set(backends) == {"egl", "osmesa", "glfw"}


def test_doctor_survives_a_probe_that_crashes(monkeypatch: pytest.MonkeyPatch) -> None:
    crashed = SimpleNamespace(stdout="", stderr="libEGL warning\nSegmentation fault", returncode=-11)
    monkeypatch.setattr(doctor.subprocess, "run", lambda *args, **options: crashed)
    found = doctor._probe_apart("egl")
    assert found == {"works": False, "error": "the probe ended with code -11: Segmentation fault"}
