"""From the renderer's scene to the plain arrays of the reference beams (and of others who need them)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from glcaustics.errors import SceneError
from glcaustics.optics.beam_scene import BeamLight, BeamMesh, BeamScene, BeamWater, SurfaceKind, SurfaceOptics
from glcaustics.optics.beam_spread import RoughOptics, SizedBeamLight
from glcaustics.optics.beams import HeightField
from glcaustics.optics.raycast import RayCaster
from glcaustics.scene.model import Instance, Light, LightKind, Material, OpticalKind, Scene, WaterBody
from glcaustics.scene.water import WaveSurface, surface_of

FloatArray = npt.NDArray[np.float64]


def beam_scene(
    scene: Scene, time_s: float = 0.0, *, analytic_water: bool = True, spread: int | None = 256, rough: bool = False
) -> BeamScene:
    """The scene at a time for `glcaustics.optics.reference`.

    Args:
        analytic_water: sums of waves as formulas instead of their meshes: the truth that a finer mesh would approach.
            False: the meshes that the renderer and other tools get.
        spread: points that stand for a light with a size, and facets for a rough surface; None: points and smooth.
        rough: trace rough specular surfaces as such. Off: smooth, as most methods take them.
    """
    facets = spread if rough else None
    meshes = [beam_mesh(instance, facets) for instance in scene.instances]
    waters, notes = [], []
    for body in scene.waters:
        water = _analytic(body, time_s, facets) if analytic_water else None
        if water is not None:
            waters.append(water)
            continue
        if analytic_water:
            notes.append(f"water '{body.name}' has no formula to trace: its mesh stands for it")
        meshes.append(
            beam_mesh(Instance(body.name, body.mesh_at(time_s), body.material, body.world_from_object), facets)
        )
    lights = tuple(beam_light(light, spread) for light in scene.lights if light.shines)
    return BeamScene(tuple(meshes), lights, tuple(waters), scene.name, tuple(notes))


def renderer_events(scene: Scene, time_s: float = 0.0) -> int:
    """Specular events on the longest light path that the renderer's methods follow: 2 with a solid, else 1."""
    return 2 if any(i.optical_kind is OpticalKind.SOLID for i in scene.instances_at(time_s)) else 1


def world_normals(instance: Instance) -> FloatArray:
    """Unit vertex normals in world space, (V, 3) float64."""
    linear = instance.world_from_object[:3, :3]
    normals = instance.mesh.normals.astype(np.float64) @ np.linalg.inv(linear)
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))


def beam_mesh(instance: Instance, facets: int | None = None) -> BeamMesh:
    """One instance in world space; a mirroring transform turns its triangles round."""
    triangles = instance.mesh.triangles.astype(np.int64)
    if np.linalg.det(instance.world_from_object[:3, :3]) < 0.0:
        triangles = triangles[:, ::-1]
    return BeamMesh(
        instance.positions_ws().astype(np.float64),
        world_normals(instance),
        triangles,
        _optics(instance.optical_kind, instance.material, facets),
    )


def _optics(kind: OpticalKind, material: Material, facets: int | None) -> SurfaceOptics:
    plain = _smooth_optics(kind, material)
    if facets is None or kind is OpticalKind.DIFFUSE or material.roughness == 0.0:
        return plain
    return RoughOptics(**vars(plain), roughness=float(material.roughness), facets=facets)


def _smooth_optics(kind: OpticalKind, material: Material) -> SurfaceOptics:
    if kind is OpticalKind.DIFFUSE:
        return SurfaceOptics(SurfaceKind.DIFFUSE)
    if kind is OpticalKind.MIRROR:
        return SurfaceOptics(SurfaceKind.MIRROR, reflectance=_three(material.base_color))
    return SurfaceOptics(
        SurfaceKind.DIELECTRIC, _three(material.ior_rgb()), _three(material.sigma_a), float(material.transmission)
    )


def _three(values: npt.ArrayLike) -> tuple[float, float, float]:
    a, b, c = (float(v) for v in np.asarray(values, np.float64))
    return a, b, c


def beam_light(light: Light, points: int | None = 256) -> BeamLight:
    """Colour times intensity, the cone of a spot, and a light's size as a sum over `points` (None: no size)."""
    plain = _point_light(light)
    if points is None or not light.has_size:
        return plain
    radius_m = 0.0 if light.kind is LightKind.DIRECTIONAL else light.radius_m
    return SizedBeamLight(
        **vars(plain), radius_m=radius_m, angular_radius_rad=0.5 * light.angular_diameter_rad, points=points
    )


def _point_light(light: Light) -> BeamLight:
    intensity = _three(np.asarray(light.color) * light.intensity)
    if light.kind is LightKind.DIRECTIONAL:
        return BeamLight(intensity, _three(light.direction_ws))
    if light.kind is LightKind.POINT:
        return BeamLight(intensity, position_ws=_three(light.position_ws))
    return BeamLight(
        intensity, _three(light.direction_ws), _three(light.position_ws), light.inner_cone_rad, light.outer_cone_rad
    )


def _analytic(body: WaterBody, time_s: float, facets: int | None) -> BeamWater | None:
    """The water's formula, if it is a sum of plain sine waves that lies level; else None."""
    try:
        surface = surface_of(body)
    except SceneError:
        return None
    moved = body.world_from_object.copy()
    moved[:3, 3] = 0.0
    if not isinstance(surface, WaveSurface) or not np.array_equal(moved, np.eye(4)):
        return None
    if any(w.steepness > 0.0 for w in surface.waves):
        return None  # a Gerstner wave's crests overhang the rectangle that its grid rests on
    mesh = body.mesh_at(time_s)
    x, _, z = (float(v) for v in mesh.positions_m.max(axis=0) - mesh.positions_m.min(axis=0))
    field = HeightField(lambda x, z: surface.height(x, z, time_s), lambda x, z: surface.gradient(x, z, time_s))
    bound = sum(abs(w.amplitude_m) for w in surface.waves)
    return BeamWater(
        field,
        _three(body.world_from_object[:3, 3]),
        (x, z),
        bound,
        _optics(OpticalKind.INTERFACE, body.material, facets),
    )


def opaque_caster(instances: Iterable[Instance]) -> RayCaster:
    """Casts rays at the opaque ones.

    Raises:
        UsageError: embreex is not installed.
    """
    return RayCaster(BeamScene(tuple(beam_mesh(i) for i in instances if i.optical_kind is OpticalKind.DIFFUSE), ()))
