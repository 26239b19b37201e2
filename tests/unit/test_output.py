"""Files that hold what they should, and no file at all when writing fails."""

from __future__ import annotations

import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from glcaustics import output
from glcaustics.errors import UsageError

HEIGHT, WIDTH = 3, 5


@pytest.fixture
def frame() -> dict[str, Any]:
    rng = np.random.default_rng(1)
    return {
        "image": rng.random((HEIGHT, WIDTH, 3), dtype=np.float32) * 40.0,
        "ldr": rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8),
        "aov": {
            "caustic_irradiance": rng.random((HEIGHT, WIDTH, 3), dtype=np.float32),
            "normal_ws": rng.random((HEIGHT, WIDTH, 3), dtype=np.float32),
            "depth_m": rng.random((HEIGHT, WIDTH), dtype=np.float32),
        },
    }


def test_png_holds_the_ldr_picture(tmp_path: Path, frame: dict[str, Any]) -> None:
    output.save_frame(tmp_path / "a.png", **frame)
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.mode == "RGB"
        np.testing.assert_array_equal(np.asarray(picture), frame["ldr"])


def test_npz_holds_every_array_under_its_name(tmp_path: Path, frame: dict[str, Any]) -> None:
    output.save_frame(tmp_path / "a.npz", **frame)
    with np.load(tmp_path / "a.npz") as arrays:
        assert set(arrays) == {"image", *frame["aov"]}
        assert all(arrays[name].dtype == np.float32 for name in arrays)
        np.testing.assert_array_equal(arrays["image"], frame["image"])
        np.testing.assert_array_equal(arrays["depth_m"], frame["aov"]["depth_m"])


def test_exr_layers(tmp_path: Path, frame: dict[str, Any]) -> None:
    openexr = pytest.importorskip("OpenEXR")
    output.save_frame(tmp_path / "a.exr", **frame)
    with openexr.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        channels = file.channels()
        layers = {f"caustic_irradiance.{c}" for c in "RGB"} | {f"normal_ws.{c}" for c in "XYZ"}
        assert set(channels) == {"R", "G", "B", "depth_m.V"} | layers
        np.testing.assert_array_equal(channels["G"].pixels, frame["image"][..., 1])
        np.testing.assert_array_equal(channels["normal_ws.Z"].pixels, frame["aov"]["normal_ws"][..., 2])


@pytest.mark.parametrize("suffix", [".png", ".npz", ".exr"])
def test_same_frame_gives_the_same_bytes(tmp_path: Path, frame: dict[str, Any], suffix: str) -> None:
    for name in ("a", "b"):
        output.save_frame(tmp_path / f"{name}{suffix}", **frame)
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_a_failure_keeps_the_old_file_and_leaves_no_other(
    tmp_path: Path, frame: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "a.npz"
    target.write_bytes(b"old")

    def fail(part: Path, arrays: Any) -> None:
        part.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(output, "_save_npz", fail)
    with pytest.raises(UsageError, match="No space left on device"):
        output.save_frame(target, **frame)
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_an_interrupt_leaves_nothing(tmp_path: Path, frame: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(part: Path, ldr: Any) -> None:
        part.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(output, "_save_png", interrupt)
    with pytest.raises(KeyboardInterrupt):
        output.save_frame(tmp_path / "a.png", **frame)
    assert list(tmp_path.iterdir()) == []


def test_files_get_the_usual_rights(tmp_path: Path, frame: dict[str, Any]) -> None:
    (tmp_path / "plain").write_text("")
    output.save_frame(tmp_path / "a.png", **frame)
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("plain", "a.png")]
    assert modes[0] == modes[1]


@pytest.mark.parametrize(
    ("name", "message"),
    [("a.jpg", ".jpg is not a picture format"), ("a", "no extension"), ("no/such/a.png", "no directory")],
)
def test_check_output_refuses(tmp_path: Path, name: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        output.check_output(tmp_path / name)


def test_check_output_refuses_a_directory(tmp_path: Path) -> None:
    (tmp_path / "a.png").mkdir()
    with pytest.raises(UsageError, match="is a directory"):
        output.check_output(tmp_path / "a.png")


def test_exr_without_its_package_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(output.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match=r"pip install 'glcaustics\[exr\]'"):
        output.check_output(tmp_path / "a.exr")


def test_frame_paths() -> None:
    assert output.frame_paths("d/out.png", 1) == [Path("d/out.png")]
    assert output.frame_paths("d/out.png", 2) == [Path("d/out.0000.png"), Path("d/out.0001.png")]
    assert output.frame_paths("out_%03d.exr", 2) == [Path("out_000.exr"), Path("out_001.exr")]
    assert output.frame_paths("100%.png", 1) == [Path("100%.png")]
    with pytest.raises(UsageError, match="more than one"):
        output.frame_paths("%d_%d.png", 2)
