"""Lamps with a radius, the sun as a disc and rough surfaces: photons and Mitsuba agree within their noise."""

from __future__ import annotations

import importlib.util
import math
import os
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from glcaustics.bench.mitsuba_lights import DISC_POINTS, aimed_lights
from glcaustics.bench.mitsuba_truth import PhotonMap
from glcaustics.bench.mitsuba_variant import best_variant, mitsuba
from glcaustics.bench.targets import Target
from glcaustics.errors import UsageError
from glcaustics.scene.model import Instance, Light, LightKind, Material, Scene
from glcaustics.scene.shapes_round import icosphere
from tests.gpu.feature_scenes import GLASS, from_above, lamp, plane, scene_of, sheet, sun
from tests.gpu.photon_frames import photon_frames

MISSING = [name for name in ("mitsuba", "embreex") if importlib.util.find_spec(name) is None]
REQUIRED = bool(os.environ.get("GLC_REQUIRE_BENCH") or os.environ.get("CI"))
pytestmark = [
    pytest.mark.gpu,
    pytest.mark.skipif(bool(MISSING) and not REQUIRED, reason=f"not installed: {', '.join(MISSING)}"),
]
FloatArray = npt.NDArray[np.float64]
BINS, HALF = 24, 0.36


def ball(light: Light, material: Material) -> Scene:
    """A ball of radius 0.3 m, its centre 0.6 m above the floor."""
    place = np.eye(4)
    place[:3, 3] = 0.0, 0.6, 0.0
    return scene_of(
        [plane("floor", 3.0), Instance("ball", icosphere("ball", 0.3, 5), material, place)], [light], from_above(HALF)
    )


def compare(scene: Scene, photons: int, interfaces: int, pinhole: tuple[float, float, float], **options: Any) -> None:
    """Relative RMSE within 1.2 times the noise of both, bias of the mean under 1 %."""
    target = Target(scene.name, (0.0, 0.0, 0.0), HALF, pinhole, interfaces)
    tracer = PhotonMap(scene, target, BINS, best_variant(), rough=True)
    theirs = [tracer.render(photons, seed) for seed in (1, 2)]
    ours = [photon_frames(scene, BINS, quality="medium", seed=seed, **options)[0] for seed in range(2)]
    mean = np.mean(theirs)
    noise = math.hypot(*(float(np.sqrt((0.25 * (a - b) ** 2).mean())) for a, b in (theirs, ours)))
    error = float(np.sqrt(((np.mean(ours, axis=0) - np.mean(theirs, axis=0)) ** 2).mean()))
    bias = float(np.mean(ours) / mean - 1.0)
    print(f"{scene.name}: bias {bias:+.4f}, RMSE {error / mean:.4f}, noise of both {noise / mean:.4f}")
    assert abs(bias) < 0.01
    assert error < 1.2 * noise


UNDER = (0.0, 0.15, 0.0)  # a pinhole below the ball


def test_a_lamp_with_a_radius_over_a_glass_ball() -> None:
    light = Light(LightKind.POINT, intensity=1.0, position_ws=(0.0, 1.5, 0.0), radius_m=0.15)
    compare(ball(light, GLASS), 1 << 21, 2, UNDER, internal_bounces=0)


@pytest.mark.parametrize("roughness", [0.2])
def test_a_rough_glass_ball(roughness: float) -> None:
    compare(ball(sun(), replace(GLASS, roughness=roughness)), 1 << 19, 2, UNDER, internal_bounces=0)


def test_a_rough_metal_ball() -> None:
    """White metal: Schlick's share is 1 at every microfacet, so that the export is exact."""
    light = sun(60.0)
    metal = Material("metal", base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=0.3)
    compare(ball(light, metal), 1 << 19, 1, UNDER)


def test_the_suns_disc_keeps_its_irradiance() -> None:
    """Flat water: E = E_perp (1 - R), for a narrow disc straight above."""
    scene = scene_of([plane("floor", 1.2, -0.5), sheet("water", 1.0, 0.0)], [sun(intensity=7.0)], from_above(HALF))
    light = replace(scene.lights[0], angular_diameter_rad=math.radians(10.0))
    target = Target("flat", (0.0, -0.5, 0.0), 0.3, (0.0, -0.1, 0.0), 1)
    image = PhotonMap(replace(scene, lights=(light,)), target, 8, best_variant()).render(1 << 20, seed=1)
    assert image.mean() == pytest.approx(7.0 * (1.0 - (0.333 / 2.333) ** 2), rel=0.01)


def test_lights_as_mitsuba_has_them() -> None:
    mi = mitsuba(best_variant())
    points = np.array([[-1.0, 0, -1], [1, 0, 1]])
    round_lamp = replace(lamp((0.0, 2.0, 0.0), 3.0), radius_m=0.5)
    emitters = aimed_lights(mi, round_lamp, points, points)
    assert emitters["light"]["type"] == "sphere" and emitters["light"]["radius"] == 0.5
    assert len(aimed_lights(mi, replace(sun(), angular_diameter_rad=0.1), points, points)) == DISC_POINTS
    assert set(aimed_lights(mi, sun(), points, points)) == {"light"}
    spot = Light(LightKind.SPOT, "torch", radius_m=0.1)
    with pytest.raises(UsageError, match="spot light 'torch' has a radius"):
        aimed_lights(mi, spot, points, points)
