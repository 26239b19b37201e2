"""Lights as Mitsuba 3 emitters, aimed at the casters, so that no photon is wasted on what is not asked for.

A lamp with a radius is exact, a glowing sphere, and shines everywhere; the sun's disc is a sum of directional lights on
the whole scene.
"""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

import numpy as np

from glcaustics.bench.mitsuba_camera import look
from glcaustics.bench.mitsuba_variant import spectrum
from glcaustics.bench.scene_export import beam_light
from glcaustics.errors import UsageError
from glcaustics.optics.beam_spread import disc_parts
from glcaustics.passes.view_math import unit
from glcaustics.scene.model import FloatArray, Light, LightKind

AIM_MARGIN = 1.02
DISC_POINTS = 128  # collimated lights that stand for a disc in the sky


def aimed_lights(mi: ModuleType, light: Light, aim_at_ws: FloatArray, scene_ws: FloatArray) -> dict[str, Any]:
    """The emitters of one light, with its size, by unique names; see `aimed_light`.

    Raises:
        UsageError: a spot light with a radius, which Mitsuba does not have.
    """
    if not light.has_size:
        return {"light": aimed_light(mi, light, aim_at_ws, scene_ws)}
    if light.kind is LightKind.SPOT:
        raise UsageError(
            f"spot light '{light.name}' has a radius", where="Mitsuba", remedy="set it to 0 or make it a point light"
        )
    power = light.intensity * np.asarray(light.color, np.float64)
    if light.kind is LightKind.DIRECTIONAL:
        return {  # not rectangles as for one direction: they would stand in one another's light
            f"light{k}": {
                "type": "directional",
                "direction": [float(x) for x in part.direction_ws],
                "irradiance": spectrum(mi, part.intensity_rgb),
            }
            for k, part in enumerate(disc_parts(beam_light(light, DISC_POINTS), seed=0))
        }
    sphere = {
        "type": "sphere",
        "center": [float(x) for x in light.position_ws],
        "radius": float(light.radius_m),
        "bsdf": {"type": "diffuse", "reflectance": 0.0},
        "emitter": {"type": "area", "radiance": spectrum(mi, power / (math.pi * light.radius_m**2))},
    }
    return {"light": sphere}


def aimed_light(mi: ModuleType, light: Light, aim_at_ws: FloatArray, scene_ws: FloatArray) -> dict[str, Any]:
    """A light of the same units, without its size, that shines on the points `aim_at_ws` (P, 3) and little elsewhere.

    A directional light becomes a rectangle outside the scene (`scene_ws`, (Q, 3)) that emits along its normal alone.
    """
    power = light.intensity * np.asarray(light.color, np.float64)
    if light.kind is LightKind.DIRECTIONAL:
        return _collimated(mi, unit(light.direction_ws), power, aim_at_ws, scene_ws)
    if light.kind is LightKind.SPOT:
        return _gltf_spot(mi, light, power)
    position = np.asarray(light.position_ws, np.float64)
    rays = aim_at_ws - position
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    axis = unit(rays.mean(axis=0))
    cutoff = math.degrees(math.acos(float(np.clip((rays @ axis).min(), -1.0, 1.0)))) * AIM_MARGIN
    if cutoff > 80.0:
        return {"type": "point", "position": position.tolist(), "intensity": spectrum(mi, power)}
    wide = cutoff * 1.001  # flat over the beam width; the ramp beyond it shines past the casters
    spot = {"type": "spot", "cutoff_angle": wide, "beam_width": cutoff, "intensity": spectrum(mi, power)}
    return spot | {"to_world": look(mi, position, axis, frame_around(axis)[0])}


def _collimated(
    mi: ModuleType, d: FloatArray, power: FloatArray, aim_at: FloatArray, scene: FloatArray
) -> dict[str, Any]:
    u, v = frame_around(d)
    low = np.array([(aim_at @ u).min(), (aim_at @ v).min()])
    high = np.array([(aim_at @ u).max(), (aim_at @ v).max()])
    half, centre = 0.5 * (high - low) * AIM_MARGIN, 0.5 * (high + low)
    depth = scene @ d
    start = depth.min() - 0.01 * (np.ptp(depth) + 1e-9)
    origin = centre[0] * u + centre[1] * v + start * d
    # look_at's x axis is up x direction = v x d = u
    return {
        "type": "rectangle",
        "to_world": look(mi, origin, d, v, (half[0], half[1], 1.0)),
        "bsdf": {"type": "diffuse", "reflectance": 0.0},
        "emitter": {"type": "directionalarea", "radiance": spectrum(mi, power)},
    }


def _gltf_spot(mi: ModuleType, light: Light, power: FloatArray, texels: int = 512) -> dict[str, Any]:
    """Mitsuba's spot with a projected picture of glTF's fall-off (KHR_lights_punctual)."""
    outer, inner = light.outer_cone_rad, min(light.inner_cone_rad, light.outer_cone_rad - 1e-3)
    axis = (np.arange(texels) + 0.5) / texels * 2.0 - 1.0
    r = np.hypot(axis[None, :], axis[:, None]) * math.tan(outer)
    scale = 1.0 / max(1e-3, math.cos(inner) - math.cos(outer))
    falloff = np.clip(np.cos(np.arctan(r)) * scale - math.cos(outer) * scale, 0.0, 1.0) ** 2
    bitmap = mi.Bitmap(np.ascontiguousarray(falloff[..., None], np.float32))
    d = unit(light.direction_ws)
    cutoff = math.degrees(outer)
    return {
        "type": "spot",
        "cutoff_angle": cutoff,
        "beam_width": 0.9999 * cutoff,
        "intensity": spectrum(mi, power),
        "texture": {"type": "bitmap", "bitmap": bitmap, "raw": True},
        "to_world": look(mi, light.position_ws, d, frame_around(d)[0]),
    }


def frame_around(direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors at right angles to a unit vector and to each other."""
    u = unit(np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))]))
    return u, np.cross(direction, u)
