"""From a scene to a frame: analyse, declare, compile the graph, run it, read the result back."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from glcaustics.caustics.ignored import ignored_parts, ignored_words
from glcaustics.caustics.method import IRRADIANCE, NOISY_IRRADIANCE, QUALITIES, CausticsMethod
from glcaustics.caustics.registry import AUTO, NONE, pick
from glcaustics.denoise import svgf
from glcaustics.errors import UsageError
from glcaustics.gpu import Device, create_device
from glcaustics.graph import FrameGraph, Plan
from glcaustics.passes import depth_chain, gbuffer, lighting, refraction, rsm, shadow_map, taa, tonemap
from glcaustics.passes.eye_medium import EyeMediumFinder
from glcaustics.passes.frame import CameraState, FrameSetup, FrameState
from glcaustics.passes.geometry import GpuScene
from glcaustics.passes.runner import PlanRunner
from glcaustics.scene.model import Camera, LightKind, OpticalKind, Scene

AOVS: dict[str, str] = {
    "image": "linear radiance of the picture, cd/m^2 or W/(m^2 sr)",
    "caustic_irradiance": "E_c at the first non-specular surface on the eye's path, lux or W/m^2",
    "direct_irradiance": "irradiance by direct light at the opaque layer, lux or W/m^2",
    "depth_m": "distance along the view axis of the first surface, metres; 0 where there is none",
    "normal_ws": "normal of the first surface, towards the eye, world space",
    "position_ws": "position of the first surface, metres, world space",
    "albedo": "base colour of the opaque layer, linear",
    "solve_status": "eye ray: 0 opaque, 1 solved by Newton's method, 2 sky, 3 fallback by estimate (Sousa 2005), "
    "4 total internal reflection, 5 solved by marching, 6 leaves the picture, 7 hidden behind something, 8 solved in "
    "the second depth layer",
    "solve_hit": "where the eye ray was solved: uv (origin at the bottom left), and the solver's error in pixels",
    "solve_iterations": "texel look-ups of the eye ray's solver",
}

BASE_LADDER: dict[str, dict[str, Any]] = {
    quality: {
        "shadow_size": shadow,
        "rsm_size": rsm_size,
        "refraction": solver,
        "refraction_iterations": iterations,
        "refraction_steps": steps,
        "reflection_steps": reflection,
        "reflection_history": False,
        "depth_layers": 1,
    }
    for quality, shadow, rsm_size, solver, iterations, steps, reflection in (
        ("draft", 512, 256, "newton", 3, 256, 24),
        ("low", 1024, 512, "cascade", 3, 1024, 32),
        ("medium", 1536, 1024, "cascade", 4, 4096, 48),
        ("high", 2048, 2048, "cascade", 6, 8192, 96),
        ("reference", 4096, 2048, "cascade", 8, 16384, 256),
    )
}


@dataclass(eq=False)
class Frame:
    """One rendered frame; arrays with row 0 on top.

    `image`: (H, W, 3) float32 linear radiance. `ldr`: (H, W, 3) uint8 sRGB. `aov`: name -> (H, W) or (H, W, 3) float32.
    `stats`: numbers for machines: per pass milliseconds and bytes, per solve iterations, converged, failed, lost flux.
    """

    image: npt.NDArray[np.float32]
    ldr: npt.NDArray[np.uint8]
    aov: dict[str, npt.NDArray[np.float32]]
    stats: dict[str, Any]

    def save(self, path: str | Path) -> None:
        """Write .png, .npz or .exr; see `glcaustics.output`."""
        from glcaustics.output import save_frame

        save_frame(path, image=self.image, ldr=self.ldr, aov=self.aov)


def resolve_options(method: type[CausticsMethod] | None, quality: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """The ladder's options with the user's on top.

    Raises:
        UsageError: unknown quality or option, or a value out of range.
    """
    if quality not in QUALITIES:
        raise UsageError(
            f"quality '{quality}' is unknown", where="--quality", remedy=f"use one of {', '.join(QUALITIES)}"
        )
    resolved: dict[str, Any] = dict(BASE_LADDER[quality])
    if method is not None:
        resolved |= {**getattr(method, "defaults", {}), **method.ladder[quality]}
        if method.noisy:
            resolved = {**svgf.DEFAULTS, **resolved}
    for name, value in options.items():
        if name not in resolved:
            raise UsageError(
                f"option '{name}' is unknown", where="--set", remedy=f"there are: {', '.join(sorted(resolved))}"
            )
        resolved[name] = {"true": True, "false": False}.get(value, value) if isinstance(value, str) else value
    for name, base in BASE_LADDER[quality].items():
        value = resolved[name]
        if name == "refraction":
            refraction.check_solver(value)
            continue
        if isinstance(base, bool):
            if not isinstance(value, bool):
                raise UsageError(f"option {name} is {value!r}", where="--set", remedy="use true or false")
            continue
        if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 16384:
            raise UsageError(
                f"option {name} is {value!r}", where="--set", remedy=f"give a whole number from 1, such as {base}"
            )
        if name == "depth_layers" and value > len(gbuffer.LAYERS):
            raise UsageError(f"option depth_layers is {value}", where="--set", remedy="use 1 or 2")
    if method is not None:
        method.validate(resolved)
        if method.noisy:
            svgf.check(resolved)
    return resolved


def _aov_resources(setup: FrameSetup, aovs: tuple[str, ...], specular: bool, caustics: bool) -> list[str]:
    """Graph resources that an AOV is read from."""
    resources = {
        "image": [],
        "caustic_irradiance": ([("view.caustic_irradiance" if specular else IRRADIANCE)] if caustics else []),
        "direct_irradiance": ["lighting.irradiance"],
        "depth_m": ["gbuffer.depth_m", *(["specular.depth_m"] if specular else [])],
        "normal_ws": ["gbuffer.normal_ws", *(["specular.depth_m", "specular.normal_ws"] if specular else [])],
        "position_ws": ["gbuffer.depth_m", *(["specular.depth_m"] if specular else [])],
        "albedo": ["gbuffer.albedo"],
        "solve_status": (["view.solve_status"] if specular else []),
        "solve_hit": (["view.solve"] if specular else []),
        "solve_iterations": (["view.solve"] if specular else []),
    }
    for name in aovs:
        if name not in resources:
            raise UsageError(f"AOV '{name}' is unknown", where="--aov", remedy=f"there are: {', '.join(AOVS)}")
    return [r for name in aovs for r in resources[name]]


@dataclass(eq=False)
class _Declared:
    graph: FrameGraph
    outputs: tuple[str, ...]
    radiance: str
    specular: bool


def _declare(
    setup: FrameSetup,
    method: CausticsMethod | None,
    aovs: tuple[str, ...],
    specular_view: bool,
    method_name: str,
    antialias: bool = False,
) -> _Declared:
    """The whole frame, before anything is culled."""
    graph = FrameGraph()
    specular = setup.has_specular and specular_view
    for light in setup.lights:
        shadow_map.declare(graph, setup, light)
        for with_specular in (False, True):
            rsm.declare(graph, setup, light, with_specular=with_specular)
    gbuffer.declare_opaque(graph, setup)
    depth_chain.declare(graph, setup)
    lighting.declare_lighting(graph, setup)
    caustics = _declare_caustics(graph, setup, method, method_name)
    lighting.declare_shade(graph, setup)
    why = "nothing in the scene is specular" if specular_view else "the eye is asked to look past specular surfaces"
    if specular:
        gbuffer.declare_specular(graph, setup)
        if OpticalKind.SOLID in setup.kinds():
            gbuffer.declare_back(graph, setup)
        else:
            graph.leave_out("gbuffer.specular_back", "nothing in the scene is a solid with two interfaces")
        _declare_second_layer(graph, setup, method)
        refraction.declare(graph, setup)
    else:
        for name in ("gbuffer2", "gbuffer.specular", "gbuffer.specular_back", "refraction"):
            graph.leave_out(name, why)
    radiance = "view.radiance" if specular else "shade.radiance"
    if antialias:
        taa.declare(graph, setup, radiance, specular=specular)
        radiance = taa.RADIANCE
    else:
        graph.leave_out("taa", taa.OFF)
    tonemap.declare(graph, setup, radiance)
    outputs = ("present.ldr", radiance, *_aov_resources(setup, aovs, specular, caustics))
    return _Declared(graph, tuple(dict.fromkeys(outputs)), radiance, specular)


def _declare_second_layer(graph: FrameGraph, setup: FrameSetup, method: CausticsMethod | None) -> None:
    """What stands behind the first opaque surfaces, shaded like these, for eye rays that end behind something."""
    if int(setup.options["depth_layers"]) < 2:
        graph.leave_out("gbuffer2", "one depth layer is asked for; --set depth_layers=2 shows what the first one hides")
        return
    gbuffer.declare_second(graph, setup)
    depth_chain.declare(graph, setup, gbuffer.SECOND)
    lighting.declare_lighting(graph, setup, gbuffer.SECOND)
    lighting.declare_shade(graph, setup, gbuffer.SECOND)
    if method is not None and not method.lights_second_layer and method.why_not(setup.scene) is None:
        graph.leave_out("caustics2", f"{method.name} brings caustics to the first depth layer alone")


def _declare_caustics(graph: FrameGraph, setup: FrameSetup, method: CausticsMethod | None, method_name: str) -> bool:
    if method is None:
        graph.leave_out("caustics", f"method {method_name}: light passes straight through water and glass")
        return False
    because = method.why_not(setup.scene)
    if because is None:
        method.declare(graph, setup)
        if method.noisy and setup.options["denoise"]:
            svgf.declare(graph, setup, NOISY_IRRADIANCE, IRRADIANCE, method.irradiance_desc(setup))
        return True
    method.leave_out(graph, setup, because)
    return False


def plan_frame(
    scene: Scene,
    size: tuple[int, int] = (1280, 720),
    method: str = AUTO,
    quality: str = "medium",
    aovs: tuple[str, ...] = (),
    *,
    specular_view: bool = True,
    options: Mapping[str, Any] | None = None,
) -> Plan:
    """The frame's plan without any GPU. The receivers' light views are then fitted to the receivers, not yet to the
    landing light.

    Raises:
        UsageError: unknown method, quality, AOV or option.
    """
    chosen = pick(_named(scene, method))
    setup = FrameSetup.analyse(
        scene, size, resolve_options(chosen, quality, options or {}), transmissive_shadows=chosen is not None
    )
    declared = _declare(setup, chosen() if chosen else None, aovs, specular_view, method)
    _, kept = declared.graph.compile(outputs=declared.outputs).kept()
    return declared.graph.compile(outputs=tuple(dict.fromkeys((*declared.outputs, *kept))))


def _named(scene: Scene, method: str) -> str:
    return scene.method if method == AUTO and scene.method else method


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
        options: single options on top of the ladder, see `glcaustics methods`.
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
        quality: str = "medium",
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
        self.method_name = _named(scene, method)
        self.quality = quality
        self.aovs = tuple(aovs)
        self.specular_view = specular_view
        if min(self.size) < 1:
            shown = "x".join(str(n) for n in self.size)
            raise UsageError(f"the picture's size is {shown}", where="size", remedy="give at least 1x1 pixels")
        self._keep = keep
        self._taa = taa
        self._target = target
        self._present: moderngl.Framebuffer | None = None
        if target is not None and target.size != self.size:
            shown = "x".join(str(n) for n in target.size)
            raise UsageError(
                f"the target framebuffer is {shown}, the picture {self.size[0]}x{self.size[1]}",
                remedy="make both the same size",
            )
        self._chosen = pick(self.method_name)
        resolved = resolve_options(self._chosen, quality, options or {})
        self._method = self._chosen() if self._chosen else None
        self._setup = FrameSetup.analyse(
            scene, self.size, resolved, transmissive_shadows=self._chosen is not None, seed=seed
        )
        self._setup.collect_stats = stats
        _aov_resources(self._setup, self.aovs, False, True)
        self.device: Device = create_device(backend, context, shader_root=shader_root)
        self.device.timing_enabled = stats
        self._ignored = ignored_parts(self._setup.instances(), scene.lights, self._chosen, specular_view=specular_view)
        self.announcements = [*scene.announcements, *self.device.announcements, *ignored_words(self._ignored)]
        self._gpu = GpuScene(self.device)
        self._time: float | None = None
        self._frames = 0
        self._drawn: CameraState | None = None
        self._eye = EyeMediumFinder()
        self._runner: PlanRunner | None = None
        self._declared: _Declared | None = None
        self._previous: tuple[CameraState, dict[str, Any]] | None = None

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
            self._gpu.release()
        self.device.close()

    @property
    def plan(self) -> Plan:
        """The compiled frame graph. Prepares the scene if no frame was rendered yet."""
        with self.device.guard_state():
            return self._prepared(0.0).plan

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

    def _average(self, first: Frame, time: float, samples: int) -> Frame:
        """The mean over shifted pictures; the 8-bit picture's is taken after tone mapping, so that highlights do not
        alias.
        """
        image, ldr = first.image.astype(np.float64), first.ldr.astype(np.float64)
        times_ms = [first.stats["frame_ms"]]
        for index in range(1, samples):
            jitter = (taa.halton(index, 2) - 0.5, taa.halton(index, 3) - 0.5)
            start = clock.perf_counter()
            self._draw(time, jitter)
            self.device.ctx.finish()
            times_ms.append(1e3 * (clock.perf_counter() - start))
            assert self._declared is not None
            image += self._read(self._declared.radiance, 3)
            ldr += self._read_bytes("present.ldr")
        first.stats |= {"frame_ms": float(np.median(times_ms)), "samples": samples}
        rounded = np.rint(ldr / samples).astype(np.uint8)
        return Frame((image / samples).astype(np.float32), rounded, first.aov, first.stats)

    def draw(self, time: float = 0.0) -> None:
        """Render one frame without reading anything back: what a window, a host engine or a benchmark calls."""
        with self.device.guard_state():
            self._draw(time)

    def _draw(self, time: float, jitter_px: tuple[float, float] = (0.0, 0.0)) -> PlanRunner:
        runner = self._prepared(time)
        if self._taa:
            jitter_px = taa.jitter_px(self._frames)
        frame = self._frame_state(time, jitter_px)
        runner.run(frame)
        self._frames += 1
        self._drawn = frame.camera
        # A shifted sample is no frame of its own: motion is counted from frame to frame.
        if self._taa or jitter_px == (0.0, 0.0):
            self._previous = (frame.camera, {i.instance.name: i.world_from_object for i in self._gpu.items})
        if self._target is not None:
            self._copy_to_target(runner)
        return runner

    def _render(self, time: float) -> Frame:
        self._prepared(time)
        self.device.ctx.finish()
        start = clock.perf_counter()
        runner = self._draw(time)
        self.device.ctx.finish()
        frame_ms = 1e3 * (clock.perf_counter() - start)
        assert self._declared is not None
        image = self._read(self._declared.radiance, 3)
        ldr = self._read_bytes("present.ldr")
        aov = {name: self._aov(name, image) for name in self.aovs}
        self.device.check_error("after the frame")
        return Frame(image, ldr, aov, self._stats(runner, time, frame_ms))

    def _prepared(self, time: float) -> PlanRunner:
        if self._runner is not None:
            return self._runner
        frame = self._frame_state(time)
        if self._method is not None and self._method.why_not(self.scene) is None:
            enabled, self.device.timing_enabled = self.device.timing_enabled, False
            self._method.prepare(self.device, self._setup, frame)
            self.device.timing_enabled = enabled
        self._declared = _declare(self._setup, self._method, self.aovs, self.specular_view, self.method_name, self._taa)
        outputs = self._declared.outputs
        if self._setup.collect_stats and self._method is not None:
            outputs = tuple(dict.fromkeys((*outputs, *self._method.stats_resources())))
        _, kept = self._declared.graph.compile(outputs=outputs).kept()
        plan = self._declared.graph.compile(outputs=tuple(dict.fromkeys((*outputs, *kept))))
        self._runner = PlanRunner(self.device, plan, self._setup, keep=self._keep)
        self._gpu.keep_previous = bool({"gbuffer.motion", "specular.motion"} & plan.slots.keys())
        return self._runner

    def _frame_state(self, time: float, jitter_px: tuple[float, float] = (0.0, 0.0)) -> FrameState:
        if time != self._time:
            self._gpu.update(self.scene.instances_at(time))
            self._time = time
        else:
            self._gpu.hold()
        boxes = np.stack([item.bounds_ws for item in self._gpu.items])
        view = self.scene.view_at(time)
        camera = CameraState.make(view, self.size, self._setup.scene_bounds_ws, jitter_px, boxes)
        before, transforms = self._previous or (camera, {})
        instances = [item.instance for item in self._gpu.items]
        medium = self._eye.find(instances, boxes, view.position_ws, self._gpu.version)
        return FrameState(
            time, camera, before, self._gpu, self._exposure(), transforms, self._frames, medium, self._drawn
        )

    def _exposure(self) -> float:
        """The scene's exposure, or one that shows a white surface in full light a stop above middle grey's."""
        if self.scene.exposure is not None:
            return self.scene.exposure
        centre = self._setup.bounds_ws.mean(axis=0)
        lux = 0.0
        for light in self.scene.lights:
            power = light.intensity * float(np.dot(light.color, (0.2126, 0.7152, 0.0722)))
            if light.kind is not LightKind.DIRECTIONAL:
                power /= max(float(np.sum((centre - np.asarray(light.position_ws)) ** 2)), 1e-30)
            lux += power
        sky = float(np.dot(self.scene.sky.zenith, (0.2126, 0.7152, 0.0722))) * np.pi
        return 1.3 * np.pi / max(lux + sky, 1e-30)

    def _copy_to_target(self, runner: PlanRunner) -> None:
        assert self._target is not None
        if self._present is None:
            self._present = self.device.framebuffer([runner.texture("present.ldr")], label="present")
        self.device.ctx.copy_framebuffer(self._target, self._present)

    # -- read-back ----------------------------------------------------------------------------------------------------

    def _read(self, resource: str, components: int) -> npt.NDArray[np.float32]:
        assert self._runner is not None
        texture = self._runner.texture(resource)
        kind = {"f4": np.float32, "f2": np.float16}[texture.dtype]
        data = np.frombuffer(texture.read(), kind).reshape(texture.height, texture.width, texture.components)
        flipped = np.ascontiguousarray(data[::-1, :, :components], np.float32)
        return flipped[..., 0] if components == 1 else flipped

    def _read_bytes(self, resource: str) -> npt.NDArray[np.uint8]:
        assert self._runner is not None
        texture = self._runner.texture(resource)
        data = np.frombuffer(texture.read(), np.uint8).reshape(texture.height, texture.width, 4)
        return np.ascontiguousarray(data[::-1, :, :3])

    def _aov(self, name: str, image: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        assert self._runner is not None and self._declared is not None
        plan, specular = self._runner.plan, self._declared.specular
        height, width = self.size[1], self.size[0]
        if name == "image":
            return image
        if name == "caustic_irradiance":
            resource = "view.caustic_irradiance" if specular else IRRADIANCE
            return self._read(resource, 3) if resource in plan.slots else np.zeros((height, width, 3), np.float32)
        if name == "direct_irradiance":
            return self._read("lighting.irradiance", 3)
        if name == "albedo":
            return self._read("gbuffer.albedo", 3)
        if name == "solve_status":
            return self._read("view.solve_status", 1) if specular else np.zeros((height, width), np.float32)
        if name in ("solve_hit", "solve_iterations"):
            solve = self._read("view.solve", 4) if specular else np.zeros((height, width, 4), np.float32)
            return solve[..., :3] if name == "solve_hit" else solve[..., 3]
        if name == "normal_ws":
            normal = self._read("gbuffer.normal_ws", 3)
            if specular:
                normal = np.where(
                    self._read("specular.depth_m", 1)[..., None] > 0, self._read("specular.normal_ws", 3), normal
                )
            return normal
        depth = self._read("gbuffer.depth_m", 1)
        if specular:
            front = self._read("specular.depth_m", 1)
            depth = np.where(front > 0, front, depth)
        return depth if name == "depth_m" else self._positions(depth)

    def _positions(self, depth_m: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        assert self._previous is not None
        camera = self._previous[0]
        height, width = depth_m.shape
        x = (((np.arange(width) + 0.5) / width - camera.jitter_uv[0]) * 2 - 1) * camera.lens[0]
        y = (1 - ((np.arange(height) + 0.5) / height + camera.jitter_uv[1]) * 2) * camera.lens[1]
        scale = np.ones_like(depth_m, np.float64) if camera.orthographic else depth_m.astype(np.float64)
        view = np.stack([x[None, :] * scale, y[:, None] * scale, -depth_m.astype(np.float64)], axis=2)
        m = camera.world_from_camera
        world = view @ m[:3, :3].T + m[:3, 3]
        return np.where(depth_m[..., None] > 0, world, 0.0).astype(np.float32)

    def _stats(self, runner: PlanRunner, time: float, frame_ms: float) -> dict[str, Any]:
        timings = self.device.finish_timings() if self.device.timing_enabled else {}
        written = runner.step_bytes()
        solves = self._method.solve_stats(runner) if self._method is not None and self._setup.collect_stats else []
        flux = sum(s["flux"] for s in solves)
        return {
            "scene": self.scene.name,
            "method": self.method_name if self.method_name != AUTO else (self._method.name if self._method else NONE),
            "quality": self.quality,
            "size": list(self.size),
            "time_s": time,
            "samples": 1,
            "seed": self._setup.seed,
            "options": self.options,
            "backend": self.device.backend,
            "renderer": self.device.info["renderer"],
            "eye_medium": self._eye.found.words if self._eye.found is not None else None,
            "timer": self.device.timer_kind,
            "frame_ms": frame_ms,
            "passes": [
                {
                    "name": s.name,
                    "ms": 0.0 if s.name in runner.skipped else timings.get(s.name),
                    "bytes": written[s.name],
                    "kept": s.name in runner.skipped,
                }
                for s in runner.plan.steps
            ],
            "left_out": [{"name": item.name, "because": item.because} for item in runner.plan.left_out],
            "bytes_allocated": runner.plan.bytes_allocated,
            "bytes_without_aliasing": runner.plan.bytes_without_aliasing,
            "bytes_without_culling": runner.plan.bytes_without_culling,
            "ignored": self._ignored,
            "solves": solves,
            "lost_flux": sum(s["flux_lost"] for s in solves) / flux if flux > 0 else None,
        }
