"""Irradiance by photons, seen straight from above, as the arrays that closed forms and other renderers are held to."""

from __future__ import annotations

from typing import Any

import numpy as np

import glcaustics as glc
from glcaustics.scene.model import Scene
from tests.gpu.feature_scenes import BACKEND, FloatArray


def photon_frames(
    scene: Scene, bins: int, frames: int = 4, *, quality: str = "low", seed: int = 0, **options: Any
) -> tuple[FloatArray, glc.Frame]:
    """Mean irradiance (bins, bins) of the green channel over unfiltered frames of 2 bins^2 pixels, and the last one."""
    with glc.Renderer(
        scene,
        size=(2 * bins, 2 * bins),
        method="photon_trace",
        quality=quality,
        backend=BACKEND,
        aovs=("caustic_irradiance",),
        specular_view=False,
        seed=seed,
        options={"photons": 250_000, "denoise": False, **options},
    ) as renderer:
        drawn = [renderer.render() for _ in range(frames)]
    image = np.mean([f.aov["caustic_irradiance"][..., 1].astype(np.float64) for f in drawn], axis=0)
    return image.reshape(bins, 2, bins, 2).mean(axis=(1, 3)), drawn[-1]
