"""The displaced mesh where light lands all around a lamp: a cube of six faces over the receivers, and over the casters.

Truths: closed form of flat water on both sides of the lamp; float64 beams for a mirror ball that hangs above it.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

import glcaustics as glc
from glcaustics.bench.scene_export import beam_scene
from glcaustics.optics.closed_form import flat_point_irradiance
from glcaustics.optics.receivers import PlaneGrid
from glcaustics.optics.reference import BeamSettings, reference_map
from glcaustics.renderer import Frame
from glcaustics.scene.model import Camera, Instance, Scene
from glcaustics.scene.shapes_round import sphere
from tests.gpu.feature_scenes import (
    BACKEND,
    MIRROR,
    box,
    lamp,
    plane,
    relative_rmse,
    scene_of,
    sheet,
    translation,
)

pytestmark = pytest.mark.gpu

FloatArray = npt.NDArray[np.float64]
METHOD = "displaced_mesh"
INTENSITY, HEIGHT, DEPTH = 10.0, 0.5, 0.5
PIXELS, HALF = 192, 1.4


def render(scene: Scene, method: str, **options: bool) -> tuple[Frame, list[int]]:
    """A frame without the eye's refraction, and the faces of the receivers' views after the fit."""
    aovs = ("caustic_irradiance", "position_ws")
    with glc.Renderer(
        scene, (PIXELS, PIXELS), method, "medium", BACKEND, aovs=aovs, specular_view=False, options=options
    ) as renderer:
        frame = renderer.render()
        faces = [r.view.faces for r in renderer._setup.lights[0].receivers.values()]
    assert np.isfinite(frame.aov["caustic_irradiance"]).all()
    return frame, faces


def two_waters() -> Scene:
    """A lamp between a water below and its mirror image above; floor at -0.5, ceiling at 1.5."""
    above = sheet("water above", 2.0, 0.0)
    turned = np.diag([1.0, -1.0, -1.0, 1.0])
    turned[1, 3] = 2.0 * HEIGHT
    above = Instance("water above", above.mesh, above.material, turned)
    parts = [
        plane("floor", 4.0, -DEPTH),
        plane("ceiling", 4.0, 2.0 * HEIGHT + DEPTH, up=False),
        sheet("water", 2.0, 0.0),
        above,
    ]
    eye = Camera.look_at((0.0, 1.45, 0.0), (0.0, 0.0, 0.0), (0, 0, -1), yfov_rad=math.radians(80.0))
    return scene_of(parts, [lamp((0.0, HEIGHT, 0.0), INTENSITY)], eye)


def ball_over_a_lamp() -> Scene:
    """A mirror ball over a lamp in a room: its light goes down, and aside on all walls."""
    ball = Instance("ball", sphere("ball", 0.4, 96), MIRROR, translation(0.1, 1.4, 0.05))
    walls = [
        box(f"wall {i}", size, at)
        for i, (size, at) in enumerate(
            (
                ((0.1, 4.0, 4.2), (2.05, 2.0, 0.0)),
                ((0.1, 4.0, 4.2), (-2.05, 2.0, 0.0)),
                ((4.0, 4.0, 0.1), (0.0, 2.0, 2.05)),
                ((4.0, 4.0, 0.1), (0.0, 2.0, -2.05)),
            )
        )
    ]
    eye = Camera.look_at((0.0, 0.7, 0.0), (0.0, 0.0, 0.0), (0, 0, -1), orthographic=True, ymag_m=HALF)
    return scene_of([plane("floor", 2.0), ball, *walls], [lamp((0.0, 0.8, 0.0), INTENSITY)], eye)


def parts_of(side: FloatArray, border: float) -> dict[str, npt.NDArray[np.bool_]]:
    """Masks of the face below the lamp, of its borders, and of what the faces beside it see; `side`: max(|x|, |z|)."""
    return {"inside": side < 0.9 * border, "seam": np.abs(side - border) < 0.05, "outside": side > 1.1 * border}


def test_flat_water_around_a_lamp_is_the_closed_form_without_seams() -> None:
    frame, faces = render(two_waters(), METHOD, reflect=False)
    assert faces and set(faces) == {6}
    position = frame.aov["position_ws"].astype(np.float64)
    radius = np.hypot(position[..., 0], position[..., 2])
    truth = flat_point_irradiance(radius, height_m=HEIGHT, depth_m=DEPTH, ior=1.333, intensity=INTENSITY)
    ratio = frame.aov["caustic_irradiance"][..., 1] / truth
    side = np.maximum(np.abs(position[..., 0]), np.abs(position[..., 2]))
    for name, part in parts_of(side, HEIGHT + DEPTH).items():
        values = ratio[part & (radius < 1.6)]
        worst = float(np.percentile(np.abs(values - 1.0), 99))
        print(f"\n{name}: E / E_ref mean {values.mean():.4f}, 99th percentile of the error {worst:.4f}")
        assert values.size > 300
        assert values.mean() == pytest.approx(1.0, abs=0.01)
        assert worst < 0.02


@cache
def beams_of_the_ball() -> FloatArray:
    """(96, 96) W/m^2."""
    grid = PlaneGrid.floor(HALF, 0.0, PIXELS // 2)
    found = reference_map(beam_scene(ball_over_a_lamp()), grid, BeamSettings(cells=512, max_events=1), check_step=False)
    return found.mean[..., 1]


@pytest.mark.parametrize("method", [METHOD, "caustic_map"])
def test_a_ball_over_a_lamp_against_beams(method: str) -> None:
    """Both methods: energy to 0.5 %, no seam where the faces meet, and the same picture as the beams."""
    frame, faces = render(ball_over_a_lamp(), method)
    assert faces and set(faces) == {6}
    image = frame.aov["caustic_irradiance"][..., 1].astype(np.float64)
    image = image.reshape(PIXELS // 2, 2, PIXELS // 2, 2).mean(axis=(1, 3))
    truth = beams_of_the_ball()
    x, z = np.meshgrid(*[(np.arange(PIXELS // 2) + 0.5) / (PIXELS // 2) * 2.0 * HALF - HALF] * 2)
    for name, part in parts_of(np.maximum(np.abs(x), np.abs(z)), 0.8).items():
        rmse = relative_rmse(image[part], truth[part])
        print(f"\n{method} {name}: relative RMSE {rmse:.4f}, flux {image[part].sum() / truth[part].sum():.4f}")
        assert rmse < 0.02
        assert image[part].sum() == pytest.approx(truth[part].sum(), rel=0.005)
