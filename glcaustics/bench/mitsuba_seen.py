"""What an eye sees of a caustic past water and glass, by Mitsuba in two stages."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from glcaustics.bench.mitsuba_camera import camera_sensor, look
from glcaustics.bench.mitsuba_shapes import shapes
from glcaustics.bench.mitsuba_variant import best_variant, mitsuba
from glcaustics.bench.targets import Target, luminance
from glcaustics.scene.model import Camera, Scene

FloatArray = npt.NDArray[np.float64]


def seen_radiance(
    scene: Scene,
    target: Target,
    irradiance: FloatArray,
    camera: Camera,
    size: tuple[int, int],
    *,
    albedo: float,
    spp: int,
    seed: int = 7,
) -> FloatArray:
    """Radiance (H, W) of the target's caustic as an eye sees it past water and glass: the second of two stages.

    The irradiance map becomes the emission albedo / pi E of an area light on the receiver, which Mitsuba's `path`
    follows through specular surfaces (light paths from a point or directional light through water to the eye,
    "SDS", are beyond every integrator). Everything else is black.

    Args:
        irradiance: (P, P) at the target, row 0 at -z.
    """
    mi = mitsuba(best_variant())
    light = scene.lights[0]
    parts = shapes(mi, scene, light, albedo=0.0) | {"type": "scene", "sensor": camera_sensor(mi, camera, size)}
    x, y, z = target.centre_ws
    emission = np.ascontiguousarray((irradiance * (albedo / math.pi))[..., None], np.float32)
    lift = 1e-4 * target.half_m
    # `look` along +y with up -z: the rectangle's u is +x and its v is -z; a bitmap's last row is at v = 1
    parts["caustic"] = {
        "type": "rectangle",
        "to_world": look(mi, (x, y + lift, z), (0, 1, 0), (0, 0, -1), (target.half_m, target.half_m, 1.0)),
        "bsdf": {"type": "diffuse", "reflectance": 0.0},
        "emitter": {
            "type": "area",
            "radiance": {
                "type": "bitmap",
                "bitmap": mi.Bitmap(np.ascontiguousarray(emission[::-1])),
                "raw": True,
                "filter_type": "nearest",
                "wrap_mode": "clamp",
            },
        },
    }
    integrator = mi.load_dict({"type": "path", "max_depth": 8, "rr_depth": 1000})
    image = np.array(mi.render(mi.load_dict(parts), integrator=integrator, spp=spp, seed=seed), np.float64)
    return np.asarray(image[..., 0] if image.shape[-1] == 1 else luminance(image))
