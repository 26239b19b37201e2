"""Measurements of photon_trace: frames of a static view, the picture with the truth in it, the cost of its stages."""

from __future__ import annotations

import statistics
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.given import given_irradiance
from glcaustics.optics.pixels import box_filter
from glcaustics.renderer import Renderer
from glcaustics.scene.model import Scene

FloatArray = npt.NDArray[np.float64]
METHOD, QUALITY = "photon_trace", "medium"
KEPT_FRAMES = (1, 2, 4, 8, 16)
STAGES = {  # of the paper's table, by the passes' names; a pass belongs to the first stage that knows it
    "storing": ("photon_trace.scatter",),
    "tracing": ("photon_trace.",),
    "denoising": ("svgf.",),
    "buffers": ("caster_view", "caster_back", "receiver_view", "depth_chain"),
}
REFLECTED = "photon_trace.trace.reflect"  # of the tracing, what reflected photons take: these march the longest
MARCHES = ("hierarchical", "dda")
VIEW_STEPS = 4096  # for both: pixel by pixel, a photon may have to cross the whole picture


def photon_options(photons: int, view_size: int, **more: Any) -> dict[str, Any]:
    """Options on top of QUALITY: photons a frame, and texels a side of both of the light's views."""
    return {"photons": photons, "caster_size": view_size, "map_size": view_size, **more}


def static_frames(
    scene: Scene, side: int, filtered: int, frames: int, options: Mapping[str, Any], backend: str
) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Irradiance at the receivers of a square picture, box-filtered, after some of the frames of a still.

    Returns:
        `frame_ms`, `processor_ms`: medians of the frames after the first, wall clock to `finish` and all threads'
        processor time; `gl_renderer`. Arrays: "frame N" (filtered, filtered, 3) float32, N of KEPT_FRAMES; "last"
        (side, side, 3).
    """
    wall, cpu, arrays = [], [], {}
    with Renderer(
        scene,
        (side, side),
        METHOD,
        QUALITY,
        backend,
        aovs=("caustic_irradiance",),
        specular_view=False,
        options=options,
        stats=False,
        keep=False,
    ) as renderer:
        for number in range(1, frames + 1):
            renderer.device.ctx.finish()
            start = time.perf_counter(), time.process_time()
            if number in KEPT_FRAMES or number == frames:
                image = renderer.render().aov["caustic_irradiance"]
                arrays[f"frame {number}"] = box_filter(image, (filtered, filtered)).astype(np.float32)
                arrays["last"] = image
                continue
            renderer.draw()
            renderer.device.ctx.finish()
            wall.append(1e3 * (time.perf_counter() - start[0]))
            cpu.append(1e3 * (time.process_time() - start[1]))
        name = renderer.device.info["renderer"]
    times = {"frame_ms": statistics.median(wall), "processor_ms": statistics.median(cpu)}
    return times | {"frames": frames, "gl_renderer": name, "options": dict(options)}, arrays


def picture_with(scene: Scene, irradiance: npt.NDArray[np.floating], backend: str) -> npt.NDArray[np.uint8]:
    """(H, W, 3) sRGB, water and all as the eye sees it, with a given caustic irradiance (H, W, 3) at the receivers.

    With a method's own irradiance it is that method's picture, bit for bit: all else is the renderer's.
    """
    size = (irradiance.shape[1], irradiance.shape[0])
    with (
        given_irradiance(irradiance.astype(np.float32)) as method,
        Renderer(scene, size, method, QUALITY, backend, stats=False) as renderer,
    ):
        renderer.draw()  # reflections seen in water are seeded with the frame before
        return renderer.render().ldr


def stage_table(
    scene: Scene, size: tuple[int, int], photons: Sequence[int], view_size: int, frames: int, backend: str
) -> list[dict[str, Any]]:
    """Milliseconds of STAGES as Meenrattanakorn, Lambers 2022 list them, photons by marches; frames in turn.

    `clock`: on a software renderer all threads' processor time, so that a busy machine hardly matters.
    `same_hits`: see there.
    """
    found = []
    for count in photons:
        samples: dict[str, dict[str, list[float]]] = {march: {} for march in MARCHES}
        landings: dict[str, list[FloatArray]] = {}
        with _renderer(scene, size, _marched(count, view_size, MARCHES[0]), backend) as ours:
            with _renderer(scene, size, _marched(count, view_size, MARCHES[1]), backend) as theirs:
                both = dict(zip(MARCHES, (ours, theirs), strict=True))
                for number in range(frames + 1):
                    for march, renderer in both.items():
                        renderer.device.make_current()
                        renderer.draw()
                        timings = renderer.device.finish_timings()
                        if number == 0:  # compiles; later photons follow what those before them brought
                            landings[march] = _landings(renderer)
                            continue
                        for stage, value in stages_of(timings).items():
                            samples[march].setdefault(stage, []).append(value)
                clock = "processor time" if ours.device.is_software else ours.device.timer_kind
                theirs.device.make_current()
            ours.device.make_current()
        for march in MARCHES:
            median = {stage: statistics.median(values) for stage, values in samples[march].items()}
            row = {"photons": count, "march": march, "ms": median, "clock": clock, "size": list(size)}
            found.append(row | {"view_size": view_size, "frames": frames})
        found[-2]["same_hits"] = same_hits(landings[MARCHES[0]], landings[MARCHES[1]])
    return found


def _marched(photons: int, view_size: int, march: str) -> dict[str, Any]:
    return photon_options(photons, view_size, march=march, view_steps=VIEW_STEPS)


def _renderer(scene: Scene, size: tuple[int, int], options: Mapping[str, Any], backend: str) -> Renderer:
    made = Renderer(scene, size, METHOD, QUALITY, backend, specular_view=False, options=options, stats=True, keep=False)
    if made.device.is_software:
        made.device.count_processor_time()
    return made


def stages_of(timings: Mapping[str, float]) -> dict[str, float]:
    """Sum of the passes' times by stage, and `reflected` of the tracing; "a/b" is in "a" already."""
    found = dict.fromkeys((*STAGES, "reflected"), 0.0)
    for name, ms in timings.items():
        stage = next((stage for stage, prefixes in STAGES.items() if name.startswith(prefixes)), None)
        if stage is not None and "/" not in name:
            found[stage] += ms
            found["reflected"] += ms if name.startswith(REFLECTED) else 0.0
    return found


