"""The command line without a GPU: what it asks of the renderer, what it writes, how it refuses."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from glcaustics import cli, output
from glcaustics.errors import DeviceError, SceneError

AOVS = {"image": "the picture", "caustic_irradiance": "E_c", "depth_m": "distance"}


class FakeRenderer:
    """Stands in for glcaustics.renderer.Renderer and remembers what it was asked."""

    made: list[FakeRenderer] = []
    fail_at: int | None = None
    delivers = ("caustic_irradiance", "depth_m")

    def __init__(self, scene: Any, **options: Any) -> None:
        self.scene, self.options, self.times = scene, options, []
        self.samples: list[int] = []
        self.announcements = (*scene.announcements, "auto took egl")
        FakeRenderer.made.append(self)

    def __enter__(self) -> FakeRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def render(self, time: float, samples: int = 1) -> SimpleNamespace:
        if len(self.times) == FakeRenderer.fail_at:
            raise DeviceError("the context was lost", where="lighting", remedy="try again")
        self.times.append(time)
        self.samples.append(samples)
        width, height = self.options["size"]
        image = np.full((height, width, 3), time, dtype=np.float32)
        aov = {name: image for name in self.options["aovs"] if name in FakeRenderer.delivers}
        stats = {"frame_ms": 12.5, "method": "caustic_map", "quality": "medium", "backend": "egl", "lost_flux": 0.0123}
        return SimpleNamespace(image=image, ldr=image.astype(np.uint8), aov=aov, stats=stats)


def fake_module(name: str, **members: Any) -> ModuleType:
    module = ModuleType(name)
    vars(module).update(members)
    return module


@pytest.fixture(autouse=True)
def fakes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def load_scene(name: str) -> SimpleNamespace:
        if name == "lost":
            raise SceneError("no such scene 'lost'", remedy="glcaustics scenes lists them")
        return SimpleNamespace(name=name, announcements=("no light: a sun was added",), quality="low", method=None)

    monkeypatch.setattr(FakeRenderer, "made", [])
    monkeypatch.setattr(FakeRenderer, "fail_at", None)
    monkeypatch.setattr(FakeRenderer, "delivers", ("caustic_irradiance", "depth_m"))
    renderer = fake_module("glcaustics.renderer", Renderer=FakeRenderer, AOVS=AOVS)
    monkeypatch.setitem(sys.modules, "glcaustics.renderer", renderer)
    load = fake_module("glcaustics.scene.load", load_scene=load_scene)
    monkeypatch.setitem(sys.modules, "glcaustics.scene.load", load)
    registry = fake_module("glcaustics.caustics.registry", METHODS={"caustic_map": None})
    monkeypatch.setitem(sys.modules, "glcaustics.caustics.registry", registry)
    monkeypatch.chdir(tmp_path)


def refused(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    """Runs a command that must exit 2 with one line on stderr and leave no file; returns the line."""
    before = sorted(Path().iterdir())
    assert cli.main(argv) == 2
    captured = capsys.readouterr()
    lines = [line for line in captured.err.splitlines() if not line.startswith("note: ")]
    assert len(lines) == 1 and lines[0].startswith("error: ")
    assert captured.out == ""
    assert sorted(Path().iterdir()) == before
    return lines[0]


def test_render_writes_the_picture_and_one_summary_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["render", "pool", "--size", "8x6"]) == 0
    with Image.open("pool.png") as picture:
        assert picture.size == (8, 6)
    captured = capsys.readouterr()
    assert captured.out == (
        "pool.png: 8x6, method caustic_map, quality medium, 12.5 ms per frame on egl, lost flux 1.23 %\n"
    )
    assert captured.err.splitlines() == ["note: no light: a sun was added", "note: auto took egl"]


def test_render_hands_every_option_on() -> None:
    argv = "render a/b.glb -o x.npz --size 4x2 --method none --quality high --aov depth_m --backend osmesa --seed 7"
    assert cli.main([*argv.split(), "--no-specular-view", "--set", "map_size=64", "--set", "estimate=newton"]) == 0
    assert FakeRenderer.made[0].options == {
        "size": (4, 2),
        "method": "none",
        "quality": "high",
        "backend": "osmesa",
        "aovs": ("depth_m",),
        "specular_view": False,
        "seed": 7,
        "options": {"map_size": 64, "estimate": "newton"},
        "taa": False,
    }


def test_taa_takes_one_sample_a_frame() -> None:
    assert cli.main(["render", "pool", "--size", "4x2", "--taa"]) == 0
    assert cli.main(["render", "pool", "--size", "4x2"]) == 0
    assert [made.options["taa"] for made in FakeRenderer.made] == [True, False]
    assert [made.samples for made in FakeRenderer.made] == [[1], [4]]
    assert cli.main(["render", "pool", "--taa", "--samples", "4"]) == 2


def test_quality_falls_back_to_the_scene_s_own() -> None:
    assert cli.main(["render", "pool", "--size", "4x2"]) == 0
    assert FakeRenderer.made[0].options["quality"] == "low"


def test_sequence_numbers_its_files_and_steps_time() -> None:
    argv = "render pool -o out.png --size 4x2 --frames 3 --time 1 --fps 4 --json stats.json"
    assert cli.main(argv.split()) == 0
    assert FakeRenderer.made[0].times == [1.0, 1.25, 1.5]
    assert sorted(path.name for path in Path().glob("out*")) == ["out.0000.png", "out.0001.png", "out.0002.png"]
    document = json.loads(Path("stats.json").read_text())
    assert [record["time_s"] for record in document["frames"]] == [1.0, 1.25, 1.5]
    assert document["frames"][2]["stats"]["lost_flux"] == 0.0123


def test_json_on_standard_output_is_all_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["render", "pool", "--size", "4x2", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["size"] == [4, 2]


def test_npz_without_aov_holds_all_of_them() -> None:
    assert cli.main(["render", "pool", "--size", "4x2", "-o", "x.npz"]) == 0
    with np.load("x.npz") as arrays:
        assert set(arrays) == set(AOVS)


def test_aov_names_may_be_joined_by_commas() -> None:
    assert cli.main(["render", "pool", "--size", "4x2", "-o", "x.npz", "--aov", "depth_m,image", "depth_m"]) == 0
    with np.load("x.npz") as arrays:
        assert set(arrays) == {"image", "depth_m"}


def test_list_aovs_needs_no_scene(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["render", "--list-aovs"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(AOVS)


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        ("", "COMMAND"),
        ("rendr pool", "invalid choice: 'rendr'"),
        ("render", "which scene?"),
        ("render lost", "no such scene 'lost'"),
        ("render pool --size 12", "'12' is not a size"),
        ("render pool --size 0x4", "each side must be 1 to"),
        ("render pool --frames 0", "--frames"),
        ("render pool --fps 0", "must be above 0"),
        ("render pool --time nan", "not finite"),
        ("render pool --seed -1", "--seed"),
        ("render pool --quality best", "--quality"),
        ("render pool --backend metal", "--backend"),
        ("render pool --method caustic_mapp", "did you mean caustic_map?"),
        ("render pool -o x.npz --aov depth", "did you mean depth_m?"),
        ("render pool --aov depth_m", "a PNG holds the picture alone"),
        ("render pool -o x.bmp", ".bmp is not a picture format"),
        ("render pool -o no/x.png", "no directory no"),
        ("render pool --json no/x.json", "no directory no"),
        ("render pool --json pool.png", "both the picture and the JSON file"),
        ("render pool --set map_size", "not a setting"),
        ("render pool --set a=1 --set a=2", "a is set twice"),
        ("render pool -o %d%d.png --frames 2", "more than one frame number field"),
    ],
)
def test_wrong_input_is_refused_before_any_work(capsys: pytest.CaptureFixture[str], argv: str, message: str) -> None:
    assert message in refused(capsys, *argv.split())
    assert FakeRenderer.made == []


def test_a_lost_context_is_one_line_and_no_file(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FakeRenderer, "fail_at", 0)
    line = refused(capsys, "render", "pool", "--size", "4x2")
    assert line == "error: lighting: the context was lost; try again"


def test_an_aov_that_the_scene_does_not_deliver_is_refused(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FakeRenderer, "delivers", ("caustic_irradiance",))
    assert "delivers no depth_m" in refused(capsys, *"render pool --size 4x2 -o x.npz --aov depth_m".split())


def test_interrupt_exits_130(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(path: Any, **arrays: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(output, "save_frame", interrupt)
    assert cli.main(["render", "pool", "--size", "4x2"]) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "interrupted"


def test_long_sequences_tell_how_far_they_are(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("glcaustics.cli.render.PROGRESS_INTERVAL_S", 0.0)
    assert cli.main("render pool --size 4x2 --frames 2".split()) == 0
    progress = [line for line in capsys.readouterr().err.splitlines() if line.startswith("frame ")]
    assert [line.split(":")[0] for line in progress] == ["frame 1/2", "frame 2/2"]
