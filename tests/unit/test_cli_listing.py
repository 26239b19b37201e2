"""`plan`, `scenes`, `methods` and `doctor`: what they print and with which exit code."""

from __future__ import annotations

import json
import math
import re
from types import SimpleNamespace
from typing import Any

import pytest

from glcaustics import cli
from glcaustics.caustics import photon_options
from glcaustics.caustics.light_solve import ESTIMATES
from glcaustics.caustics.registry import AUTO, METHODS, NONE, pick
from glcaustics.cli import doctor
from glcaustics.denoise import svgf
from glcaustics.errors import UsageError
from glcaustics.passes.refraction import SOLVERS
from glcaustics.quality import QUALITIES
from glcaustics.renderer.options import default_options, option_help, resolve_options
from glcaustics.scene.load import builtin_scenes

CHOICES = {"refraction": SOLVERS, "estimate": ESTIMATES, **photon_options.CHOICES, "denoise_history": svgf.HISTORIES}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """Puts a fake in the place of the planner; returns what it is asked."""
    calls: list[tuple[Any, ...]] = []

    def plan_frame(scene: Any, *rest: Any, options: dict[str, Any]) -> SimpleNamespace:
        calls.append((scene.name, *rest, options))
        return SimpleNamespace(explain=lambda: "the table", to_dot=lambda: "digraph {}")

    monkeypatch.setattr("glcaustics.renderer.plan_frame", plan_frame)
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


def test_methods_is_a_line_a_method(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["methods"]) == 0
    listed, _, hint = capsys.readouterr().out.partition("\n\n")
    assert [line.split()[0] for line in listed.splitlines()] == [*METHODS, AUTO, NONE]
    assert all(method.summary in listed for method in METHODS.values())
    assert "glcaustics methods NAME" in hint


@pytest.mark.parametrize("name", [*METHODS, AUTO, NONE])
def test_methods_describes_one_with_every_option(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["methods", name]) == 0
    out = capsys.readouterr().out
    method = pick(name)
    options, meanings = default_options(method, "medium"), option_help(method)
    assert (method.paper if method else NONE) in out
    for option, value in options.items():
        written = str(value).lower() if isinstance(value, bool) else value
        assert re.search(rf"^ +{option}={written} +{re.escape(meanings[option])}$", out, re.MULTILINE), option
        ladder = [str(default_options(method, quality)[option]) for quality in QUALITIES]
        row = re.search(rf"^ +{option} +{' +'.join(ladder)}$", out, re.MULTILINE)
        assert (row is not None) == (len(set(ladder)) > 1), option


def test_methods_refuses_an_unknown_name_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["methods", "caustics_map"]) == 2
    out, error = capsys.readouterr()
    assert out == "" and error.count("\n") == 1
    assert "caustics_map" in error and "did you mean caustic_map?" in error


@pytest.mark.parametrize("name", [*METHODS, NONE])
def test_the_ranges_in_the_help_are_those_that_are_checked(name: str) -> None:
    method = pick(name)
    for option, meaning in option_help(method).items():
        if span := re.search(r"\((\d+)\.\.(\d+)", meaning):
            low, high = int(span[1]), int(span[2])
            good, bad = [low, high], [low - 1, high + 1, "many", math.nan, True]
        elif "(true, false" in meaning:
            good, bad = [True, False, "true", "false"], [0, 1, "yes"]
        elif span := re.search(r"\((\d), (\d)\)$", meaning):
            good, bad = [int(span[1]), int(span[2])], [int(span[1]) - 1, int(span[2]) + 1]
        else:
            good, bad = [word for word in re.findall(r"\w+", meaning) if word in CHOICES[option]], ["", "something"]
            assert set(good) == set(CHOICES[option]), f"{option} is of no known kind, or its help leaves a word out"
        for value in good:
            assert str(resolve_options(method, "medium", {option: value})[option]).lower() == str(value).lower()
        for value in bad:
            with pytest.raises(UsageError, match=f"^[^\\n]*{option}[^\\n]*$"):
                resolve_options(method, "medium", {option: value})


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
