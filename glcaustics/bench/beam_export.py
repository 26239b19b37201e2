"""A glcaustics scene as the reference beams take it."""

from __future__ import annotations

import numpy as np

from glcaustics.bench.mitsuba_scene import normals_ws
from glcaustics.optics.beam_scene import BeamLight, BeamMesh, BeamScene, SurfaceKind, SurfaceOptics
from glcaustics.scene.model import Instance, Light, LightKind, OpticalKind, Scene

KINDS = {
    OpticalKind.DIFFUSE: SurfaceKind.DIFFUSE,
    OpticalKind.MIRROR: SurfaceKind.MIRROR,
    OpticalKind.SOLID: SurfaceKind.DIELECTRIC,
    OpticalKind.INTERFACE: SurfaceKind.DIELECTRIC,
}


def beam_scene(scene: Scene) -> BeamScene:
    """Meshes at time 0 with their smooth normals, optics and lights, world space."""
    return BeamScene(
        tuple(_mesh(i) for i in scene.instances_at(0.0)),
        tuple(_light(light) for light in scene.lights if light.shines),
        name=scene.name,
    )


def _mesh(instance: Instance) -> BeamMesh:
    m = instance.material
    triangles = instance.mesh.triangles.astype(np.int64)
    if np.linalg.det(instance.world_from_object[:3, :3]) < 0.0:
        triangles = triangles[:, ::-1]
    ior, sigma = (tuple(float(v) for v in values) for values in (m.ior_rgb(), m.sigma_a))
    optics = SurfaceOptics(
        KINDS[instance.optical_kind],
        ior_rgb=(ior[0], ior[1], ior[2]),
        sigma_a_per_m=(sigma[0], sigma[1], sigma[2]),
        transmission=m.transmission,
        reflectance=m.base_color,
    )
    return BeamMesh(instance.positions_ws().astype(np.float64), normals_ws(instance), triangles, optics)


def _light(light: Light) -> BeamLight:
    r, g, b = (light.intensity * c for c in light.color)
    if light.kind is LightKind.DIRECTIONAL:
        return BeamLight((r, g, b), light.direction_ws)
    cone = light.outer_cone_rad if light.kind is LightKind.SPOT else None
    return BeamLight((r, g, b), light.direction_ws, light.position_ws, light.inner_cone_rad, cone)
