"""Whether variants of the eye rays' Newton solver pay: other sources of planes, curvature, filtering.

The solvers are `common/newton_variants.glsl`; here they run over the G-buffers of whole scenes, on equal rays.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.convergence import seeded_cameras
from glcaustics.gpu import Device, create_device
from glcaustics.graph import FrameGraph
from glcaustics.optics.refract import refract
from glcaustics.passes import gbuffer
from glcaustics.passes.camera import CameraState
from glcaustics.passes.frame import FrameSetup, FrameState
from glcaustics.passes.geometry import GpuScene
from glcaustics.passes.raster import raster_uniforms
from glcaustics.passes.runner import PlanRunner
from glcaustics.scene.load import load_scene
from glcaustics.scene.model import Camera, OpticalKind, Scene

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
VARIANTS = {"planes": 0, "normals": 1, "depth": 2, "curved": 3, "filtered": 4, "dda": 5}
HIT = 1  # GLC_SOLVE_HIT
SHADER = "passes/refraction/variants"


@dataclass(frozen=True, eq=False)
class Buffers:
    """A G-buffer and the rays over it; arrays (H, W, ...), row 0 lowest.

    `depth_m` (H, W): along the view axis, 0 = nothing; `plane` (H, W, 4): see raster_ray.glsl; `normal_ws` (H, W, 3);
    `origin_ws` (H, W, 3) and `ray` (H, W, 4): unit direction, and length in metres, 0 = no ray.
    """

    camera: CameraState
    depth_m: FloatArray
    plane: FloatArray
    normal_ws: FloatArray
    origin_ws: FloatArray
    ray: FloatArray

    @property
    def size(self) -> tuple[int, int]:
        return self.depth_m.shape[1], self.depth_m.shape[0]


def ray_from_px(camera: CameraState, size: tuple[int, int]) -> FloatArray:
    """(3, 3) of glc_plane_from_normal: eye rays of unit depth; orthographic: offsets a pixel, and the forward axis."""
    turn, (w, h) = camera.world_from_camera[:3, :3], size
    x, y = camera.lens[0] * turn[:, 0], camera.lens[1] * turn[:, 1]
    if camera.orthographic:
        return np.stack([2.0 / w * x, 2.0 / h * y, -turn[:, 2]], axis=1)
    jx, jy = camera.jitter_uv
    return np.stack([2.0 / w * x, 2.0 / h * y, -turn[:, 2] - (1.0 + 2.0 * jx) * x - (1.0 + 2.0 * jy) * y], axis=1)


class VariantBench:
    """Runs the solvers over one set of buffers."""

    def __init__(self, device: Device, buffers: Buffers) -> None:
        self.device, self.buffers = device, buffers
        valid = (buffers.depth_m > 0.0).astype(np.float64)[..., None]
        weighed = np.concatenate([buffers.plane[..., :3] * valid, valid], axis=-1)
        four = np.ones_like(buffers.ray[..., :1])
        self._textures: dict[str, Any] = {
            "t_origin": self._upload(np.concatenate([buffers.origin_ws, four], axis=-1)),
            "t_direction": self._upload(buffers.ray),
            "t_plane": self._upload(buffers.plane),
            "t_normal": self._upload(np.concatenate([buffers.normal_ws, four], axis=-1)),
            "t_depth_m": self._upload(buffers.depth_m[..., None], format="r32f"),
            "t_plane_mips": self._upload(weighed, filter="linear", mipmaps=True),
        }
        self._target = device.texture(buffers.size, "rgba32f")
        self._framebuffer = device.framebuffer([self._target])

    def _upload(self, data: FloatArray, format: str = "rgba32f", **how: Any) -> Any:
        content = np.ascontiguousarray(data, np.float32)
        return self.device.texture((data.shape[1], data.shape[0]), format, data=content, **how)

    def draw(self, variant: str, iterations: int, width: float = 0.5) -> None:
        """One pass; `width`: of the filtered variant's filter, in gaps."""
        number, camera = VARIANTS[variant], self.buffers.camera
        program = self.device.program(SHADER, {"VARIANT": number, "ORTHOGRAPHIC": int(camera.orthographic)})
        known = {
            **self._textures,
            **raster_uniforms(camera, self.buffers.size),
            "u_ray_from_px": ray_from_px(camera, self.buffers.size),
            "u_width": width,
            "u_iterations": iterations,
        }
        program.set_all({name: value for name, value in known.items() if program.declares(name)})
        self.device.draw_fullscreen(program, self._framebuffer)

    def solve(self, variant: str, iterations: int, width: float = 0.5) -> FloatArray:
        """(H, W, 4): pixel coordinates of the estimate, status (GLC_SOLVE_*), texel look-ups."""
        self.draw(variant, iterations, width)
        return np.asarray(self.device.read(self._target), np.float64)

    def cost_s(self, variant: str, iterations: int, width: float = 0.5) -> float:
        """Processor time of one pass, seconds: on a machine that others use too, wall time says little."""
        self.device.ctx.finish()
        start = time.process_time()
        self.draw(variant, iterations, width)
        self.device.ctx.finish()
        return time.process_time() - start

    def release(self) -> None:
        """Give the textures back."""
        self.device.release_framebuffers([self._framebuffer])
        for texture in (*self._textures.values(), self._target):
            texture.release()


