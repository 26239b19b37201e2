"""Where a Mitsuba 3 object stands, and the camera with its film."""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.mitsuba_variant import is_mono
from glcaustics.scene.model import Camera


def look(
    mi: ModuleType, eye: npt.ArrayLike, towards: npt.ArrayLike, up: npt.ArrayLike, scale: npt.ArrayLike = (1, 1, 1)
) -> Any:
    """Mitsuba's transform: +Z of the object along `towards`."""
    origin = np.asarray(eye, np.float64)
    transform = mi.ScalarTransform4f().look_at(
        origin=origin.tolist(), target=(origin + np.asarray(towards)).tolist(), up=np.asarray(up).tolist()
    )
    return transform.scale(np.asarray(scale, np.float64).tolist())


def camera_sensor(mi: ModuleType, camera: Camera, size: tuple[int, int]) -> dict[str, Any]:
    """A scene's camera, perspective or orthographic, with the film of a picture of `size` (width, height)."""
    m = camera.world_from_camera
    place = look(mi, m[:3, 3], -m[:3, 2], m[:3, 1])
    if camera.orthographic:
        aspect = size[0] / size[1]
        lens = {"type": "orthographic", "to_world": place.scale([camera.ymag_m * aspect] * 2 + [1.0])}
    else:
        lens = {"type": "perspective", "fov": math.degrees(camera.yfov_rad), "fov_axis": "y", "to_world": place}
    return lens | {"film": film(mi, size), "sampler": {"type": "independent"}}


def film(mi: ModuleType, size: tuple[int, int]) -> dict[str, Any]:
    """A float32 film with a box filter."""
    return {
        "type": "hdrfilm",
        "width": int(size[0]),
        "height": int(size[1]),
        "rfilter": {"type": "box"},
        "pixel_format": "luminance" if is_mono(mi) else "rgb",
        "component_format": "float32",
    }
