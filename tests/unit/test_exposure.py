"""The exposure that a scene without one of its own gets."""

from __future__ import annotations

import math

import numpy as np
import pytest

from glcaustics.renderer.sequence import exposure_of
from glcaustics.scene.model import Camera, Instance, Light, LightKind, Material, Scene, Sky
from tests.unit.test_scene_scaled import TRIANGLE

BOX_WS = np.array([[-1.0, 0.0, -1.0], [1.0, 0.0, 1.0]])
GLASS = Instance("glass", TRIANGLE, Material("glass", transmission=1.0))
TABLE = Instance("table", TRIANGLE, Material("table"))


def scene_of(*instances: Instance, zenith: float = 0.0) -> Scene:
    sun = Light(LightKind.DIRECTIONAL, intensity=1000.0)
    return Scene("s", instances, (sun,), Camera.look_at((0, 1, 1), (0, 0, 0)), sky=Sky(zenith=(zenith,) * 3))


def test_white_in_full_light_decides() -> None:
    white = (1000.0 + 10.0 * math.pi) / math.pi  # radiance
    assert exposure_of(scene_of(GLASS, TABLE, zenith=10.0), BOX_WS) == pytest.approx(1.3 / white)


def test_glass_alone_is_exposed_for_the_sky() -> None:
    assert exposure_of(scene_of(GLASS, zenith=10.0), BOX_WS) == pytest.approx(1.3 / 10.0)


def test_glass_alone_before_a_black_sky_keeps_the_lights() -> None:
    assert exposure_of(scene_of(GLASS), BOX_WS) == pytest.approx(1.3 * math.pi / 1000.0)
