"""Eye rays behind open surfaces against float64 ray casting of the scene's triangles: how true the solvers are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from glcaustics.bench.convergence import ITERATIONS
from glcaustics.bench.scene_export import beam_scene, opaque_caster
from glcaustics.bench.solver_variants import Buffers, VariantBench, ray_from_px, scene_buffers
from glcaustics.gpu import Device, create_device
from glcaustics.optics.beam_paths import PathTracer
from glcaustics.optics.raycast import Hits, RayCaster
from glcaustics.passes.camera import CameraState
from glcaustics.scene.model import Camera, OpticalKind, Scene

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
ON_SURFACE = 0.5  # pixels between a visible point and the plane of what the camera sees there
MANY = 16384  # steps of the pixel-exact march


@dataclass(frozen=True)
class EyeTruth:
    """Shares of the resolvable pixels of one view; resolvable = the camera sees what float64 ray casting hits.

    `pixels`: refracted rays; `resolvable`: of them, the share; `within_1px[k]`: Newton's estimate after
    `iterations[k]` look-ups lies within one pixel (max norm) of the truth; `dda`: that of pixel-exact marching.
    """

    pixels: int
    resolvable: float
    iterations: tuple[int, ...]
    within_1px: tuple[float, ...]
    dda: float

    @property
    def weight(self) -> float:
        """Number of resolvable pixels."""
        return self.pixels * self.resolvable


@dataclass(frozen=True, eq=False)
class RayEnds:
    """Where the n eye rays of a picture end on opaque surfaces, by float64 ray casting.

    `tried`: (H, W), pixels with a ray, row 0 lowest; the others by ray, in the picture's order: `direction_ws` (n, 3),
    `hits`, and of these `px` (n, 2) pixel coordinates, `depth_m` (n,) along the view axis, `inside` (n,) the picture.
    """

    tried: BoolArray
    direction_ws: FloatArray
    hits: Hits
    px: FloatArray
    depth_m: FloatArray
    inside: BoolArray

    def picture(self, values: np.ndarray) -> np.ndarray:
        """Values by ray (n, ...) as (H, W, ...), 0 where there is no ray."""
        made = np.zeros((*self.tried.shape, *values.shape[1:]), values.dtype)
        made[self.tried] = values
        return made


def cast_rays(caster: RayCaster, buffers: Buffers) -> RayEnds:
    """Follow every eye ray of a picture to what it hits first."""
    tried = buffers.ray[..., 3] > 0.0
    direction = np.asarray(buffers.ray[tried][:, :3], np.float64)
    hits = caster.first_hits(np.asarray(buffers.origin_ws[tried], np.float64), direction)
    there = hits.object_id >= 0
    px, depth = _project(buffers, np.where(there[:, None], hits.point_ws, 0.0))
    inside = there & (depth > 0.0) & np.all((px >= 0.0) & (px < np.asarray(buffers.size)), axis=1)
    return RayEnds(tried, direction, hits, px, depth, inside)


def has_open_surface(scene: Scene) -> bool:
    """Whether there is a surface of one interface, such as water."""
    return any(i.optical_kind is OpticalKind.INTERFACE for i in scene.instances_at(0.0))


def eye_truth(
    scene: Scene,
    cameras: Sequence[Camera],
    size: tuple[int, int] = (1280, 720),
    iterations: Sequence[int] = ITERATIONS,
    backend: str = "auto",
) -> list[EyeTruth]:
    """One result a view that resolves anything, at time 0.

    Raises:
        UsageError: embreex is not installed.
    """
    caster = opaque_caster(scene.instances_at(0.0))
    found = []
    with create_device(backend) as device:
        for camera in cameras:
            buffers = scene_buffers(device, scene, camera, size)
            exact, resolvable = ray_truth(caster, buffers)
            if not resolvable.any():
                continue
            bench = VariantBench(device, buffers)
            newton, dda = (
                tuple(_near(bench.solve(variant, count), exact, resolvable) for count in counts)
                for variant, counts in (("planes", iterations), ("dda", (MANY,)))
            )
            rays = int((buffers.ray[..., 3] > 0.0).sum())
            found.append(EyeTruth(rays, float(resolvable.sum()) / rays, tuple(iterations), newton, dda[0]))
            bench.release()
    return found


def _near(solved: FloatArray, exact: FloatArray, where: BoolArray) -> float:
    """Share of the pixels of a mask solved within one pixel (max norm) of the exact place."""
    return float((np.abs(solved[where][:, :2] - exact[where]).max(axis=-1) <= 1.0).mean())


def solid_truth(
    scene: Scene, camera: Camera, size: tuple[int, int], device: Device
) -> tuple[FloatArray, BoolArray, int]:
    """The way through solids, in and out again, with the triangles' interpolated normals.

    Returns:
        Pixel coordinates (H, W, 2) of where each eye ray ends, the mask (H, W) where the camera sees that, and the
        number of rays that go through.
    """
    traced = beam_scene(scene, analytic_water=False)
    buffers = scene_buffers(device, scene, camera, size)
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    grid = np.stack([x, y, np.ones_like(x)], axis=-1)
    state = buffers.camera
    ray = (grid @ ray_from_px(state, size).T).reshape(-1, 3)
    origin = np.array(np.broadcast_to(state.world_from_camera[:3, 3], ray.shape), np.float64)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    landed = PathTracer(traced, RayCaster(traced)).follow(origin, ray, "TT", from_light=False)
    through = landed.signature >= 0
    px, depth = _project(buffers, landed.point_ws)
    inside = through & (depth > 0.0) & np.all((px >= 0.0) & (px < np.asarray(size)), axis=1)
    seen = inside & _stored(buffers, landed.point_ws, landed.normal_ws, px, depth)
    return px.reshape(*x.shape, 2), seen.reshape(x.shape), int(through.sum())


def ray_truth(caster: RayCaster, buffers: Buffers) -> tuple[FloatArray, BoolArray]:
    """Pixel coordinates (H, W, 2) of what each ray hits first, and the mask (H, W) where the camera sees that."""
    ends, camera = cast_rays(caster, buffers), buffers.camera
    hits, px = ends.hits, ends.px
    eye_ray = np.concatenate([px, np.ones_like(px[:, :1])], axis=1) @ ray_from_px(camera, buffers.size).T
    sees = np.einsum("ij,ij->i", hits.geometric_ws, eye_ray if not camera.orthographic else -_back(camera, px))
    meets = np.einsum("ij,ij->i", hits.geometric_ws, ends.direction_ws)
    seen = ends.inside & (sees * meets > 0.0) & _stored(buffers, hits.point_ws, hits.geometric_ws, px, ends.depth_m)
    return ends.picture(px), ends.picture(seen)


def _back(camera: CameraState, like: FloatArray) -> FloatArray:
    """The view's backward axis, once a row of `like`."""
    return np.broadcast_to(camera.world_from_camera[:3, 2], (len(like), 3))


