"""The checks every scene passes before it is rendered, wherever it comes from: ranges, finiteness, unit directions."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from glcaustics.errors import SceneError
from glcaustics.scene.limits import MAX_ANGULAR_DIAMETER_DEG, MAX_COORDINATE_M
from glcaustics.scene.model import Camera, Image, Instance, Light, LightKind, Material, Mesh, Scene, WaterBody

UNIT_TOLERANCE = 1e-3  # of the length of normals and directions
SINGULAR = 1e-9  # smallest over largest singular value of a transform


def validate_scene(scene: Scene, *, where: str = "") -> None:
    """Check a scene; each shared mesh and material once.

    Args:
        scene: any scene. Meshes of moving waters are not evaluated.
        where: the file that it comes from; its name when empty.

    Raises:
        SceneError: the first thing found wrong, on one line.
    """
    where = where or scene.name
    if not scene.instances and not scene.waters:
        raise SceneError("the scene has no objects", where=where, remedy="add at least one object")
    seen: set[int] = set()
    objects: list[Instance | WaterBody] = [*scene.instances, *scene.waters]
    for placed in objects:
        owner = f"object '{placed.name}'"
        _check_matrix(placed.world_from_object, owner, where)
        if id(placed.material) not in seen:
            seen.add(id(placed.material))
            _check_material(placed.material, where)
    for instance in scene.instances:
        if id(instance.mesh) not in seen:
            seen.add(id(instance.mesh))
            _check_mesh(instance.mesh, where)
    for light in scene.lights:
        _check_light(light, where)
    _check_camera(scene.camera, where)
    for name in ("zenith", "horizon", "ground"):
        _check_color(getattr(scene.sky, name), f"sky: {name}", where)
    if scene.exposure is not None:
        _check(scene.exposure, f"exposure {scene.exposure}", where, low=0.0, open_low=True)


def _check(
    value: float, what: str, where: str, low: float = -math.inf, high: float = math.inf, open_low: bool = False
) -> None:
    """Raise unless `value` is finite and in [low, high] (without `low` itself if `open_low`)."""
    if math.isfinite(value) and low <= value <= high and not (open_low and value == low):
        return
    if not math.isfinite(value):
        wrong, remedy = "is not finite", "give a number"
    elif value < low or (open_low and value == low):
        wrong = f"is {'not above' if open_low else 'below'} {low:g}"
        remedy = f"give a value {'above' if open_low else 'of at least'} {low:g}"
    else:
        wrong, remedy = f"is above {high:g}", f"give a value of at most {high:g}"
    raise SceneError(f"{what} {wrong}", where=where, remedy=remedy)


def _check_color(color: Iterable[float], what: str, where: str, high: float = math.inf) -> None:
    values = tuple(color)
    if len(values) != 3:
        raise SceneError(f"{what} has {len(values)} values", where=where, remedy="give red, green and blue")
    for value in values:
        _check(value, f"{what} {values}", where, low=0.0, high=high)


def _check_material(material: Material, where: str) -> None:
    owner = f"material '{material.name}'"
    # base colours above 1 would create energy; the sky and emission may be as bright as they like
    _check_color(material.base_color, f"{owner}: base_color", where, high=1.0)
    _check_color(material.emissive, f"{owner}: emissive", where)
    _check_color(material.attenuation_color, f"{owner}: attenuation_color", where, high=1.0)
    for name in ("metallic", "roughness", "transmission"):
        value = getattr(material, name)
        _check(value, f"{owner}: {name} {value}", where, low=0.0, high=1.0)
    _check(material.ior, f"{owner}: ior {material.ior}", where, low=1.0, high=100.0)
    _check(material.dispersion, f"{owner}: dispersion {material.dispersion}", where, low=0.0)
    lowest = float(material.ior_rgb().min())
    _check(lowest, f"{owner}: with its dispersion {material.dispersion:g} the ior of red {lowest:g}", where, low=1.0)
    distance_m = material.attenuation_distance_m
    if distance_m != math.inf:
        what = f"{owner}: attenuation_distance_m {distance_m}"
        _check(distance_m, what, where, low=0.0, open_low=True)
    for image in (material.base_color_image, material.metallic_roughness_image, material.emissive_image):
        if image is not None:
            _check_image(image, owner, where)


def _check_image(image: Image, owner: str, where: str) -> None:
    shape = image.pixels.shape
    if len(shape) != 3 or shape[2] not in (3, 4) or 0 in shape:
        raise SceneError(f"{owner}: image '{image.name}' has shape {shape}", where=where, remedy="give (H, W, 3 or 4)")
    if image.pixels.dtype not in (np.uint8, np.float32):
        kind = image.pixels.dtype
        raise SceneError(f"{owner}: image '{image.name}' is {kind}", where=where, remedy="use uint8 or float32")


def _check_mesh(mesh: Mesh, where: str) -> None:
    owner = f"mesh '{mesh.name}'"
    count = len(mesh.positions_m)
    for name, width in (("positions_m", 3), ("normals", 3), ("uv", 2)):
        values = getattr(mesh, name)
        if values.shape != (count, width):
            remedy = f"give ({count}, {width})"
            raise SceneError(f"{owner}: {name} has shape {values.shape}", where=where, remedy=remedy)
        bad = ~np.isfinite(values).all(axis=1)
        if name == "positions_m":
            bad |= np.abs(values).max(axis=1, initial=0.0) > MAX_COORDINATE_M
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            what = f"{owner}: {name} of vertex {first} is not finite or beyond {MAX_COORDINATE_M:g}"
            raise SceneError(what, where=where, remedy="remove such vertices")
    triangles = mesh.triangles
    if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0:
        raise SceneError(f"{owner}: triangles have shape {triangles.shape}", where=where, remedy="give (T, 3), T > 0")
    low, high = int(triangles.min()), int(triangles.max())
    if low < 0 or high >= count:
        wrong = low if low < 0 else high
        remedy = f"use 0 to {count - 1}"
        raise SceneError(f"{owner}: vertex index {wrong} is out of range", where=where, remedy=remedy)
    length = np.linalg.norm(mesh.normals.astype(np.float64), axis=1)
    bad = np.abs(length - 1.0) > UNIT_TOLERANCE
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        what = f"{owner}: the normal of vertex {first} has length {length[first]:g}"
        raise SceneError(what, where=where, remedy="normalise it")


def _check_matrix(matrix: np.ndarray, owner: str, where: str) -> None:
    if matrix.shape != (4, 4) or not np.abs(matrix).max() <= MAX_COORDINATE_M:
        what = f"{owner}: its transform is not a finite 4x4 matrix within {MAX_COORDINATE_M:g}"
        raise SceneError(what, where=where, remedy="give finite numbers")
    if not np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0), rtol=0.0, atol=1e-9):
        what = f"{owner}: the last row of its transform is {matrix[3].tolist()}"
        raise SceneError(what, where=where, remedy="make it 0 0 0 1")
    scale = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    if not scale[2] > SINGULAR * scale[0]:
        raise SceneError(f"{owner}: its transform is singular", where=where, remedy="give it a scale other than 0")


def _check_light(light: Light, where: str) -> None:
    owner = f"light '{light.name}'"
    _check(light.intensity, f"{owner}: intensity {light.intensity}", where, low=0.0)
    _check_color(light.color, f"{owner}: color", where)
    _check(light.radius_m, f"{owner}: radius_m {light.radius_m}", where, low=0.0, high=MAX_COORDINATE_M)
    degrees = math.degrees(light.angular_diameter_rad)
    what = f"{owner}: angular_diameter_deg {degrees:g}"
    _check(degrees, what, where, low=0.0, high=MAX_ANGULAR_DIAMETER_DEG)
    if light.kind is not LightKind.DIRECTIONAL and not np.isfinite(light.position_ws).all():
        raise SceneError(f"{owner}: its position is not finite", where=where, remedy="give finite numbers")
    if light.kind is not LightKind.POINT:
        length = float(np.linalg.norm(light.direction_ws))
        if not abs(length - 1.0) <= UNIT_TOLERANCE:
            raise SceneError(f"{owner}: its direction has length {length:g}", where=where, remedy="normalise it")
    if light.kind is LightKind.SPOT:
        inner, outer = light.inner_cone_rad, light.outer_cone_rad
        if not 0.0 <= inner < outer <= math.pi / 2:
            what = f"{owner}: its cone is {inner:g} to {outer:g} rad"
            raise SceneError(what, where=where, remedy="give half angles 0 <= inner < outer <= pi/2")


def _check_camera(camera: Camera, where: str) -> None:
    _check_matrix(camera.world_from_camera, "camera", where)
    axes = camera.world_from_camera[:3, :3]
    if not np.allclose(axes.T @ axes, np.eye(3), rtol=0.0, atol=1e-4):
        raise SceneError("camera: its axes are not orthonormal", where=where, remedy="take the scale out of it")
    if camera.orthographic:
        _check(camera.ymag_m, f"camera: ymag_m {camera.ymag_m}", where, low=0.0, open_low=True)
    elif not 0.0 < camera.yfov_rad < math.pi:
        what = f"camera: yfov {camera.yfov_rad:g} rad"
        raise SceneError(what, where=where, remedy="give an angle between 0 and pi")
