"""The camera's matrices, with clip planes fitted to what it sees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from glcaustics.passes.view_math import orthographic, perspective, unit
from glcaustics.scene.model import Camera, FloatArray


@dataclass(eq=False)
class CameraState:
    """Matrices of one camera at one time, (4, 4) float64 in column-vector form.

    `lens`: tangents of the half angles, or half extents in metres (orthographic), along x and y; 1 if orthographic; 0.
    `jitter_uv`: shift of the picture as a part of its size.
    """

    world_from_camera: FloatArray
    camera_from_world: FloatArray
    clip_from_world: FloatArray
    lens: tuple[float, float, float, float]
    orthographic: bool
    jitter_uv: tuple[float, float] = (0.0, 0.0)

    @staticmethod
    def make(
        camera: Camera,
        size: tuple[int, int],
        bounds_ws: FloatArray,
        jitter_px: tuple[float, float] = (0.0, 0.0),
        boxes_ws: FloatArray | None = None,
    ) -> CameraState:
        """Clip planes fitted to the scene's box, so that depth is well conditioned at any scale.

        Args:
            boxes_ws: (N, 2, 3), a box an object: the near plane stands before the nearest, however large the scene is.
            jitter_px: shift of the picture by a part of a pixel, for anti-aliasing over several samples.
        """
        world_from_camera = np.asarray(camera.world_from_camera, np.float64)
        camera_from_world = np.linalg.inv(world_from_camera)
        half_height = camera.ymag_m if camera.orthographic else float(np.tan(0.5 * camera.yfov_rad))
        lens = (half_height * (size[0] / size[1]), half_height)
        nearest, farthest, extent = _depths_m(camera_from_world, bounds_ws)
        far = max(farthest, 1e-3 * extent) * 1.001 + 1e-3 * extent
        if camera.orthographic:
            near = nearest - 1e-3 * extent
            projection = orthographic(-lens[0], lens[0], -lens[1], lens[1], near, far)
        else:
            boxes = bounds_ws[None] if boxes_ws is None or len(boxes_ws) == 0 else boxes_ws
            near = max(nearest * 0.999, min(_near_m(world_from_camera, lens, boxes), 0.5 * far), 1e-7 * far)
            projection = perspective(-lens[0], lens[0], -lens[1], lens[1], near, far)
        jitter_uv = (jitter_px[0] / size[0], jitter_px[1] / size[1])
        shift = np.eye(4)
        shift[0, 3], shift[1, 3] = 2.0 * jitter_uv[0], 2.0 * jitter_uv[1]
        return CameraState(
            world_from_camera,
            camera_from_world,
            shift @ projection @ camera_from_world,
            (*lens, 1.0 if camera.orthographic else 0.0, 0.0),
            camera.orthographic,
            jitter_uv,
        )

    def uniforms(self) -> dict[str, Any]:
        """Uniforms of `interface/camera.glsl`."""
        forward = -unit(self.world_from_camera[:3, 2])
        return {
            "u_world_from_camera": self.world_from_camera,
            "u_camera_lens": self.lens,
            "u_camera_jitter": self.jitter_uv,
            "u_camera_from_world": self.camera_from_world,
            "u_eye_ws": tuple(self.world_from_camera[:3, 3]),
            "u_eye_direction": (*forward, 1.0 if self.orthographic else 0.0),
        }


def _depths_m(camera_from_world: FloatArray, bounds_ws: FloatArray) -> tuple[float, float, float]:
    """Least and greatest depth of a box (2, 3) along the camera's axis, and the box's diagonal; metres."""
    corners = np.array(
        [[bounds_ws[i, 0], bounds_ws[j, 1], bounds_ws[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    depth = -(corners @ camera_from_world[2, :3] + camera_from_world[2, 3])
    return float(depth.min()), float(depth.max()), float(np.linalg.norm(bounds_ws[1] - bounds_ws[0]))


def _near_m(world_from_camera: FloatArray, lens: tuple[float, float], boxes_ws: FloatArray) -> float:
    """How far off the near plane may stand, metres: before the nearest box (N, 2, 3) that reaches in front of the eye.

    The scene's size alone would push the plane past everything that stands on a huge ground. Inside of a box its own
    size decides.
    """
    eye, forward = world_from_camera[:3, 3], -world_from_camera[:3, 2]
    low, high = boxes_ws[:, 0], boxes_ws[:, 1]
    reach = np.where(forward > 0.0, high, low) @ forward - eye @ forward
    start = np.where(forward > 0.0, low, high) @ forward - eye @ forward
    away = np.linalg.norm(np.maximum(np.maximum(low - eye, eye - high), 0.0), axis=1)
    corner = 1.0 / np.sqrt(1.0 + lens[0] ** 2 + lens[1] ** 2)  # cosine of the ray farthest off the axis
    inside = 5e-4 * np.linalg.norm(high - low, axis=1)
    near = np.maximum(0.999 * np.maximum(start, away * corner), np.where(away > 0.0, 0.0, inside))
    near = np.where(reach > 0.0, near, np.inf)
    diagonals = np.linalg.norm(high - low, axis=1)
    touching = 2e-4 * float(np.quantile(diagonals, 0.25, method="lower"))  # the eye on a surface
    return max(float(near.min()), touching)
