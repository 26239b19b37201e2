"""Instances as Mitsuba 3 shapes: meshes with their normals, and their materials.

What differs on purpose: textures of diffuse surfaces become their mean colour (irradiance does not depend on them);
metals get, at each vertex, the reflectance that glTF's Schlick formula has there for one light, since Mitsuba has no
such BSDF (rough ones too: the reflectance at the vertex's own normal, not at each microfacet's).
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from glcaustics.bench.mitsuba_variant import is_mono, spectrum
from glcaustics.bench.scene_export import world_normals
from glcaustics.bench.targets import SPECULAR, luminance
from glcaustics.passes.view_math import unit
from glcaustics.scene.model import FloatArray, Instance, Light, LightKind, OpticalKind, Scene


def shapes(
    mi: ModuleType, scene: Scene, light: Light, *, albedo: float | None = None, rough: bool = False
) -> dict[str, Any]:
    """Every instance at time 0, under unique names. `albedo`: of all diffuse surfaces. `rough`: see `bsdf_of`."""
    made = {}
    for index, instance in enumerate(scene.instances_at(0.0)):
        specular = instance.optical_kind in SPECULAR
        reflectance = None
        if instance.optical_kind is OpticalKind.MIRROR:
            reflectance = schlick_at_vertices(instance, light)
            if is_mono(mi):  # the luminance of coloured light on coloured metal is no product of luminances
                reflectance = luminance(reflectance * light.color)[:, None] / luminance(light.color)
        made[f"shape{index}"] = mesh(
            mi, instance, bsdf_of(mi, instance, None if specular else albedo, rough=rough), reflectance
        )
    return made


def mesh(mi: ModuleType, instance: Instance, bsdf: Any, reflectance: FloatArray | None = None) -> Any:
    """The instance in world space with its smooth normals; `reflectance`: (V, 1) or (V, 3) of its vertices."""
    points, normals = instance.positions_ws(), world_normals(instance)
    faces = instance.mesh.triangles.astype(np.uint32)
    if np.linalg.det(instance.world_from_object[:3, :3]) < 0.0:
        faces = faces[:, ::-1]
    properties = mi.Properties()
    properties["bsdf"] = bsdf
    made = mi.Mesh(instance.name, len(points), len(faces), has_vertex_normals=True, props=properties)
    if reflectance is not None:
        flat = np.ascontiguousarray(reflectance, np.float32).ravel()
        made.add_attribute("vertex_reflectance", reflectance.shape[1], flat)
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = np.ascontiguousarray(points, np.float32).ravel()
    parameters["vertex_normals"] = np.ascontiguousarray(normals, np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(faces).ravel()
    parameters.update()
    return made


def schlick_at_vertices(instance: Instance, light: Light) -> FloatArray:
    """Reflectance (V, 3) of a metal under one light: f0 + (1 - f0)(1 - cos)^5 (Schlick 1994; glTF 2.0)."""
    normals, f0 = world_normals(instance), np.asarray(instance.material.base_color)
    if light.kind is LightKind.DIRECTIONAL:
        towards = np.broadcast_to(-unit(light.direction_ws), normals.shape)
    else:
        towards = np.asarray(light.position_ws) - instance.positions_ws()
        towards = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    cosine = np.clip(np.abs(np.sum(normals * towards, axis=1)), 0.0, 1.0)
    return np.asarray(f0 + (1.0 - f0) * ((1.0 - cosine) ** 5)[:, None])


def bsdf_of(mi: ModuleType, instance: Instance, albedo: float | None = None, *, rough: bool = False) -> Any:
    """The BSDF of an instance; `albedo` replaces the colour of a diffuse one; `rough`: specular ones as rough as they
    are (GGX of width roughness^2, separable masking), else smooth.
    """
    material, kind = instance.material, instance.optical_kind
    facets: dict[str, Any] = {}
    if rough and material.roughness > 0.0:
        facets = {"distribution": "ggx", "alpha": float(material.roughness) ** 2}
    if kind in (OpticalKind.SOLID, OpticalKind.INTERFACE):
        return mi.load_dict(
            {
                "type": "roughdielectric" if facets else "dielectric",
                "int_ior": float(material.ior),
                "ext_ior": 1.0,
                "specular_transmittance": float(material.transmission),
                **facets,
            }
        )
    if kind is OpticalKind.MIRROR:
        attribute = {"type": "mesh_attribute", "name": "vertex_reflectance"}
        name = "roughconductor" if facets else "conductor"
        metal = {"type": name, "material": "none", "specular_reflectance": attribute, **facets}
        return mi.load_dict({"type": "twosided", "bsdf": metal})
    color = np.asarray(material.base_color) * _mean_texture(instance)
    reflectance = albedo if albedo is not None else spectrum(mi, np.clip(color, 0.0, 1.0))
    return mi.load_dict({"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}})


def _mean_texture(instance: Instance) -> FloatArray:
    image = instance.material.base_color_image
    if image is None:
        return np.ones(3)
    pixels = image.pixels[..., :3].astype(np.float64)
    if image.pixels.dtype == np.uint8:
        pixels /= 255.0
    if image.srgb:
        pixels = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
    return np.asarray(pixels.mean(axis=(0, 1)))
