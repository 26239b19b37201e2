"""One measurement: a scene by one method at one quality and size: its run time, its passes, its error."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics import metrics
from glcaustics.bench.mitsuba_truth import Halves
from glcaustics.bench.targets import Target, luminance
from glcaustics.caustics.registry import METHODS
from glcaustics.errors import UsageError
from glcaustics.optics.pixels import box_filter
from glcaustics.renderer import Renderer
from glcaustics.scene.load import load_scene
from glcaustics.scene.model import Scene

FloatArray = npt.NDArray[np.float64]
SINGULAR = 20.0  # times the mean: brighter pixels lie on foci, where irradiance has no bound but the pixel's size
WHITE = 4.0  # times the mean irradiance is shown as white where pictures are compared


@dataclass(frozen=True)
class Timing:
    """How long to measure: at least `least` frames, then until `budget_s` is spent or `most` are done."""

    least: int = 3
    most: int = 15
    budget_s: float = 2.0

    def run(self, once: Callable[[], float]) -> list[float]:
        """Milliseconds of each call, as `once` returns them."""
        start = time.perf_counter()
        values: list[float] = []
        while len(values) < self.least or (len(values) < self.most and time.perf_counter() - start < self.budget_s):
            values.append(once())
        return values


@dataclass(frozen=True, eq=False)
class Case:
    """What is rendered. `options`: on top of the quality's. `frames`: of a still, of which the last one is judged."""

    scene: Scene
    target: Target
    method: str
    quality: str
    pixels: int
    backend: str = "auto"
    options: Mapping[str, Any] = field(default_factory=dict)
    frames: int = 1


def summary(values: list[float], kind: str) -> dict[str, Any]:
    """Median, least and most of the values, ms, and what clock they are by."""
    return {
        "median": statistics.median(values),
        "min": min(values),
        "max": max(values),
        "runs": len(values),
        "clock": kind,
    }


def same_paths(case: Case) -> dict[str, Any]:
    """Options by which a method follows the truth's paths: two interfaces of a solid, no reflection inside."""
    method = METHODS.get(case.method)
    if method is not None and case.target.interfaces == 2 and "internal_bounces" in method.ladder[case.quality]:
        return {"internal_bounces": 0}
    return {}


def measure(case: Case, timing: Timing) -> tuple[dict[str, Any], FloatArray]:
    """A row of the report without its errors, and the irradiance (P, P), luminance, at the target.

    The first frame (set-up, shader compilation) is a warm-up and told apart. On a software renderer a frame's time is
    the wall clock up to `finish`; on a GPU the sum of its passes' timer queries. `time_ms` is of one frame: the image
    has taken `frames` of them.
    """
    begin = time.perf_counter()
    renderer = Renderer(
        replace(case.scene, camera=case.target.camera(), camera_at=None),
        size=(case.pixels, case.pixels),
        method=case.method,
        quality=case.quality,
        backend=case.backend,
        aovs=("caustic_irradiance",),
        specular_view=False,
        options={**same_paths(case), **case.options},
        keep=False,
    )
    with renderer:
        frame = renderer.render()
        first_ms = 1e3 * (time.perf_counter() - begin)
        if case.frames > 1:
            for _ in range(case.frames - 2):
                renderer.draw()
            frame = renderer.render()
        image = luminance(frame.aov["caustic_irradiance"])
        values = timing.run(lambda: frame_ms(renderer))
        times = {"time_ms": summary(values, renderer.device.timer_kind), "first_frame_ms": first_ms}
        return _row(case, renderer.render().stats, times), image


_FROM_STATS = ("passes", "bytes_allocated", "bytes_without_aliasing", "bytes_without_culling", "lost_flux")


