"""The renderer: owns the device, the compiled plan and its textures, and draws frame after frame."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from glcaustics.caustics.ignored import ignored_parts, ignored_words
from glcaustics.caustics.registry import AUTO, NONE, pick
from glcaustics.errors import UsageError
from glcaustics.gpu import Device, create_device
from glcaustics.graph import Plan
from glcaustics.passes import taa
from glcaustics.passes.frame import FrameSetup
from glcaustics.passes.runner import PlanRunner
from glcaustics.quality import DEFAULT_QUALITY
from glcaustics.renderer.aov import AovReader, aov_resources
from glcaustics.renderer.declare import DeclaredFrame, declare_frame, named_method
from glcaustics.renderer.frame import Frame
from glcaustics.renderer.options import resolve_options
from glcaustics.renderer.readback import read_floats, read_rgb8
from glcaustics.renderer.sequence import FrameSequence
from glcaustics.renderer.stats import plan_stats, solve_stats
from glcaustics.scene.model import Camera, Scene

PICTURE = "present.ldr"  # what `Frame.ldr` is read from and a host's target gets


class Renderer:
    """Renders one scene.

    Args:
        scene: see `glcaustics.load_scene`.
        size: width, height in pixels.
        method: name of a caustics method, "auto", or "none".
        quality: a step of the ladder, "draft" to "reference".
        backend: "auto", "egl", "osmesa" or "glfw"; not used with `context`.
        context: a host's moderngl context; its state is as it was after every call.
        target: a host's framebuffer of the same size that the 8-bit picture is copied to.
        aovs: names of `AOVS` to deliver.
        specular_view: whether the eye sees specular surfaces; without, AOVs are those of the receivers behind them.
        seed: of everything random.
        options: single options on top of the ladder, see `glcaustics methods NAME`.
        stats: read solves back and count them.
        taa: anti-aliasing over time: the camera is shifted by parts of a pixel from frame to frame, and `image` and
            `ldr` are means over the last frames, followed along the motion. AOVs are those of the shifted frame.
        keep: draw what the camera does not enter (shadow maps, caustic maps) anew only when the scene has moved;
            off, every frame pays for all of it, as the benchmarks want.
        shader_root: another folder of shaders than the project's own, for tests.

    Raises:
        UsageError, SceneError, DeviceError, ResourceLimitError: one line each.
    """

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int] = (1280, 720),
        method: str = AUTO,
        quality: str = DEFAULT_QUALITY,
        backend: str = "auto",
        *,
        context: moderngl.Context | None = None,
        target: moderngl.Framebuffer | None = None,
        aovs: tuple[str, ...] = (),
        specular_view: bool = True,
        seed: int = 0,
        options: Mapping[str, Any] | None = None,
        stats: bool = True,
        taa: bool = False,
        keep: bool = True,
        shader_root: Path | None = None,
    ) -> None:
        self.scene = scene
        self.size = (int(size[0]), int(size[1]))
        self.method_name = named_method(scene, method)
        self.quality = quality
        self.aovs = tuple(aovs)
        self.specular_view = specular_view
        self._keep, self._taa, self._target = keep, taa, target
        _check_size(self.size, target)
        aov_resources(self.aovs, specular=False, caustics=True)  # refuse an unknown one before any work is done
        chosen = pick(self.method_name)
        resolved = resolve_options(chosen, quality, options or {})
        self._method = chosen() if chosen else None
        self._setup = FrameSetup.analyse(scene, self.size, resolved, transmissive_shadows=chosen is not None, seed=seed)
        self._setup.collect_stats = stats
        self.device: Device = create_device(backend, context, shader_root=shader_root)
        self.device.timing_enabled = stats
        self._ignored = ignored_parts(self._setup.instances(), scene.lights, chosen, specular_view=specular_view)
        self.announcements = [*scene.announcements, *self.device.announcements, *ignored_words(self._ignored)]
        self._sequence = FrameSequence(self.device, self._setup)
        self._present: moderngl.Framebuffer | None = None
        self._runner: PlanRunner | None = None
        self._declared: DeclaredFrame | None = None

    # -- life ---------------------------------------------------------------------------------------------------------

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give all GPU memory back, and the context unless it is the host's."""
        if self.device.closed:
            return
        with self.device.guard_state():
            if self._present is not None:
                self.device.release_framebuffers([self._present])
            if self._runner is not None:
                self._runner.release()
            self._sequence.gpu.release()
        self.device.close()

    @property
    def plan(self) -> Plan:
        """The compiled frame graph. Prepares the scene if no frame was rendered yet."""
        with self.device.guard_state():
            return self._prepared(0.0)[0].plan

    @property
    def options(self) -> dict[str, Any]:
        """The options in force."""
        return dict(self._setup.options)

    def tune(self, *, camera: Camera | None = None, **counts: int) -> None:
        """Another camera, and other counts that shaders take as they come (iterations, steps), from the next frame on.

        For instruments that compare counts without building everything anew. Counts that size a texture or choose a
        shader do not belong here; 0 iterations are allowed: the solvers' start.

        Raises:
            UsageError: not an option in force, or a negative count.
        """
        for name, count in counts.items():
            if name not in self._setup.options or isinstance(count, bool) or count < 0:
                remedy = f"give a count from 0 for one of: {', '.join(sorted(self._setup.options))}"
                raise UsageError(f"option {name} cannot be tuned to {count!r}", where="tune", remedy=remedy)
        self._setup.options = {**self._setup.options, **counts}
        if camera is not None:
            self.scene = replace(self.scene, camera=camera, camera_at=None)

    # -- frames -------------------------------------------------------------------------------------------------------

    def render(self, time: float = 0.0, samples: int = 1) -> Frame:
        """Render one frame.

        Args:
            time: seconds; waters and camera paths move with it.
            samples: pictures with the camera shifted by parts of a pixel, averaged (anti-aliasing). AOVs are those of
                the first, unshifted one; `stats["frame_ms"]` is the median over the samples.

        Raises:
            UsageError: samples below 1, or several with `taa`.
        """
        if samples < 1:
            raise UsageError(f"{samples} samples a pixel", where="samples", remedy="give at least 1")
        if samples > 1 and self._taa:
            raise UsageError(f"{samples} samples a pixel with taa", where="samples", remedy="use one of the two")
        with self.device.guard_state():
            frame = self._render(time)
            return frame if samples == 1 else self._average(frame, time, samples)

    def draw(self, time: float = 0.0) -> None:
        """Render one frame without reading anything back: what a window, a host engine or a benchmark calls."""
        with self.device.guard_state():
            self._draw(time)

    def _average(self, first: Frame, time: float, samples: int) -> Frame:
        """The mean over shifted pictures; the 8-bit picture's is taken after tone mapping, so that highlights do not
        alias.
        """
        runner, declared = self._prepared(time)
        image, ldr = first.image.astype(np.float64), first.ldr.astype(np.float64)
        times_ms = [first.stats["frame_ms"]]
        for index in range(1, samples):
            times_ms.append(self._timed_draw(time, (taa.halton(index, 2) - 0.5, taa.halton(index, 3) - 0.5)))
            image += read_floats(runner, declared.radiance, 3)
            ldr += read_rgb8(runner, PICTURE)
        first.stats |= {"frame_ms": float(np.median(times_ms)), "samples": samples}
        rounded = np.rint(ldr / samples).astype(np.uint8)
        return Frame((image / samples).astype(np.float32), rounded, first.aov, first.stats)

    def _render(self, time: float) -> Frame:
        runner, declared = self._prepared(time)
        self.device.ctx.finish()
        frame_ms = self._timed_draw(time)
        image = read_floats(runner, declared.radiance, 3)
        ldr = read_rgb8(runner, PICTURE)
        assert self._sequence.drawn is not None
        aovs = AovReader(runner, self._sequence.drawn, image, specular=declared.specular)
        aov = {name: aovs.read(name) for name in self.aovs}
        self.device.check_error("after the frame")
        return Frame(image, ldr, aov, self._stats(runner, time, frame_ms))

    def _timed_draw(self, time: float, jitter_px: tuple[float, float] = (0.0, 0.0)) -> float:
        """Milliseconds on the wall clock until all of the frame is drawn."""
        start = clock.perf_counter()
        self._draw(time, jitter_px)
        self.device.ctx.finish()
        return 1e3 * (clock.perf_counter() - start)

    def _draw(self, time: float, jitter_px: tuple[float, float] = (0.0, 0.0)) -> None:
        runner, _ = self._prepared(time)
        if self._taa:
            jitter_px = taa.jitter_px(self._sequence.pictures)
        frame = self._sequence.state(self.scene, time, jitter_px)
        runner.run(frame)
        self._sequence.remember(frame, as_frame=self._taa or jitter_px == (0.0, 0.0))
        if self._target is not None:
            if self._present is None:
                self._present = self.device.framebuffer([runner.texture(PICTURE)], label="present")
            self.device.ctx.copy_framebuffer(self._target, self._present)

    def _prepared(self, time: float) -> tuple[PlanRunner, DeclaredFrame]:
        """Compiles the plan and allocates its textures, once, with the method's light views fitted at `time`."""
        if self._runner is not None and self._declared is not None:
            return self._runner, self._declared
        frame = self._sequence.state(self.scene, time)
        if self._method is not None and self._method.why_not(self.scene) is None:
            enabled, self.device.timing_enabled = self.device.timing_enabled, False
            self._method.prepare(self.device, self._setup, frame)
            self.device.timing_enabled = enabled
        self._declared = declare_frame(
            self._setup,
            self._method,
            self.method_name,
            aovs=self.aovs,
            specular_view=self.specular_view,
            antialias=self._taa,
        )
        counted = self._method.stats_resources() if self._method is not None and self._setup.collect_stats else ()
        plan = self._declared.compile(also=counted)
        self._runner = PlanRunner(self.device, plan, self._setup, keep=self._keep)
        self._sequence.gpu.keep_previous = bool({"gbuffer.motion", "specular.motion"} & plan.slots.keys())
        return self._runner, self._declared

    def _stats(self, runner: PlanRunner, time: float, frame_ms: float) -> dict[str, Any]:
        """`Frame.stats`."""
        timings = self.device.finish_timings() if self.device.timing_enabled else {}
        solves = self._method.solve_stats(runner) if self._method is not None and self._setup.collect_stats else []
        chosen = self._method.name if self._method is not None else NONE
        return {
            "scene": self.scene.name,
            "method": chosen if self.method_name == AUTO else self.method_name,
            "quality": self.quality,
            "size": list(self.size),
            "time_s": time,
            "samples": 1,
            "seed": self._setup.seed,
            "options": self.options,
            "backend": self.device.backend,
            "renderer": self.device.info["renderer"],
            "eye_medium": self._sequence.eye_medium,
            "timer": self.device.timer_kind,
            "frame_ms": frame_ms,
            **plan_stats(runner, timings),
            "ignored": self._ignored,
            **solve_stats(solves),
        }


def _check_size(size: tuple[int, int], target: moderngl.Framebuffer | None) -> None:
    shown = "x".join(str(n) for n in size)
    if min(size) < 1:
        raise UsageError(f"the picture's size is {shown}", where="size", remedy="give at least 1x1 pixels")
    if target is not None and target.size != size:
        given = "x".join(str(n) for n in target.size)
        raise UsageError(f"the target framebuffer is {given}, the picture {shown}", remedy="make both the same size")
