"""Transforms of whole scenes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from glcaustics.errors import SceneError
from glcaustics.scene.model import Camera, FloatArray, Instance, Light, LightKind, Material, Scene, WaterBody


def scaled(scene: Scene, factor: float) -> Scene:
    """The scene `factor` times as large about the world's origin, so lit that its picture stays the same.

    Lengths (geometry, waters, lights and their radii, camera, absorption distances) grow by `factor`, the intensity of
    point and spot lights by its square, so that irradiance stays; directional lights, sky, emission and exposure are
    kept.

    Args:
        scene: any scene; it is not changed.
        factor: dimensionless, finite and above 0.

    Raises:
        SceneError: the factor is not a finite number above 0.
    """
    if not (math.isfinite(factor) and factor > 0.0):
        raise SceneError(f"scale factor {factor} is not above 0", where=scene.name, remedy="give a positive number")
    materials: dict[int, Material] = {}  # shared materials stay shared: the renderer uploads each once

    def material_of(material: Material) -> Material:
        if id(material) not in materials:
            distance_m = material.attenuation_distance_m * factor
            materials[id(material)] = replace(material, attenuation_distance_m=distance_m)
        return materials[id(material)]

    def instance_of(instance: Instance) -> Instance:
        matrix = _scaled_matrix(instance.world_from_object, factor)
        return replace(instance, material=material_of(instance.material), world_from_object=matrix)

    def water_of(water: WaterBody) -> WaterBody:
        matrix = _scaled_matrix(water.world_from_object, factor)
        return replace(water, material=material_of(water.material), world_from_object=matrix)

    path = scene.camera_at
    return replace(
        scene,
        instances=tuple(instance_of(i) for i in scene.instances),
        waters=tuple(water_of(w) for w in scene.waters),
        lights=tuple(_scaled_light(light, factor) for light in scene.lights),
        camera=_scaled_camera(scene.camera, factor),
        camera_at=None if path is None else lambda time_s: _scaled_camera(path(time_s), factor),
    )


def _scaled_matrix(world_from_object: FloatArray, factor: float) -> FloatArray:
    return np.diag([factor, factor, factor, 1.0]) @ np.asarray(world_from_object, np.float64)


def _scaled_camera(camera: Camera, factor: float) -> Camera:
    matrix = np.array(camera.world_from_camera, np.float64)
    matrix[:3, 3] *= factor  # the axes stay unit vectors
    return replace(camera, world_from_camera=matrix, ymag_m=camera.ymag_m * factor)


def _scaled_light(light: Light, factor: float) -> Light:
    x, y, z = light.position_ws
    intensity = light.intensity if light.kind is LightKind.DIRECTIONAL else light.intensity * factor * factor
    moved = (x * factor, y * factor, z * factor)
    return replace(light, position_ws=moved, intensity=intensity, radius_m=light.radius_m * factor)
