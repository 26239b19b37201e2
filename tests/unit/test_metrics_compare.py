"""`glcaustics compare` on every format, and its refusals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from glcaustics.cli import main
from glcaustics.output import save_frame

RANDOM = np.random.default_rng(5)
LINEAR = (0.2 + RANDOM.random((24, 32, 3))).astype(np.float32)
LDR = RANDOM.integers(30, 200, (24, 32, 3), dtype=np.uint8)


def write(path: Path, scale: float = 1.0) -> str:
    aov = {"caustic_irradiance": LINEAR * scale * 2, "depth_m": LINEAR[..., 0]}
    save_frame(path, image=LINEAR * scale, ldr=LDR, aov=aov)
    return str(path)


@pytest.mark.parametrize("suffix", [".npz", ".exr"])
@pytest.mark.parametrize("aov", [[], ["--aov", "caustic_irradiance"]])
def test_float_formats(tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str, aov: list[str]) -> None:
    a, b = write(tmp_path / f"a{suffix}"), write(tmp_path / f"b{suffix}", 1.1)
    assert main(["compare", a, b, "--json", *aov]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["bias_of_mean"] == pytest.approx(0.1, rel=1e-4)
    assert numbers["relative_rmse"] == pytest.approx(0.1 * np.sqrt((LINEAR**2).mean()) / LINEAR.mean(), rel=1e-4)
    assert numbers["relative_mae"] == pytest.approx(0.1, rel=1e-4)
    assert numbers["non_finite_test"] == 0.0
    assert 0.0 < numbers["flip_mean"] < 1.0


def test_formats_agree_and_channels_keep_their_order(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = write(tmp_path / "a.npz"), write(tmp_path / "b.exr")
    for aov in ([], ["--aov", "caustic_irradiance"], ["--aov", "depth_m"]):
        assert main(["compare", a, b, "--json", *aov]) == 0
        assert json.loads(capsys.readouterr().out)["relative_rmse"] == 0.0


def test_png_and_its_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b, target = tmp_path / "a.png", tmp_path / "b.png", tmp_path / "map.png"
    other = LDR.copy()
    other[4:8, 10:20] += 40
    Image.fromarray(LDR).save(a)
    Image.fromarray(other).save(b)
    assert main(["compare", str(a), str(b), "-o", str(target)]) == 0
    out = capsys.readouterr().out
    rows = {line.split()[0]: line.split()[1] for line in out.splitlines()}
    mse = (40 / 255) ** 2 * 40 / (24 * 32)
    assert float(rows["psnr_db"]) == pytest.approx(-10 * np.log10(mse), rel=1e-4)
    assert float(rows["flip_mean"]) > 0.0
    shown = np.asarray(Image.open(target)).astype(int).sum(axis=2)
    assert shown.shape == (24, 32)
    changed = np.zeros((24, 32), bool)
    changed[4:8, 10:20] = True
    assert shown[changed].min() > shown[~changed].max()


def test_equal_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a = write(tmp_path / "a.png")
    assert main(["compare", a, a, "--json", "-o", str(tmp_path / "m.png")]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["psnr_db"] == "inf" and numbers["flip_mean"] == 0.0 and numbers["relative_rmse"] == 0.0


def test_nan_is_counted_and_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = LINEAR.copy()
    broken[3, 4] = np.nan
    np.savez(tmp_path / "b.npz", image=broken)
    a = write(tmp_path / "a.npz")
    assert main(["compare", a, str(tmp_path / "b.npz"), "-o", str(tmp_path / "m.png")]) == 0
    out = capsys.readouterr().out
    assert "relative_rmse           0\n" in out
    assert f"{1 / (24 * 32):.6g}" in out
    assert "flip_mean               not measured" in out
    assert (np.asarray(Image.open(tmp_path / "m.png"))[3, 4] == 255).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda d: [str(d / "none.npz"), str(d / "a.npz")], "no such file"),
        (lambda d: [str(d / "a.npz"), str(d / "small.npz")], "is 8x8 with 3 channels, but"),
        (lambda d: [str(d / "a.npz"), str(d / "x.jpg")], ".jpg is not readable"),
        (lambda d: [str(d / "a.npz"), str(d / "broken.npz")], "cannot be read"),
        (lambda d: [str(d / "a.npz"), str(d / "broken.png")], "cannot be read"),
        (lambda d: [str(d / "a.npz"), str(d / "broken.exr")], "cannot be read"),
        (lambda d: [str(d / "a.npz"), str(d / "a.npz"), "--aov", "bent"], "holds no buffer 'bent'"),
        (lambda d: [str(d / "a.npz"), str(d / "two.npz")], "holds several buffers"),
        (lambda d: [str(d / "a.png"), str(d / "a.png"), "--aov", "depth_m"], "a PNG holds no buffer"),
        (lambda d: [str(d / "a.npz"), str(d / "a.npz"), "-o", str(d / "m.exr")], "the error map is a PNG"),
        (lambda d: [str(d / "a.png"), str(d / "a.png"), "-o", str(d / "a.png")], "one of the inputs"),
        (lambda d: [str(d / "a.npz"), str(d / "a.npz"), "-o", str(d / "no" / "m.png")], "no directory"),
        (lambda d: [str(d / "a.npz"), str(d / "nan.npz")], "no pixel is finite"),
    ],
)
def test_refusals_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], make, message: str) -> None:  # type: ignore[no-untyped-def]
    write(tmp_path / "a.npz")
    write(tmp_path / "a.png")
    np.savez(tmp_path / "small.npz", image=LINEAR[:8, :8])
    np.savez(tmp_path / "two.npz", one=LINEAR, two=LINEAR)
    np.savez(tmp_path / "nan.npz", image=LINEAR * np.nan)
    for name in ("broken.npz", "broken.png", "broken.exr"):
        (tmp_path / name).write_bytes(b"not what it says")
    assert main(["compare", *make(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and error.startswith("error: ")
