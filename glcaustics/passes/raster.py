"""The camera's raster space: what the eye rays' solvers work in; uniforms of `interface/raster.glsl`."""

from __future__ import annotations

from typing import Any

import numpy as np

from glcaustics.passes.camera import CameraState
from glcaustics.scene.model import FloatArray


def raster_from_world(camera: CameraState, size: tuple[int, int]) -> FloatArray:
    """(4, 4) column-vector form: world (x, y, z, 1) to X, Y, S, W with pixel = XY / W, s = S / W.

    Perspective: W = depth along the view axis (metres) and S = 1, so s = 1 / depth; orthographic: W = 1, S = -depth.
    """
    rows = camera.camera_from_world
    depth, one = -rows[2], np.array([0.0, 0.0, 0.0, 1.0])
    w, s = (one, -depth) if camera.orthographic else (depth, one)
    x = size[0] * (0.5 / camera.lens[0] * rows[0] + (0.5 + camera.jitter_uv[0]) * w)
    y = size[1] * (0.5 / camera.lens[1] * rows[1] + (0.5 + camera.jitter_uv[1]) * w)
    return np.stack([x, y, s, w])


def raster_uniforms(camera: CameraState, size: tuple[int, int]) -> dict[str, Any]:
    """Uniforms of `interface/raster.glsl`."""
    return {
        "u_raster_from_world": raster_from_world(camera, size),
        "u_raster_size": (float(size[0]), float(size[1])),
    }