def _landings(renderer: Renderer) -> list[FloatArray]:
    """(H, W, 4) of each kind of path: pixel, inverse area, status of every photon of the frame before."""
    runner = renderer._runner
    assert runner is not None
    return [runner.read(name).astype(float) for name in sorted(runner.plan.slots) if "landing_px" in name]


def same_hits(ours: Sequence[FloatArray], exact: Sequence[FloatArray]) -> dict[str, float]:
    """`share` of the photons that land by the exact march which ours lands within one pixel of it; `photons` of them.

    `marched`: the same of those alone that only the camera's view could land (status 2).
    """
    near, landed, near_marched, marched = 0, 0, 0, 0
    for a, b in zip(ours, exact, strict=True):
        there = np.isin(np.rint(b[..., 3]), (1, 2))
        close = there & np.isin(np.rint(a[..., 3]), (1, 2))
        close &= (np.abs(np.floor(a[..., :2]) - np.floor(b[..., :2])) <= 1.0).all(axis=-1)
        by_eye = there & (np.rint(b[..., 3]) == 2)
        near, landed = near + int(close.sum()), landed + int(there.sum())
        near_marched, marched = near_marched + int((close & by_eye).sum()), marched + int(by_eye.sum())
    return {
        "share": near / max(landed, 1),
        "photons": landed,
        "marched": near_marched / max(marched, 1),
        "marched_photons": marched,
    }
