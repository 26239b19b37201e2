"""Arbitrary output variables: which there are, which resources they take, and how they are read back."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from glcaustics.caustics.method import IRRADIANCE
from glcaustics.errors import UsageError
from glcaustics.passes.camera import CameraState
from glcaustics.passes.runner import PlanRunner
from glcaustics.renderer.readback import read_floats

Float32Array = npt.NDArray[np.float32]

AOVS: dict[str, str] = {
    "image": "linear radiance of the picture, cd/m^2 or W/(m^2 sr)",
    "caustic_irradiance": "E_c at the first non-specular surface on the eye's path, lux or W/m^2",
    "direct_irradiance": "irradiance by direct light at the opaque layer, lux or W/m^2",
    "depth_m": "distance along the view axis of the first surface, metres; 0 where there is none",
    "normal_ws": "normal of the first surface, towards the eye, world space",
    "position_ws": "position of the first surface, metres, world space",
    "albedo": "base colour of the opaque layer, linear",
    "solve_status": "eye ray, behind the last specular surface followed: 0 opaque, 1 solved by Newton's method, 2 sky, "
    "3 fallback by estimate (Sousa 2005), 4 total internal reflection, 5 solved by marching, 6 leaves the picture, "
    "7 hidden behind something, 8 solved in the second depth layer",
    "solve_hit": "where the eye ray was solved: uv (origin at the bottom left), and the solver's error in pixels",
    "solve_iterations": "texel look-ups of the eye ray's solver",
}


def aov_resources(aovs: Iterable[str], *, specular: bool, caustics: bool) -> list[str]:
    """Graph resources that AOVs are read from. `specular`: the eye sees specular surfaces; `caustics`: there are any.

    Raises:
        UsageError: unknown AOV.
    """
    seen_depth = ["specular.depth_m"] if specular else []
    irradiance = "view.caustic_irradiance" if specular else IRRADIANCE
    resources = {
        "image": [],
        "caustic_irradiance": [irradiance] if caustics else [],
        "direct_irradiance": ["lighting.irradiance"],
        "depth_m": ["gbuffer.depth_m", *seen_depth],
        "normal_ws": ["gbuffer.normal_ws", *seen_depth, *(["specular.normal_ws"] if specular else [])],
        "position_ws": ["gbuffer.depth_m", *seen_depth],
        "albedo": ["gbuffer.albedo"],
        "solve_status": ["view.solve_status"] if specular else [],
        "solve_hit": ["view.solve"] if specular else [],
        "solve_iterations": ["view.solve"] if specular else [],
    }
    for name in aovs:
        if name not in resources:
            raise UsageError(f"AOV '{name}' is unknown", where="--aov", remedy=f"there are: {', '.join(AOVS)}")
    return [resource for name in aovs for resource in resources[name]]


class AovReader:
    """Reads AOVs of the frame that `runner` drew last.

    Args:
        camera: that the frame was drawn with. specular: whether it sees specular surfaces.
        image: (H, W, 3), the picture's radiance, which was read already.
    """

    def __init__(self, runner: PlanRunner, camera: CameraState, image: Float32Array, *, specular: bool) -> None:
        self._runner = runner
        self._camera = camera
        self._image = image
        self._specular = specular

    def read(self, name: str) -> Float32Array:
        """One of `AOVS`: (H, W) or (H, W, 3) float32, row 0 on top; zeros where the frame has nothing of the kind."""
        match name:
            case "image":
                return self._image
            case "caustic_irradiance":
                return self._if_there("view.caustic_irradiance" if self._specular else IRRADIANCE, 3)
            case "direct_irradiance":
                return self._floats("lighting.irradiance", 3)
            case "albedo":
                return self._floats("gbuffer.albedo", 3)
            case "solve_status":
                return self._if_there("view.solve_status", 1)
            case "solve_hit":
                return self._if_there("view.solve", 4)[..., :3]
            case "solve_iterations":
                return self._if_there("view.solve", 4)[..., 3]
            case "normal_ws":
                return self._first("normal_ws", 3)
            case "depth_m":
                return self._first("depth_m", 1)
            case "position_ws":
                return positions_ws(self._first("depth_m", 1), self._camera)
        raise UsageError(f"AOV '{name}' is unknown", where="--aov", remedy=f"there are: {', '.join(AOVS)}")

    def _floats(self, resource: str, components: int) -> Float32Array:
        return read_floats(self._runner, resource, components)

    def _if_there(self, resource: str, components: int) -> Float32Array:
        """Zeros where nothing in the scene is specular, or no method brings caustics."""
        if resource in self._runner.plan.slots:
            return self._floats(resource, components)
        height, width = self._image.shape[:2]
        return np.zeros((height, width) if components == 1 else (height, width, components), np.float32)

    def _first(self, name: str, components: int) -> Float32Array:
        """Of the first surface: the specular one where there is one (it lies in front), else the opaque one."""
        opaque = self._floats(f"gbuffer.{name}", components)
        if not self._specular:
            return opaque
        is_specular = self._floats("specular.depth_m", 1) > 0
        return np.where(
            is_specular if components == 1 else is_specular[..., None],
            self._floats(f"specular.{name}", components),
            opaque,
        )


def positions_ws(depth_m: Float32Array, camera: CameraState) -> Float32Array:
    """(H, W, 3), metres: where a camera sees surfaces, from their depths (H, W) along its axis; 0 where depth is 0."""
    height, width = depth_m.shape
    depth = depth_m.astype(np.float64)
    x = (((np.arange(width) + 0.5) / width - camera.jitter_uv[0]) * 2 - 1) * camera.lens[0]
    y = (1 - ((np.arange(height) + 0.5) / height + camera.jitter_uv[1]) * 2) * camera.lens[1]
    scale = np.ones_like(depth) if camera.orthographic else depth
    view = np.stack([x[None, :] * scale, y[:, None] * scale, -depth], axis=2)
    m = camera.world_from_camera
    world = view @ m[:3, :3].T + m[:3, 3]
    return np.where(depth_m[..., None] > 0, world, 0.0).astype(np.float32)
