"""EGL and OSMesa give the same picture. Each in its own process: one process cannot hold both Mesa front ends."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import glcaustics as glc
from tests.golden import picture_diff

pytestmark = [pytest.mark.gpu, pytest.mark.golden]

MAX_STEPS = 1  # of 255: both are the same rasteriser, so that nothing but the last rounding may differ


def render(scene: str, backend: str, folder: Path) -> picture_diff.Picture:
    path = folder / f"{backend}.png"
    command = [sys.executable, "-m", "glcaustics", "render", scene, "-o", str(path), "--size", "256x192"]
    software = os.environ | {"LIBGL_ALWAYS_SOFTWARE": "1"}  # OSMesa has no GPU; EGL must not use one either
    command += ["--backend", backend]
    done = subprocess.run(command, env=software, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return picture_diff.load(path)


@pytest.mark.parametrize("scene", [name for name, _, _ in glc.builtin_scenes()])
def test_osmesa_gives_the_picture_of_egl(scene: str, tmp_path: Path) -> None:
    found = picture_diff.difference(render(scene, "osmesa", tmp_path), render(scene, "egl", tmp_path))
    assert found.maximum <= MAX_STEPS, str(found)
