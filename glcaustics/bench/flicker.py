"""Flicker while the camera pans over still light: of the filter, and of plainer means of the same frames."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics import metrics
from glcaustics.bench.plan import FlickerPlan
from glcaustics.bench.targets import luminance
from glcaustics.passes.camera import CameraState
from glcaustics.renderer import Renderer
from glcaustics.scene.model import Camera, Scene, WaterBody

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
METHOD, QUALITY = "photon_trace", "low"
RAW, FILTER, EXPONENTIAL, PLAIN = "one frame", "filter", "filter, exponential history", "plain exponential mean"
FILTERS: Mapping[str, Mapping[str, Any]] = {EXPONENTIAL: {"denoise_history": "exponential"}, FILTER: {}}
ALPHA = 0.2  # of the plain mean: what a new frame weighs, as in Schied et al. 2017
SAME_SURFACE = 0.05  # of the distance from the eye: farther from what a pixel shows, a point is hidden there
POINT_STEP = 2  # pixels between the points that are followed
CREASE = 0.5  # of the step over two pixels: a position that is farther from the middle of its neighbours is at an edge
EDGE_REACH = 2  # pixels: nearer to an edge, a point's footprint may hold two surfaces
REFERENCE_SEED = 1  # not the frames': the reference's noise must not be theirs


def pan_flicker(scene: Scene, plan: FlickerPlan, backend: str) -> dict[str, Any]:
    """Flicker and relative RMSE of the last frames of a pan, the water standing still.

    The plain mean is the base line: alpha 0.2 of the unfiltered frames, history looked up bilinearly where the true
    position was the frame before, begun anew where that was hidden. No filter over space.

    Returns:
        `rows`: `name`, `flicker` (metrics.surface_flicker of the luminance), `off_edges` (of the points that never come
        near a surface's edge, which flickers as its pixels do), `rmse` over the reference's mean, its noise taken off;
        None without a reference. `motion_px`: median of the points' motion from frame to frame; `points`,
        `points_off_edges`: how many; `seconds` of all, `reference_seconds` of it.

    Raises:
        UsageError: no point stays in the picture, or away from edges.
    """
    start, still = time.perf_counter(), panned(scene, plan, backend)
    raw, positions = _frames(still, plan, backend, {"denoise": False})
    bounds = np.stack([np.nanmin(positions[0], axis=(0, 1)), np.nanmax(positions[0], axis=(0, 1))])
    cameras = [CameraState.make(still.view_at(float(k)), plan.size, bounds) for k in range(plan.frames)]
    stacks = {RAW: raw, PLAIN: exponential_mean(raw, positions, cameras)}
    stacks |= {name: _frames(still, plan, backend, options)[0] for name, options in FILTERS.items()}
    before_reference = time.perf_counter()
    halves = _reference(still, plan, backend) if plan.reference_views else None
    reference_seconds = time.perf_counter() - before_reference
    last = slice(plan.frames - plan.shown, plan.frames)
    points, rows = _followed(positions[last], cameras[last]), []
    inner = points[:, _off_edges(points, positions[last])]
    for name, frames in stacks.items():
        everywhere, off_edges = (metrics.surface_flicker(frames[last], each) for each in (points, inner))
        rmse = None if halves is None else _rmse(halves, frames[_views(plan)])
        rows.append({"name": name, "flicker": everywhere, "off_edges": off_edges, "rmse": rmse})
    return {
        "rows": rows,
        "points": points.shape[1],
        "points_off_edges": inner.shape[1],
        "motion_px": float(np.nanmedian(np.linalg.norm(np.diff(points, axis=0), axis=2))),
        "seconds": time.perf_counter() - start,
        "reference_seconds": reference_seconds,
    }


def panned(scene: Scene, plan: FlickerPlan, backend: str) -> Scene:
    """The scene with its waters as they stand at 0 s and a camera that moves along its right axis, a step a second.

    The step moves what lies in the median depth of the scene's own view by `pan_px`. Half of the steps done, the camera
    is where the scene's is.
    """
    camera = scene.view_at(0.0)
    options: dict[str, Any] = {"aovs": ("depth_m",), "specular_view": False, "stats": False}
    with Renderer(scene, plan.size, "none", QUALITY, backend, **options) as renderer:
        depth = renderer.render().aov["depth_m"]
    half_height = camera.ymag_m if camera.orthographic else np.tan(0.5 * camera.yfov_rad) * np.median(depth[depth > 0])
    start = np.array(camera.world_from_camera, np.float64)
    right = start[:3, 0] / np.linalg.norm(start[:3, 0])
    step_ws = right * (plan.pan_px * 2.0 * half_height / plan.size[1])

    def camera_at(time_s: float) -> Camera:
        moved = start.copy()
        moved[:3, 3] += step_ws * (time_s - 0.5 * plan.frames)
        return replace(camera, world_from_camera=moved)

    return replace(scene, camera_at=camera_at, waters=tuple(_standing(water) for water in scene.waters))


def _standing(water: WaterBody) -> WaterBody:
    mesh = water.mesh_at(0.0)
    return replace(water, mesh_at=lambda _: mesh, animated=False)


def exponential_mean(frames: FloatArray, positions: FloatArray, cameras: Sequence[CameraState]) -> FloatArray:
    """(T, H, W) means of frames (T, H, W) that show positions (T, H, W, 3), metres, world space, NaN for none."""
    means = [frames[0]]
    for k in range(1, len(frames)):
        px, seen = _seen(positions[k].reshape(-1, 3), positions[k - 1], cameras[k - 1])
        history = np.where(seen, _bilinear(means[-1], px), frames[k].ravel()).reshape(frames[k].shape)
        means.append((1.0 - ALPHA) * history + ALPHA * frames[k])
    return np.stack(means)


def _seen(points_ws: FloatArray, positions: FloatArray, camera: CameraState) -> tuple[FloatArray, BoolArray]:
    """Where points (N, 3) are in a picture that shows positions (H, W, 3): (N, 2) column and row; whether it does."""
    height, width = positions.shape[:2]
    clip = points_ws @ camera.clip_from_world[:, :3].T + camera.clip_from_world[:, 3]
    in_front = clip[:, 3] > 0.0
    ndc = clip[:, :2] / np.where(in_front, clip[:, 3], np.nan)[:, None]
    px = (0.5 + ndc * (0.5, -0.5)) * (width, height)
    inside = np.asarray(((px >= 0.0) & (px < (width, height))).all(axis=1))
    column, row = np.where(inside[:, None], px, 0.0).astype(int).T
    gap = np.linalg.norm(positions[row, column] - points_ws, axis=1)
    distance = np.linalg.norm(points_ws - camera.world_from_camera[:3, 3], axis=1)
    return px, inside & (gap < SAME_SURFACE * distance)


def _bilinear(image: FloatArray, px: FloatArray) -> FloatArray:
    """(N,) of an image (H, W) at columns and rows (N, 2), (0.5, 0.5) the middle of the first pixel; NaN for NaN."""
    height, width = image.shape
    at = np.clip(px - 0.5, 0.0, (width - 1, height - 1))
    first = np.clip(np.floor(np.nan_to_num(at)).astype(int), 0, (width - 2, height - 2))
    x, y = (at - first).T
    c, r = first.T
    above = (1.0 - x) * image[r, c] + x * image[r, c + 1]
    below = (1.0 - x) * image[r + 1, c] + x * image[r + 1, c + 1]
    return np.asarray((1.0 - y) * above + y * below)


def _followed(positions: FloatArray, cameras: Sequence[CameraState]) -> FloatArray:
    """(T, N, 2) where points of the first picture are in each; NaN where they are hidden."""
    points = positions[0, ::POINT_STEP, ::POINT_STEP].reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    found = (_seen(points, shown, camera) for shown, camera in zip(positions, cameras, strict=True))
    return np.stack([np.where(seen[:, None], px, np.nan) for px, seen in found])


def _off_edges(points_px: FloatArray, positions: FloatArray) -> BoolArray:
    """(N,) which points (T, N, 2) show one surface alone around them in all pictures of positions (T, H, W, 3)."""
    off = np.ones(points_px.shape[1], bool)
    for px, shown in zip(points_px, positions, strict=True):
        edge = np.zeros(shown.shape[:2], bool)
        edge[1:-1] |= _creased(shown[:-2], shown[1:-1], shown[2:])
        edge[:, 1:-1] |= _creased(shown[:, :-2], shown[:, 1:-1], shown[:, 2:])
        around = np.lib.stride_tricks.sliding_window_view(np.pad(edge, EDGE_REACH), (2 * EDGE_REACH + 1,) * 2)
        seen = np.isfinite(px).all(axis=1)
        column, row = np.where(seen[:, None], px, 0.0).astype(int).T
        off &= ~(seen & np.asarray(around.any(axis=(2, 3)))[row, column])
    return off


def _creased(before: FloatArray, here: FloatArray, after: FloatArray) -> BoolArray:
    """Whether positions (..., 3) of three pixels in a row are not evenly spaced on one line, or one has none."""
    off = np.linalg.norm(before - 2.0 * here + after, axis=-1)
    return np.asarray(~(off <= CREASE * np.linalg.norm(after - before, axis=-1)))


def _frames(still: Scene, plan: FlickerPlan, backend: str, options: Mapping[str, Any]) -> tuple[FloatArray, FloatArray]:
    """Every frame's luminance of the irradiance (T, H, W) and positions (T, H, W, 3), NaN where no surface is."""
    return _rendered(still, plan.size, backend, range(plan.frames), {"photons": plan.photons, **options})


def _rendered(
    still: Scene, size: tuple[int, int], backend: str, steps: Iterable[float], options: Mapping[str, Any], seed: int = 0
) -> tuple[FloatArray, FloatArray]:
    shown = ("caustic_irradiance", "position_ws", "depth_m")
    light, positions = [], []
    with Renderer(
        still, size, METHOD, QUALITY, backend,
        aovs=shown, specular_view=False, stats=False, options=options, seed=seed,
    ) as renderer:  # fmt: skip
        for step in steps:
            aov = renderer.render(float(step)).aov
            light.append(luminance(aov["caustic_irradiance"]))
            positions.append(np.where(aov["depth_m"][..., None] > 0.0, aov["position_ws"], np.nan))
    return np.stack(light), np.stack(positions).astype(np.float64)


def _views(plan: FlickerPlan) -> list[int]:
    """Which of the frames have a reference."""
    return [int(k) for k in np.rint(np.linspace(plan.frames - plan.shown, plan.frames - 1, plan.reference_views))]


def _reference(still: Scene, plan: FlickerPlan, backend: str) -> FloatArray:
    """(2, V, H, W): two independent halves of the reference of V frames, by many photons, unfiltered."""
    steps = [view for view in _views(plan) for _ in range(plan.reference_frames)]
    options = {"photons": plan.reference_photons, "denoise": False}
    light = _rendered(still, plan.size, backend, steps, options, REFERENCE_SEED)[0]
    by_view = light.reshape(plan.reference_views, plan.reference_frames, *light.shape[1:])
    return np.stack([by_view[:, half::2].mean(axis=1) for half in (0, 1)])


def _rmse(halves: FloatArray, frames: FloatArray) -> float:
    first, second = (np.concatenate(half) for half in halves)
    return metrics.relative_rmse(first, np.concatenate(frames), other_half=second)