def scene_buffers(device: Device, scene: Scene, camera: Camera, size: tuple[int, int]) -> Buffers:
    """The opaque G-buffer that a camera sees at time 0, and the rays that open surfaces refract into it."""
    setup = FrameSetup.analyse(scene, size, {"shadow_size": 64}, transmissive_shadows=False)
    gpu = GpuScene(device)
    gpu.update(scene.instances_at(0.0))
    boxes = np.stack([item.bounds_ws for item in gpu.items])
    state = CameraState.make(camera, size, setup.scene_bounds_ws, boxes_ws=boxes)
    graph = FrameGraph()
    gbuffer.declare_opaque(graph, setup)
    gbuffer.declare_specular(graph, setup)
    names = ("gbuffer.depth_m", "gbuffer.plane", "gbuffer.normal_ws", "specular.depth_m", "specular.normal_ws")
    runner = PlanRunner(device, graph.compile(outputs=names), setup)
    try:
        runner.run(FrameState(0.0, state, state, gpu, 1.0))
        depth, plane, normal, front, facing = (np.asarray(device.read(runner.texture(n)), np.float64) for n in names)
        kinds = np.array([item.kind is OpticalKind.INTERFACE for item in gpu.items])
        iors = np.array([item.instance.material.ior for item in gpu.items])
    finally:
        runner.release()
        gpu.release()
    origin, ray = _refracted(state, size, front.reshape(size[1], size[0]), facing, kinds, iors)
    length = 2.0 * float(np.linalg.norm(setup.scene_bounds_ws[1] - setup.scene_bounds_ws[0]))
    ray = np.concatenate([ray, np.where(np.any(ray != 0.0, axis=-1), length, 0.0)[..., None]], axis=-1)
    return Buffers(state, depth.reshape(size[1], size[0]), plane, normal[..., :3], origin, ray)


def _refracted(
    camera: CameraState,
    size: tuple[int, int],
    front_m: FloatArray,
    facing: FloatArray,
    kinds: BoolArray,
    iors: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Origins and unit directions (H, W, 3) behind open surfaces; direction 0 where there is none."""
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    eye_ray = np.stack([x, y, np.ones_like(x)], axis=-1) @ ray_from_px(camera, size).T
    position = camera.world_from_camera[:3, 3] + eye_ray * front_m[..., None]
    index = np.maximum(np.abs(np.rint(facing[..., 3])).astype(int) - 1, 0)
    d = eye_ray / np.linalg.norm(eye_ray, axis=-1, keepdims=True)
    dense, ior = facing[..., 3] < 0.0, iors[index]
    out, tir = refract(d, facing[..., :3], np.where(dense, ior, 1.0), np.where(dense, 1.0, ior))
    good = (front_m > 0.0) & kinds[index] & ~tir
    return position, np.where(good[..., None], out, 0.0)


def compare(bench: VariantBench, counts: Sequence[int], rounds: int, width: float = 0.5) -> dict[str, dict[str, Any]]:
    """By variant: shares of the pixels that the DDA solves, within one pixel after each count (`within_1px`), said to
    be solved (`reported`) and said so wrongly (`wrong`); `lookups`: mean of them at the last count, `cost`: of the pass
    at the last count, in passes with stored planes (medians over interleaved rounds)."""
    truth = bench.solve("dda", 16384)
    resolvable = truth[..., 2] == HIT
    found: dict[str, dict[str, Any]] = {}
    chosen = [name for name in VARIANTS if name != "dda"]
    for name in chosen:
        row: dict[str, Any] = {"within_1px": [], "reported": [], "wrong": []}
        for count in counts:
            result = bench.solve(name, count, width)[resolvable]
            near = np.abs(result[:, :2] - truth[resolvable][:, :2]).max(axis=-1) <= 1.0
            says = result[:, 2] == HIT
            shares = {"within_1px": near, "reported": near & says, "wrong": says & ~near}
            for key, mask in shares.items():
                row[key].append(float(mask.mean()))
        found[name] = {**row, "lookups": float(result[:, 3].mean())}
    costs: dict[str, list[float]] = {name: [] for name in chosen}
    for _ in range(rounds):
        for name in chosen:
            costs[name].append(bench.cost_s(name, counts[-1], width))
    for name in chosen if rounds else ():
        found[name]["cost"] = statistics.median(costs[name]) / statistics.median(costs["planes"])
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """`python -m glcaustics.bench.solver_variants [SCENE ...]`: what each variant solves and costs."""
    parser = argparse.ArgumentParser(prog="python -m glcaustics.bench.solver_variants", description=main.__doc__)
    parser.add_argument("scenes", nargs="*", default=["pool", "boat", "lagoon"])
    parser.add_argument("--views", type=int, default=3)
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--width", type=float, default=0.5, help="of the filtered variant's filter, in gaps")
    parser.add_argument("--backend", default="auto")
    chosen = parser.parse_args(arguments)
    width, height = map(int, chosen.size.split("x"))
    counts = (1, 2, 3, 4, 8)
    with create_device(chosen.backend) as device:
        for name in chosen.scenes:
            scene = load_scene(name)
            for index, camera in enumerate(seeded_cameras(scene, chosen.views)):
                bench = VariantBench(device, scene_buffers(device, scene, camera, (width, height)))
                print(f"{scene.name}, view {index}: within 1 px after {counts} | reported, wrong, look-ups, cost")
                for variant, row in compare(bench, counts, chosen.rounds, chosen.width).items():
                    shares = " ".join(f"{share:.4f}" for share in row["within_1px"])
                    claims = f"{row['reported'][-1]:.4f} {row['wrong'][-1]:.4f}"
                    effort = f"{row['lookups']:.2f} {row.get('cost', 0):.2f}"
                    print(f"  {variant:9s} {shares} | {claims} {effort}", flush=True)
                bench.release()


if __name__ == "__main__":
    main()
