"""A .glb that is not in the repository, rendered with no option: its caustic lies where optics puts it.

A glass torus (ior 1.5) stands over a floor; one point light (KHR_lights_punctual), no camera in the file. The truth is
`torus_reference.photons`: an analytic torus, some 10^6 rays in float64, two interfaces and the outer reflection.
"""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import glcaustics as glc
from glcaustics.renderer import Frame
from tests.gpu.feature_scenes import BACKEND
from tests.gpu.torus_reference import Torus, photons
from tests.unit.glb_builder import GLASS, WHITE, build_glb, plane

pytestmark = pytest.mark.gpu
TORUS = Torus(1.0, 0.35, (0.0, 1.1, 0.0))
LAMP, INTENSITY = (0.8, 4.0, 0.5), 100.0
HALF, BINS = 1.8, 48


def torus_mesh(rings: int = 192, sides: int = 96) -> dict[str, object]:
    """Closed, with exact normals and shared vertices."""
    u, v = np.meshgrid(np.arange(rings) / rings * 2 * np.pi, np.arange(sides) / sides * 2 * np.pi, indexing="ij")
    normal = np.stack((np.cos(v) * np.cos(u), np.sin(v), -np.cos(v) * np.sin(u)), -1).reshape(-1, 3)
    ring = np.stack((np.cos(u), np.zeros_like(u), -np.sin(u)), -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")

    def at(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (a % rings) * sides + b % sides

    quad = np.stack((at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)), -1)
    positions = np.asarray(TORUS.centre) + TORUS.major_m * ring + TORUS.minor_m * normal
    return {"name": "torus", "positions": positions, "normals": normal, "indices": quad.reshape(-1, 3), "material": 0}


@pytest.fixture(scope="module")
def glb(tmp_path_factory: pytest.TempPathFactory) -> Path:
    light = {"type": "point", "intensity": INTENSITY, "name": "lamp", "translation": list(LAMP)}
    path = tmp_path_factory.mktemp("glb") / "torus.glb"
    return build_glb(path, [torus_mesh(), {**plane(4.0), "material": 1}], materials=[GLASS, WHITE], lights=[light])


@cache
def truth() -> np.ndarray:
    """Caustic irradiance (BINS, BINS), lux, over |x|, |z| <= HALF: row by z, column by x."""
    points, flux = photons(TORUS, LAMP, 1.5, 0.0, 1_000_000)
    edges = np.linspace(-HALF, HALF, BINS + 1)
    landed, _, _ = np.histogram2d(points[:, 1], points[:, 0], bins=(edges, edges), weights=flux)
    return INTENSITY * landed / (2 * HALF / BINS) ** 2


def binned(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Mean caustic irradiance of the pixels in each bin of the floor, and how many there are."""
    position = frame.aov["position_ws"].astype(np.float64).reshape(-1, 3)
    value = frame.aov["caustic_irradiance"][..., 1].astype(np.float64).ravel()
    floor = (np.abs(position[:, 1]) < 1e-3) & (frame.aov["depth_m"].ravel() > 0)
    edges = np.linspace(-HALF, HALF, BINS + 1)
    at = (position[floor][:, 2], position[floor][:, 0])
    count, _, _ = np.histogram2d(*at, bins=(edges, edges))
    total, _, _ = np.histogram2d(*at, bins=(edges, edges), weights=value[floor])
    return total / np.maximum(count, 1), count


def test_the_caustic_lies_where_optics_puts_it(glb: Path) -> None:
    """No option but the AOVs; without the torus in the eye's way, so that the whole floor is seen."""
    scene = glc.load_scene(glb)
    assert any("camera" in line for line in scene.announcements)
    with glc.Renderer(
        scene, (640, 480), backend=BACKEND, specular_view=False, aovs=("caustic_irradiance", "position_ws", "depth_m")
    ) as renderer:
        frame = renderer.render(time=0.0)
    assert frame.stats["method"] == "displaced_mesh" and frame.stats["quality"] == "medium"
    image, count = binned(frame)
    reference = truth()
    seen = count >= 2
    error = np.sqrt(((image - reference)[seen] ** 2).mean()) / reference[seen].mean()
    energy = image[seen].sum() / reference[seen].sum()
    centre = (np.arange(BINS) + 0.5) / BINS * 2 * HALF - HALF
    x, z = np.meshgrid(centre, centre)
    shift = [
        float((image * c)[seen].sum() / image[seen].sum() - (reference * c)[seen].sum() / reference[seen].sum())
        for c in (x, z)
    ]
    correlation = float(np.corrcoef(image[seen], reference[seen])[0, 1])
    print(
        f"torus: {seen.mean():.3f} of the bins seen, relative RMSE {error:.3f}, correlation {correlation:.4f}, "
        f"energy {energy:.4f}, centroid off by {shift[0]:+.4f}, {shift[1]:+.4f} m, solves {frame.stats['solves']}"
    )
    assert seen.mean() > 0.8
    assert correlation > 0.999
    assert error < 0.04
    assert energy == pytest.approx(1.0, abs=0.01)
    assert np.hypot(*shift) < 0.003


@pytest.mark.smoke
def test_the_command_writes_the_picture_with_no_option(glb: Path, tmp_path: Path) -> None:
    argv = [sys.executable, "-m", "glcaustics", "render", str(glb), "-o", "torus.npz", "--backend", BACKEND]
    argv += ["--size", "160x120"]
    done = subprocess.run(argv, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "torus.npz") as arrays:
        image = arrays["image"]
    assert image.shape == (120, 160, 3) and np.isfinite(image).all() and image.max() > 4.0 * np.median(image) > 0.0