def _project(buffers: Buffers, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, 2) pixel coordinates and (n,) depth along the view axis of world points (n, 3)."""
    view = np.concatenate([points, np.ones_like(points[:, :1])], axis=1) @ buffers.camera.camera_from_world.T
    depth = np.asarray(-view[:, 2], np.float64)
    scale = np.ones_like(depth) if buffers.camera.orthographic else np.where(depth > 0.0, depth, 1.0)
    ndc = np.asarray(view[:, :2] / scale[:, None] / np.asarray(buffers.camera.lens[:2]), np.float64)
    return (ndc * 0.5 + 0.5 + np.asarray(buffers.camera.jitter_uv)) * np.asarray(buffers.size), depth


def _stored(buffers: Buffers, points: FloatArray, normals: FloatArray, px: FloatArray, depth: FloatArray) -> BoolArray:
    """Whether the texel of each point holds the point's surface: on its plane to half a pixel."""
    width, height = buffers.size
    camera = buffers.camera
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    grid = np.stack([x, y, np.ones_like(x)], axis=-1)
    matrix = ray_from_px(camera, buffers.size)
    if camera.orthographic:
        centre = grid * [1.0, 1.0, 0.0] - [0.5 * width, 0.5 * height, 0.0]
        stored = camera.world_from_camera[:3, 3] + centre @ matrix.T + buffers.depth_m[..., None] * matrix[:, 2]
    else:
        stored = camera.world_from_camera[:3, 3] + (grid @ matrix.T) * buffers.depth_m[..., None]
    pixel_m = 2.0 * camera.lens[1] / height * (np.ones_like(depth) if camera.orthographic else depth)
    column = np.clip(np.nan_to_num(px[:, 0]).astype(int), 0, width - 1)
    row = np.clip(np.nan_to_num(px[:, 1]).astype(int), 0, height - 1)
    gap = np.abs(np.einsum("ij,ij->i", stored[row, column] - points, normals))
    return np.asarray((buffers.depth_m[row, column] > 0.0) & (gap < ON_SURFACE * pixel_m))
