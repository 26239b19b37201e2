"""Wrong input of every kind: exit code 2, one line on stderr that names the culprit, and no file left behind."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import glcaustics as glc
from glcaustics.cli import main
from glcaustics.errors import GlcError
from tests.gpu.feature_scenes import BACKEND, plane, scene_of, sheet, sun
from tests.robustness.hard_scenes import EYE

pytestmark = pytest.mark.gpu

SMALL = ["--size", "16x12", "--quality", "draft", "--backend", BACKEND]
WRONG: dict[str, tuple[list[str], str]] = {
    "method": (["dry-room", "--method", "photon_mao"], "photon_mao"),
    "quality": (["dry-room", "--quality", "ultra"], "ultra"),
    "aov": (["dry-room", "-o", "x.npz", "--aov", "depht_m"], "depht_m"),
    "scene": (["pol"], "pol"),
    "scene file": (["nowhere/x.glb"], "nowhere"),
    "scene kind": (["scene.obj"], ".obj"),
    "folder as scene": (["."], "."),
    "broken glb": (["broken.glb"], "broken.glb"),
    "empty glb": (["empty.glb"], "empty.glb"),
    "binary toml": (["binary.toml"], "binary.toml"),
    "option": (["pool", "--set", "caster_sze=64"], "caster_sze"),
    "option without value": (["pool", "--set", "caster_size"], "caster_size"),
    "option too large": (["pool", "--set", "caster_size=100000000"], "caster_size"),
    "option of wrong kind": (["pool", "--set", "caster_size=big"], "caster_size"),
    "option nan": (["pool", "--set", "max_radius=nan"], "max_radius"),
    "estimate": (["pool", "--set", "estimate=newton"], "newton"),
    "shadow size": (["pool", "--set", "shadow_size=0"], "shadow_size"),
    "shadow size, half": (["pool", "--set", "shadow_size=1.5"], "shadow_size"),
    "method's option without it": (["pool", "--method", "none", "--set", "caster_size=64"], "caster_size"),
    "size": (["pool", "--size", "12"], "12"),
    "size beyond the driver": (["dry-room", "--size", "30000x16"], "30000"),
    "no folder": (["pool", "-o", "nowhere/x.png"], "nowhere"),
    "folder as file": (["pool", "-o", "folder.png"], "folder.png"),
    "kind of file": (["pool", "-o", "x.jpg"], ".jpg"),
    "aov in png": (["pool", "-o", "x.png", "--aov", "depth_m"], "PNG"),
    "backend": (["pool", "--backend", "vulkan"], "vulkan"),
    "flag": (["pool", "--qualty", "low"], "qualty"),
}


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "broken.glb").write_bytes(b"glTF\x02\x00\x00\x00\xff\xff\xff\xff rubbish")
    (tmp_path / "empty.glb").write_bytes(b"")
    (tmp_path / "binary.toml").write_bytes(os.urandom(64) + b"\xff\xfe")
    (tmp_path / "scene.obj").write_text("v 0 0 0\n")
    (tmp_path / "folder.png").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_one_line_and_no_file(name: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv, culprit = WRONG[name]
    before = sorted(p.name for p in place.rglob("*"))
    given = [pair for pair in zip(SMALL[::2], SMALL[1::2], strict=True) if pair[0] not in argv]
    code = main(["render", *argv, *(word for pair in given for word in pair)])
    captured = capsys.readouterr()
    errors = [line for line in captured.err.splitlines() if not line.startswith("note: ")]
    assert code == 2, captured.err
    assert len(errors) == 1 and errors[0].startswith("error: ") and culprit in errors[0], captured.err
    assert "Traceback" not in captured.err and captured.out == ""
    assert sorted(p.name for p in place.rglob("*")) == before


def test_a_frame_that_fails_half_way_keeps_the_old_file(
    place: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk fills up while the picture is written: what was there before is still there, whole."""
    argv = ["render", "dry-room", "-o", "a.png", *SMALL]
    assert main(argv) == 0
    old = (place / "a.png").read_bytes()
    before = sorted(p.name for p in place.iterdir())

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("PIL.Image.Image.save", full)
    capsys.readouterr()
    code = main(argv)
    errors = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("note: ")]
    assert code == 2 and len(errors) == 1 and "No space" in errors[0]
    assert (place / "a.png").read_bytes() == old
    assert sorted(p.name for p in place.iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        ({"method": "caustics"}, "caustics"),
        ({"quality": "best"}, "best"),
        ({"aovs": ("colour",)}, "colour"),
        ({"options": {"march_steps": -1}}, "march_steps"),
        ({"options": {"shadow_size": True}}, "shadow_size"),
        ({"options": {"refraction": "raytrace"}}, "raytrace"),
        ({"backend": "directx"}, "directx"),
        ({"size": (0, 5)}, "0x5"),
    ],
)
def test_the_api_raises_one_line(arguments: dict[str, object], culprit: str) -> None:
    scene = scene_of([plane("floor", 1.0, -0.5), sheet("water", 0.5, 0.0)], [sun()], EYE)
    with pytest.raises(GlcError) as refused:
        with glc.Renderer(scene, **{"size": (8, 8), "backend": BACKEND, **arguments}) as renderer:  # type: ignore[arg-type]
            renderer.render(time=0.0)
    assert culprit in str(refused.value) and "\n" not in str(refused.value)


def test_a_renderer_closed_twice_and_used_after_says_so() -> None:
    scene = scene_of([plane("floor", 1.0)], [sun()], EYE)
    renderer = glc.Renderer(scene, (8, 8), backend=BACKEND)
    assert np.isfinite(renderer.render(time=0.0).image).all()
    renderer.close()
    renderer.close()
    with pytest.raises(GlcError, match="closed"):
        renderer.render(time=0.0)


@pytest.mark.parametrize("samples", [0, -1])
def test_samples_below_one_are_refused(samples: int) -> None:
    scene = scene_of([plane("floor", 1.0)], [sun()], EYE)
    with glc.Renderer(scene, (8, 8), backend=BACKEND) as renderer, pytest.raises(GlcError, match="samples"):
        renderer.render(time=0.0, samples=samples)