def _row(case: Case, stats: Mapping[str, Any], times: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "scene": case.scene.name,
        "tool": "glcaustics",
        "method": case.method,
        "quality": case.quality,
        "pixels": case.pixels,
        "options": stats["options"],
        "overrides": dict(case.options),
        "frames": case.frames,
        **times,
        **{name: stats[name] for name in _FROM_STATS},
        "rays": sum(s["rays"] for s in stats["solves"]),
        "backend": stats["backend"],
        "gl_renderer": stats["renderer"],
    }


def picture(
    name: str,
    method: str,
    quality: str,
    backend: str,
    size: tuple[int, int] = (480, 270),
    samples: int = 1,
    frames: int = 1,
) -> npt.NDArray[np.uint8]:
    """The built-in scene as its own camera sees it, absorption and all: (H, W, 3) uint8, sRGB.

    Args:
        samples: a pixel. frames: of a still, so that a noisy method has settled.
    """
    with Renderer(load_scene(name), size=size, method=method, quality=quality, backend=backend, stats=False) as made:
        for _ in range(frames - 1):
            made.draw()
        return made.render(samples=samples).ldr


def frame_ms(renderer: Renderer) -> float:
    """One more frame: wall clock up to `finish` on a software renderer, else the sum of its timer queries."""
    device = renderer.device
    device.timing_enabled = not device.is_software
    device.ctx.finish()
    start = time.perf_counter()
    renderer.draw()
    device.ctx.finish()
    wall_ms = 1e3 * (time.perf_counter() - start)
    device.timing_enabled = True
    return wall_ms if device.is_software else sum(device.finish_timings().values())


def reduced(halves: Halves, pixels: int) -> Halves:
    """The same truth at a size that divides its own."""
    size = (pixels, pixels)
    return replace(halves, first=box_filter(halves.first, size), second=box_filter(halves.second, size))


def regular(reference: FloatArray) -> npt.NDArray[np.bool_]:
    """(H, W): pixels away from foci, whose few pixels can own the whole RMSE; their neighbours are left out too."""
    bright = np.pad(reference > SINGULAR * reference.mean(), 1)
    height, width = reference.shape
    near = [bright[i : i + height, j : j + width] for i in range(3) for j in range(3)]
    return ~np.any(near, axis=0)


def errors(truth: Halves, image: FloatArray) -> dict[str, Any]:
    """Error measures of an irradiance map; `rrmse` has the truth's own noise taken off.

    `rrmse_regular`: the same over `regular` pixels alone, relative to their mean. A map with values that are not
    finite gets their share and nothing else.
    """
    share = metrics.non_finite_share(image)
    if share > 0.0:
        return {"non_finite": share}
    mean = truth.mean
    return {
        "rrmse": metrics.relative_rmse(truth.first, image, other_half=truth.second),
        "rrmse_regular": metrics.relative_rmse(truth.first, image, other_half=truth.second, mask=regular(mean)),
        "mae": metrics.mean_absolute_error(mean, image),
        "bias": metrics.bias_of_mean(mean, image),
        "psnr_db": metrics.psnr(mean, image, peak=WHITE * float(mean.mean())),
        "flip": _flip(mean, image),
        "non_finite": 0.0,
    }


def display(image: npt.ArrayLike, mean: float) -> FloatArray:
    """Irradiance as a picture in [0, 1], sRGB encoded; white is `WHITE` times the mean."""
    linear = np.clip(np.asarray(image, np.float64) / (WHITE * mean), 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _flip(reference: FloatArray, image: FloatArray) -> float | None:
    """Mean LDR-FLIP of the pictures that `display` makes; None without the package."""
    mean = float(reference.mean())
    return flip_of(*(np.repeat(display(x, mean)[..., None], 3, axis=2) for x in (reference, image)))


def flip_of(reference: FloatArray, picture: FloatArray) -> float | None:
    """Mean LDR-FLIP of a picture (H, W, 3), sRGB encoded, in [0, 1]; None without the package."""
    try:
        return metrics.flip(reference.astype(np.float32), picture.astype(np.float32), hdr=False).mean
    except UsageError as error:
        if "flip-evaluator" in error.what:
            return None
        raise
