"""What the eye rays' passes cost, in full-screen fetch passes measured in the same run."""

from __future__ import annotations

import statistics
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

from glcaustics.renderer import Renderer
from glcaustics.scene.model import Camera, Scene

_PARTS = ("depth_chain.4", "depth_chain.levels", "refraction")
_STAGES = ("opaque", "first", "mask", "marching", "reflection")


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
        for each in made.values():
            each.device.count_processor_time()
        for index in range(rounds + 1):  # the first one compiles and uploads
            for solver, each in made.items():
                each.device.make_current()
                each.draw()
                timings = each.device.finish_timings()
                fetch = _fetch_pass_ms(each, size)
                if index == 0:
                    continue
                fetches.append(fetch)
                for name in (*_PARTS, *(f"refraction/{stage}" for stage in _STAGES)):
                    if name in timings:
                        samples[solver].setdefault(name, []).append(timings[name])
        for each in made.values():
            each.device.make_current()
    unit = statistics.median(fetches)
    costs = {}
    for solver, parts in samples.items():
        found = {name: statistics.median(values) / unit for name, values in parts.items()}
        costs[solver] = {"total": sum(found.get(name, 0.0) for name in _PARTS), **found}
    return costs


def _fetch_pass_ms(renderer: Renderer, size: tuple[int, int]) -> float:
    device = renderer.device
    source = device.texture(size, "rgba32f", label="eye_cost.source")
    target = device.texture(size, "rgba32f", label="eye_cost.target")
    framebuffer = device.framebuffer([target])
    program = device.program("passes/refraction/fetch").set(t_source=source)
    device.draw_fullscreen(program, framebuffer)  # touches the memory
    with device.timer("eye_cost/fetch"):
        device.draw_fullscreen(program, framebuffer)
    milliseconds = device.finish_timings()["eye_cost/fetch"]
    framebuffer.release()
    source.release()
    target.release()
    return milliseconds
