"""What the eye rays' passes cost, in full-screen fetch passes measured in the same run."""

from __future__ import annotations

import statistics
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np

from glcaustics.gpu import Device
from glcaustics.renderer import Renderer
from glcaustics.scene.model import Camera, Scene

_PARTS = ("depth_chain.4", "depth_chain.levels", "depth_chain.near", "refraction")
_STAGES = ("opaque", "first", "mask", "finish")


def eye_cost(
    scene: Scene,
    camera: Camera,
    size: tuple[int, int] = (1280, 720),
    solvers: tuple[str, ...] = ("cascade", "newton", "hierarchical", "dda", "sousa"),
    rounds: int = 5,
    reflections: bool = True,
    **renderer: Any,
) -> dict[str, dict[str, float]]:
    """Median cost of every solver's passes, by solver: `total` and the parts of it.

    Unit: one full-screen rgba32f fetch into rgba32f at the same size (`texelFetch` of the own pixel). The solvers take
    turns, so that a busy moment hits them alike, and a software renderer's time is the process's, all threads, so that
    other processes hardly enter. `reflections` False: their marches end after one step.
    `renderer`: further arguments of `Renderer`, such as `backend`.
    """
    still = replace(scene, camera=camera, camera_at=None)
    steps = {"refraction_steps": 16384, **({} if reflections else {"reflection_steps": 1})}
    samples: dict[str, dict[str, list[float]]] = {solver: {} for solver in solvers}
    fetches: list[float] = []
    with ExitStack() as stack:
        made = {
            solver: stack.enter_context(
                Renderer(still, size, "none", stats=True, options={"refraction": solver, **steps}, **renderer)
            )
            for solver in solvers
        }
        units = {}
        for solver, each in made.items():
            each.device.make_current()
            each.device.count_processor_time()
            units[solver] = _FetchPass(each.device, size)
            stack.callback(units[solver].release)
        for index in range(rounds + 1):  # the first one compiles and uploads
            for solver, each in made.items():
                each.device.make_current()
                each.draw()
                timings = each.device.finish_timings()
                fetch = units[solver].milliseconds()
                if index == 0:
                    continue
                fetches.append(fetch)
                for name in (*_PARTS, *(f"refraction/{stage}" for stage in _STAGES)):
                    if name in timings:
                        samples[solver].setdefault(name, []).append(timings[name])
    unit = statistics.median(fetches)
    costs = {}
    for solver, parts in samples.items():
        found = {name: statistics.median(values) / unit for name, values in parts.items()}
        costs[solver] = {"total": sum(found.get(name, 0.0) for name in _PARTS), **found}
    return costs


class _FetchPass:
    """The unit of cost: one full-screen pass that copies its own pixel of a texture that holds data."""

    def __init__(self, device: Device, size: tuple[int, int]) -> None:
        ones = np.ones((size[1], size[0], 4), np.float32)
        self._source = device.texture(size, "rgba32f", data=ones, label="eye_cost.source")
        self._target = device.texture(size, "rgba32f", label="eye_cost.target")
        self._framebuffer = device.framebuffer([self._target])
        self._device = device
        self.milliseconds()  # touches the memory

    def milliseconds(self) -> float:
        program = self._device.program("passes/refraction/fetch").set(t_source=self._source)
        with self._device.timer("eye_cost/fetch"):
            self._device.draw_fullscreen(program, self._framebuffer)
        return self._device.finish_timings()["eye_cost/fetch"]

    def release(self) -> None:
        self._device.make_current()
        self._device.release_framebuffers([self._framebuffer])
        self._source.release()
        self._target.release()
