"""Small scenes and helpers of the feature tests: planes, boxes and sheets built in code, one call to render."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np
import numpy.typing as npt

import glcaustics as glc
from glcaustics.renderer import Frame
from glcaustics.scene.model import Camera, Instance, Light, LightKind, Material, Mesh, Scene
from tests.gpu.physics_meshes import grid_triangles, height_sheet, make_mesh

BACKEND = os.environ.get("GLC_TEST_BACKEND", "egl")
FloatArray = npt.NDArray[np.float64]

WHITE = Material("white", base_color=(0.8, 0.8, 0.8))
WATER = Material("water", base_color=(1.0, 1.0, 1.0), roughness=0.0, transmission=1.0, ior=1.333)
GLASS = Material("glass", base_color=(1.0, 1.0, 1.0), roughness=0.0, transmission=1.0, ior=1.5)
MIRROR = Material("mirror", base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=0.0)


def plane(name: str, half_m: float, y_m: float = 0.0, material: Material = WHITE, *, up: bool = True) -> Instance:
    """A horizontal square of two triangles."""
    x, z = np.meshgrid([-half_m, half_m], [-half_m, half_m])
    positions = np.stack((x.ravel(), np.full(4, y_m), z.ravel()), 1)
    triangles = grid_triangles(1, 1) if up else grid_triangles(1, 1)[:, ::-1]
    mesh = make_mesh(name, positions, np.tile([0.0, 1.0 if up else -1.0, 0.0], (4, 1)), triangles, False)
    return Instance(name, mesh, material)


def sheet(name: str, half_m: float, y_m: float, material: Material = WATER, cells: int = 16) -> Instance:
    """A flat water surface, normals up."""
    flat = height_sheet(name, half_m, cells, cells, np.zeros_like, np.zeros_like)
    return Instance(name, flat, material, translation(0.0, y_m, 0.0))


def translation(x: float, y: float, z: float) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def box_mesh(name: str, size_m: tuple[float, float, float]) -> Mesh:
    """A closed box about the origin, flat normals, wound outwards."""
    points, normals, triangles = [], [], []
    half = 0.5 * np.asarray(size_m)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = np.roll(np.eye(3), -1, axis=0)[axis], np.roll(np.eye(3), -2, axis=0)[axis]
            n = np.eye(3)[axis] * sign
            base = 4 * len(points)
            points.append([half * (n + a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
            normals.append([n] * 4)
            order = ((0, 1, 2), (0, 2, 3)) if sign > 0 else ((0, 2, 1), (0, 3, 2))
            triangles += [[base + i for i in t] for t in order]
    return make_mesh(name, np.concatenate(points), np.concatenate(normals), triangles, True)


def box(
    name: str,
    size_m: tuple[float, float, float],
    centre: tuple[float, float, float],
    material: Material = WHITE,
) -> Instance:
    return Instance(name, box_mesh(name, size_m), material, translation(*centre))


def sun(theta_deg: float = 0.0, intensity: float = 1.0) -> Light:
    """Directional light `theta_deg` off the vertical, towards +x."""
    theta = math.radians(theta_deg)
    return Light(LightKind.DIRECTIONAL, intensity=intensity, direction_ws=(math.sin(theta), -math.cos(theta), 0.0))


def lamp(position: tuple[float, float, float], intensity: float = 1.0) -> Light:
    return Light(LightKind.POINT, intensity=intensity, position_ws=position)


def from_above(half_m: float, y_m: float = 0.0, height_m: float | None = None) -> Camera:
    """Orthographic, straight down on the square |x|, |z| <= half; row 0 at z = -half, column 0 at x = -half."""
    height = 3.0 * half_m if height_m is None else height_m
    return Camera.look_at((0.0, y_m + height, 0.0), (0.0, y_m, 0.0), orthographic=True, ymag_m=half_m)


def scene_of(instances: list[Instance], lights: list[Light], camera: Camera, **other: Any) -> Scene:
    return Scene(other.pop("name", "feature"), tuple(instances), tuple(lights), camera, **other)


def shoot(scene: Scene, size: tuple[int, int] = (128, 128), *, time: float = 0.0, **arguments: Any) -> Frame:
    """One frame; receivers' AOVs without the specular surfaces in the eye's way unless `specular_view=True`."""
    arguments = {"method": "caustic_map", "quality": "medium", "specular_view": False, **arguments}
    arguments.setdefault("aovs", ("caustic_irradiance", "direct_irradiance", "position_ws"))
    with glc.Renderer(scene, size=size, backend=BACKEND, **arguments) as renderer:
        return renderer.render(time=time)


def grid_xz(half_m: float, pixels: int) -> tuple[FloatArray, FloatArray]:
    """x and z of the pixels' centres of `from_above`, each (pixels, pixels)."""
    centre = (np.arange(pixels) + 0.5) / pixels * 2.0 * half_m - half_m
    x, z = np.meshgrid(centre, centre)
    return x, z


def relative_rmse(image: npt.ArrayLike, reference: npt.ArrayLike) -> float:
    a, b = np.asarray(image, np.float64), np.asarray(reference, np.float64)
    return float(np.sqrt(((a - b) ** 2).mean()) / b.mean())


def eye_rays(camera: Camera, size: tuple[int, int]) -> FloatArray:
    """Unit directions (H, W, 3) of the rays through the pixels' centres of a perspective camera, world space."""
    x = ((np.arange(size[0]) + 0.5) / size[0] * 2 - 1) * size[0] / size[1]
    y = 1 - (np.arange(size[1]) + 0.5) / size[1] * 2
    tangent = math.tan(0.5 * camera.yfov_rad)
    xx, yy = np.meshgrid(x * tangent, y * tangent)
    d = np.stack((xx, yy, -np.ones_like(xx)), 2) @ camera.world_from_camera[:3, :3].T
    return np.asarray(d / np.linalg.norm(d, axis=2, keepdims=True))
