"""The command from end to end on the backend of GLC_TEST_BACKEND, each call in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.gpu.feature_scenes import BACKEND

pytestmark = [pytest.mark.gpu, pytest.mark.smoke]


def glcaustics(*argv: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "glcaustics", *argv], cwd=cwd, capture_output=True, text=True, check=False
    )


def render(cwd: Path, scene: str, *argv: str) -> dict[str, Any]:
    """Renders a small draft and returns the JSON document."""
    size = ["--size", "64x48", "--quality", "draft", "--backend", BACKEND, "--json", "-"]
    done = glcaustics("render", scene, *size, *argv, cwd=cwd)
    assert done.returncode == 0, done.stderr
    document: dict[str, Any] = json.loads(done.stdout)
    return document


def test_glass_sphere_to_arrays(tmp_path: Path) -> None:
    document = render(tmp_path, "glass-sphere", "-o", "x.npz", "--aov", "caustic_irradiance", "depth_m")
    with np.load(tmp_path / "x.npz") as arrays:
        assert set(arrays) == {"image", "caustic_irradiance", "depth_m"}
        assert arrays["image"].shape == (48, 64, 3)
        assert all(np.isfinite(arrays[name]).all() for name in ("image", "caustic_irradiance"))
        assert arrays["caustic_irradiance"].max() > 0.0
    assert document["frames"][0]["stats"]["backend"] == BACKEND


def test_one_seed_gives_one_picture(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        render(tmp_path, "glass-sphere", "-o", name, "--seed", "3")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_sequence_moves(tmp_path: Path) -> None:
    document = render(tmp_path, "pool", "-o", "w.png", "--frames", "2", "--fps", "2")
    assert [record["file"] for record in document["frames"]] == ["w.0000.png", "w.0001.png"]
    assert (tmp_path / "w.0000.png").read_bytes() != (tmp_path / "w.0001.png").read_bytes()


def test_doctor_finds_the_backend(tmp_path: Path) -> None:
    done = glcaustics("doctor", "--backend", BACKEND, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    found = json.loads(done.stdout)["backends"][BACKEND]
    assert found["works"] and found["info"]["version_code"] >= 330
