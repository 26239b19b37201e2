"""A glcaustics scene as a Mitsuba 3 scene: meshes with their normals, materials, lights, camera.

What differs on purpose: textures of diffuse surfaces become their mean colour (irradiance does not depend on them);
metals get, at each vertex, the reflectance that glTF's Schlick formula has there for one light, since Mitsuba has no
such BSDF (rough ones too: the reflectance at the vertex's own normal, not at each microfacet's); light is aimed at the
casters, so that no photon is wasted on what is not asked for. A lamp with a radius is exact, a glowing sphere, and
shines everywhere; the sun's disc is a sum of directional lights on the whole scene.
"""

from __future__ import annotations

import glob
import importlib
import math
import os
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.scene_export import beam_light, world_normals
from glcaustics.bench.targets import SPECULAR, luminance
from glcaustics.errors import UsageError
from glcaustics.optics.beam_spread import disc_parts
from glcaustics.scene.model import Camera, Instance, Light, LightKind, OpticalKind, Scene

FloatArray = npt.NDArray[np.float64]
FAST_VARIANT, SURE_VARIANT = "llvm_ad_mono", "scalar_rgb"
AIM_MARGIN = 1.02
LLVM_PATTERNS = ("/usr/lib/*/libLLVM.so.19*", "/usr/lib/*/libLLVM-19.so*", "/usr/lib/llvm-19/lib/libLLVM*.so*")


def find_llvm() -> str | None:
    """Path of LLVM 19, or None. Other versions are not taken: with LLVM 15 or 16 Dr.Jit ends the process."""
    if path := os.environ.get("DRJIT_LIBLLVM_PATH"):
        return path
    return next((found for pattern in LLVM_PATTERNS for found in sorted(glob.glob(pattern))), None)


def best_variant() -> str:
    """`llvm_ad_mono` where LLVM 19 is installed (apt-get install libllvm19), else `scalar_rgb`."""
    return FAST_VARIANT if find_llvm() else SURE_VARIANT


def mitsuba(variant: str) -> Any:
    """The module `mitsuba` with the variant set.

    Raises:
        UsageError: not installed, or the variant cannot start.
    """
    try:
        module = importlib.import_module("mitsuba")
    except ImportError:
        raise UsageError(
            "the package mitsuba is not installed", where="bench", remedy="pip install 'glcaustics[bench]'"
        ) from None
    if variant.startswith("llvm") and (llvm := find_llvm()):
        os.environ["DRJIT_LIBLLVM_PATH"] = llvm
    try:
        module.set_variant(variant)
    except ImportError as error:
        reason = str(error).splitlines()[0]
        raise UsageError(f"Mitsuba's variant {variant} does not start: {reason}", where="bench") from error
    module.set_log_level(module.LogLevel.Error)
    return module


def is_mono(mi: Any) -> bool:
    """Whether the variant carries luminance alone."""
    return "mono" in mi.variant()


def spectrum(mi: Any, color: npt.ArrayLike) -> Any:
    """A colour (3,) as the variant takes it: luminance, or RGB (unbounded, as emitters need)."""
    if is_mono(mi):
        return float(luminance(color))
    return {"type": "rgb", "value": [float(c) for c in np.asarray(color)]}


# ---------------------------------------------------------------- meshes and materials


def mesh(mi: Any, instance: Instance, bsdf: Any, reflectance: FloatArray | None = None) -> Any:
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


def bsdf_of(mi: Any, instance: Instance, albedo: float | None = None, *, rough: bool = False) -> Any:
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


# ---------------------------------------------------------------- lights


def unit(vector: npt.ArrayLike) -> FloatArray:
    """The vector at length 1, float64."""
    v = np.asarray(vector, np.float64)
    return np.asarray(v / np.linalg.norm(v))


def frame_around(direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors at right angles to a unit vector and to each other."""
    u = unit(np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))]))
    return u, np.cross(direction, u)


def look(
    mi: Any, eye: npt.ArrayLike, towards: npt.ArrayLike, up: npt.ArrayLike, scale: npt.ArrayLike = (1, 1, 1)
) -> Any:
    """Mitsuba's transform: +Z of the object along `towards`."""
    origin = np.asarray(eye, np.float64)
    transform = mi.ScalarTransform4f().look_at(
        origin=origin.tolist(), target=(origin + np.asarray(towards)).tolist(), up=np.asarray(up).tolist()
    )
    return transform.scale(np.asarray(scale, np.float64).tolist())


DISC_POINTS = 128  # collimated lights that stand for a disc in the sky


def aimed_lights(mi: Any, light: Light, aim_at_ws: FloatArray, scene_ws: FloatArray) -> dict[str, Any]:
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


def aimed_light(mi: Any, light: Light, aim_at_ws: FloatArray, scene_ws: FloatArray) -> dict[str, Any]:
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


def _collimated(mi: Any, d: FloatArray, power: FloatArray, aim_at: FloatArray, scene: FloatArray) -> dict[str, Any]:
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


def _gltf_spot(mi: Any, light: Light, power: FloatArray, texels: int = 512) -> dict[str, Any]:
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


# ---------------------------------------------------------------- the whole


def camera_sensor(mi: Any, camera: Camera, size: tuple[int, int]) -> dict[str, Any]:
    """A scene's camera, perspective or orthographic, with the film of a picture of `size` (width, height)."""
    m = camera.world_from_camera
    place = look(mi, m[:3, 3], -m[:3, 2], m[:3, 1])
    if camera.orthographic:
        aspect = size[0] / size[1]
        lens = {"type": "orthographic", "to_world": place.scale([camera.ymag_m * aspect] * 2 + [1.0])}
    else:
        lens = {"type": "perspective", "fov": math.degrees(camera.yfov_rad), "fov_axis": "y", "to_world": place}
    return lens | {"film": film(mi, size), "sampler": {"type": "independent"}}


def film(mi: Any, size: tuple[int, int]) -> dict[str, Any]:
    """A float32 film with a box filter."""
    return {
        "type": "hdrfilm",
        "width": int(size[0]),
        "height": int(size[1]),
        "rfilter": {"type": "box"},
        "pixel_format": "luminance" if is_mono(mi) else "rgb",
        "component_format": "float32",
    }


def shapes(mi: Any, scene: Scene, light: Light, *, albedo: float | None = None, rough: bool = False) -> dict[str, Any]:
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
