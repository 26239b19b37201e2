"""Sensible lights, camera and sky for a scene that has none; each one is announced."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glcaustics.scene.model import Camera, FloatArray, Instance, Light, LightKind, OpticalKind, Sky

SUN_ILLUMINANCE_LUX = 100_000.0  # clear sky at noon
SUN_DIRECTION = (-0.4, -1.0, -0.3)
SKY_SHARE = 0.02  # of the lights' illuminance: enough to see into shadows, too little to wash out caustics
YFOV_RAD = math.radians(40.0)
# A thing so many times as large as the specular things, or as the median thing, is scenery and not the subject.
SCENERY_BESIDE_SPECULAR, SCENERY_BESIDE_MEDIAN = 1.5, 3.0
BLOCKER_TRIANGLES = 200_000  # of all walls looked at when the camera seeks a free view; then every n-th
# Where the camera looks from, degrees (azimuth from +Z towards +X, elevation); the first with a free view is taken.
VIEWPOINTS = ((20, 35), (-20, 35), (20, 20), (-20, 20), (65, 35), (-65, 35), (0, 60), (160, 35), (-160, 35), (0, 8))


@dataclass(frozen=True, eq=False)
class Defaults:
    """Lights, camera and sky of a scene, its own where it has them; one announcement for each that was supplied."""

    lights: tuple[Light, ...]
    camera: Camera
    sky: Sky
    announcements: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Sphere:
    """`center_ws` (3,), `radius_m`: a bounding sphere."""

    center_ws: FloatArray
    radius_m: float


def complete(
    instances: Sequence[Instance], lights: Sequence[Light], camera: Camera | None, sky: Sky | None
) -> Defaults:
    """Supply what is missing.

    Args:
        instances: at least one. lights: empty = none. camera, sky: None = none.
    """
    notes = []
    if not lights:
        lights = (default_sun(),)
        notes.append(f"the scene has no light; a sun of {SUN_ILLUMINANCE_LUX:g} lux along {SUN_DIRECTION} is added")
    subject = subject_sphere(instances)
    if camera is None:
        camera = default_camera(instances, lights)
        eye = ", ".join(f"{x:.3g}" for x in camera.position_ws)
        notes.append(f"the scene has no camera; one is placed at ({eye}) to frame it")
    if sky is None:
        sky = default_sky(lights, subject)
        notes.append(f"the scene has no sky; a soft daylight of {sky.horizon[1]:.3g} cd/m^2 at the horizon is added")
    return Defaults(tuple(lights), camera, sky, tuple(notes))


def default_sun() -> Light:
    """A directional light of 100000 lux, slanted so that caustics fall beside the things that throw them."""
    x, y, z = (float(d) for d in np.array(SUN_DIRECTION) / np.linalg.norm(SUN_DIRECTION))
    return Light(LightKind.DIRECTIONAL, "default sun", intensity=SUN_ILLUMINANCE_LUX, direction_ws=(x, y, z))


def default_sky(lights: Sequence[Light], subject: Sphere) -> Sky:
    """A dim daylight sky whose radiance is 2 % of what a white surface facing the lights has (`SKY_SHARE` E / pi)."""
    luminance = SKY_SHARE * sum(_illuminance(light, subject) for light in lights) / math.pi

    def shade(red: float, green: float, blue: float) -> tuple[float, float, float]:
        return (red * luminance, green * luminance, blue * luminance)

    return Sky(zenith=shade(0.7, 0.9, 1.3), horizon=shade(1.0, 1.0, 1.0), ground=shade(0.4, 0.4, 0.4))


def _illuminance(light: Light, subject: Sphere) -> float:
    """On a plane at the subject's centre that faces the light, lux; a spot counts as if it were aimed there."""
    brightness = light.intensity * float(np.mean(light.color))
    if light.kind is LightKind.DIRECTIONAL:
        return brightness
    distance_m = float(np.linalg.norm(np.asarray(light.position_ws) - subject.center_ws))
    nearest_m = 0.5 * subject.radius_m  # a light inside the subject is not the brighter for it
    return brightness / max(distance_m, nearest_m, 1e-12) ** 2


def default_camera(instances: Sequence[Instance], lights: Sequence[Light]) -> Camera:
    """A camera in front and above that sees the scene's subject and where its caustics fall, no wall between."""
    subject = subject_sphere(instances)
    view = _with_shadows(subject, instances, lights)
    walls = _walls(instances)
    distance_m = 1.05 * view.radius_m / math.sin(0.5 * YFOV_RAD)
    chosen: tuple[float, FloatArray] | None = None
    for azimuth_deg, elevation_deg in VIEWPOINTS:
        towards = _direction(math.radians(azimuth_deg), math.radians(elevation_deg))
        free_m = _free_distance(view, towards, distance_m, walls)
        if free_m >= distance_m:
            return Camera.look_at(view.center_ws + distance_m * towards, view.center_ws, yfov_rad=YFOV_RAD)
        if chosen is None or free_m > 1.1 * chosen[0]:
            chosen = (free_m, towards)
    assert chosen is not None
    # in a closed room: stand before the wall, and widen the angle to see as much as can be seen
    distance_m = 0.95 * chosen[0]
    half = math.asin(min(0.8, view.radius_m / distance_m))
    eye = view.center_ws + distance_m * chosen[1]
    return Camera.look_at(eye, view.center_ws, yfov_rad=max(YFOV_RAD, 2.0 * half))


def subject_sphere(instances: Sequence[Instance]) -> Sphere:
    """What the picture is about: the specular things, or else all; with everything that is not far larger than they."""
    boxes = np.array([_box(instance) for instance in instances])  # (N, 2, 3)
    sizes_m = np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
    specular = np.array([instance.optical_kind is not OpticalKind.DIFFUSE for instance in instances])
    if specular.any():
        low, high = _bounds(boxes[specular])
        reach_m, factor = float(np.linalg.norm(high - low)), SCENERY_BESIDE_SPECULAR
    else:
        low, high = _bounds(boxes)
        reach_m, factor = float(np.median(sizes_m)), SCENERY_BESIDE_MEDIAN
    gap_m = np.linalg.norm(np.maximum(np.maximum(boxes[:, 0] - high, low - boxes[:, 1]), 0.0), axis=1)
    belongs = (sizes_m <= factor * reach_m) & (gap_m <= reach_m)
    if specular.any():
        belongs |= specular
    if not belongs.any():
        belongs[:] = True
    return _sphere(_bounds(boxes[belongs]))


def _box(instance: Instance) -> FloatArray:
    points = instance.positions_ws()
    return np.stack((points.min(axis=0), points.max(axis=0)))


def _bounds(boxes: FloatArray) -> FloatArray:
    return np.stack((boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)))


def _sphere(box: FloatArray) -> Sphere:
    radius_m = 0.5 * float(np.linalg.norm(box[1] - box[0]))
    return Sphere(box.mean(axis=0), radius_m if radius_m > 0.0 else 1.0)


def _with_shadows(subject: Sphere, instances: Sequence[Instance], lights: Sequence[Light]) -> Sphere:
    """A sphere round the subject and the places on the floor where the lights throw its caustics."""
    floor_m = _floor_height(subject, instances)
    low, high = subject.center_ws - subject.radius_m, subject.center_ws + subject.radius_m
    if floor_m is not None:
        for light in lights:
            if light.kind is LightKind.DIRECTIONAL:
                along = np.asarray(light.direction_ws, np.float64)
            else:
                along = subject.center_ws - np.asarray(light.position_ws)
                along = along / max(float(np.linalg.norm(along)), 1e-12)
            if along[1] > -0.2:  # grazing light throws them out of any sensible picture
                continue
            hit = subject.center_ws + along * (floor_m - subject.center_ws[1]) / along[1]
            if np.linalg.norm(hit - subject.center_ws) < 4.0 * subject.radius_m:
                low = np.minimum(low, hit - 0.6 * subject.radius_m)
                high = np.maximum(high, hit + 0.6 * subject.radius_m)
        low[1] = max(low[1], min(floor_m, subject.center_ws[1]))
    center = 0.5 * (low + high)
    return Sphere(center, 0.5 * float((high - low).max()) * 1.15)


def _floor_height(subject: Sphere, instances: Sequence[Instance]) -> float | None:
    """Height of the highest receiver below the subject's centre, m; None if nothing is below."""
    heights = []
    for instance in instances:
        if instance.optical_kind is not OpticalKind.DIFFUSE:
            continue
        box = _box(instance)
        beneath = np.all(box[0, ::2] <= subject.center_ws[::2]) and np.all(box[1, ::2] >= subject.center_ws[::2])
        # of a room or a basin only the bottom is floor: flat things count with their top
        flat = box[1, 1] - box[0, 1] <= 0.1 * float((box[1] - box[0])[::2].max())
        height_m = float(box[1, 1] if flat else box[0, 1])
        if beneath and height_m <= subject.center_ws[1]:
            heights.append(height_m)
    return max(heights) if heights else None


def _direction(azimuth_rad: float, elevation_rad: float) -> FloatArray:
    across = math.cos(elevation_rad)
    return np.array([across * math.sin(azimuth_rad), math.sin(elevation_rad), across * math.cos(azimuth_rad)])


def _walls(instances: Sequence[Instance]) -> FloatArray:
    """Corners (T, 3, 3), world space, of the triangles that one cannot see through."""
    opaque = [i for i in instances if i.optical_kind is OpticalKind.DIFFUSE]
    corners = [i.positions_ws()[i.mesh.triangles] for i in opaque]
    found = np.concatenate(corners) if corners else np.zeros((0, 3, 3))
    return np.asarray(found[:: 1 + len(found) // BLOCKER_TRIANGLES])


def _free_distance(view: Sphere, towards: FloatArray, distance_m: float, walls: FloatArray) -> float:
    """How far one can go from the subject to the camera before a wall stands between them, m.

    Walls within the subject's own sphere do not count: things may stand about there. Ray-triangle test of Moeller and
    Trumbore 1997.
    """
    if len(walls) == 0:
        return distance_m
    one, two = walls[:, 1] - walls[:, 0], walls[:, 2] - walls[:, 0]
    across = np.cross(towards, two)
    det = np.einsum("ti,ti->t", one, across)
    inverse = np.divide(1.0, det, out=np.zeros_like(det), where=det != 0.0)
    free_m = distance_m
    sideways = np.cross(towards, (0.0, 1.0, 0.0))
    sideways = sideways / max(float(np.linalg.norm(sideways)), 1e-12)
    for shift in (0.0, -0.4, 0.4):
        offset = view.center_ws + shift * view.radius_m * sideways - walls[:, 0]
        u = np.einsum("ti,ti->t", offset, across) * inverse
        turned = np.cross(offset, one)
        v = (turned @ towards) * inverse
        t = np.einsum("ti,ti->t", two, turned) * inverse
        hit = (det != 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.9 * view.radius_m) & (t < free_m)
        if hit.any():
            free_m = float(t[hit].min())
    return free_m
