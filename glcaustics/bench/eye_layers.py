"""What a second depth layer buys and costs: refracted eye rays against float64 ray casting, with one layer and two."""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from glcaustics.bench.convergence import seeded_cameras
from glcaustics.bench.eye_truth import MANY, cast_rays, has_open_surface
from glcaustics.bench.scene_export import opaque_caster
from glcaustics.bench.solver_variants import scene_buffers
from glcaustics.errors import UsageError
from glcaustics.gpu import create_device
from glcaustics.renderer import Renderer
from glcaustics.scene.load import load_scene
from glcaustics.scene.model import Camera, Scene

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
SOLVED, HIDDEN, SECOND = (1, 5, 8), 7, 8  # of `solve_status`


@dataclass(frozen=True)
class LayerShares:
    """Of one view's refracted rays that hit an opaque surface within the picture (float64), the shares, by layers.

    `right`: solved within one pixel (max norm) of the truth; `wrong`: said to be solved elsewhere; `hidden`: said to
    end behind something; `second`: solved in the second layer, and `second_right` of these within one pixel.
    `cost`: processor time of a whole frame, light views and all, over that with one layer.
    """

    rays: int
    right: float
    wrong: float
    hidden: float
    second: float
    second_right: float
    cost: float


def eye_layers(
    scene: Scene,
    camera: Camera,
    size: tuple[int, int] = (640, 360),
    method: str = "none",
    rounds: int = 3,
    backend: str = "auto",
) -> dict[int, LayerShares]:
    """One and two depth layers on one view. `rounds`: frames that a cost is the median of, in turns; 0: no costs.

    Raises:
        UsageError: no open surface such as water in the scene, or embreex is not installed.
    """
    if not has_open_surface(scene):
        raise UsageError(f"scene '{scene.name}' has no open surface", where="eye_layers", remedy="take one with water")
    with create_device(backend) as device:
        ends = cast_rays(opaque_caster(scene.instances_at(0.0)), scene_buffers(device, scene, camera, size))
    truth, found = ends.picture(ends.px), ends.picture(ends.inside)
    if not found.any():
        raise UsageError(f"no refracted ray of scene '{scene.name}' ends within the picture", where="eye_layers")
    still = replace(scene, camera=camera, camera_at=None)

    def renderer_with(layers: int) -> Renderer:
        options = {"depth_layers": layers, "refraction_steps": MANY}
        aovs = ("solve_status", "solve_hit")
        return Renderer(still, size, method, backend=backend, keep=False, aovs=aovs, options=options)

    with ExitStack() as stack:
        made = {layers: stack.enter_context(renderer_with(layers)) for layers in (1, 2)}
        pictures = {layers: renderer.render().aov for layers, renderer in made.items()}
        costs = _costs(made, rounds)
        for renderer in made.values():
            renderer.device.make_current()
    return {layers: _shares(aov, truth, found, costs[layers] / costs[1]) for layers, aov in pictures.items()}


def _shares(aov: Mapping[str, np.ndarray], truth: FloatArray, found: BoolArray, cost: float) -> LayerShares:
    """How a picture's AOVs compare with the true pixels (H, W, 2) where there are any, (H, W); rows lowest first."""
    height, width = found.shape
    status = aov["solve_status"][::-1][found]
    px = aov["solve_hit"][::-1][found][:, :2] * np.array([width, height])
    near, solved = np.abs(px - truth[found]).max(axis=1) <= 1.0, np.isin(status, SOLVED)
    second = status == SECOND
    return LayerShares(
        rays=int(found.sum()),
        right=float((solved & near).mean()),
        wrong=float((solved & ~near).mean()),
        hidden=float((status == HIDDEN).mean()),
        second=float(second.mean()),
        second_right=float(near[second].mean()) if second.any() else 0.0,
        cost=cost,
    )


def _costs(made: dict[int, Renderer], rounds: int) -> dict[int, float]:
    """Median processor seconds of a frame, the renderers in turns."""
    times: dict[int, list[float]] = {layers: [] for layers in made}
    for _ in range(rounds):
        for layers, renderer in made.items():
            renderer.device.make_current()
            start = time.process_time()
            renderer.draw()
            renderer.device.ctx.finish()
            times[layers].append(time.process_time() - start)
    return {layers: statistics.median(values) if values else 1.0 for layers, values in times.items()}


def main(arguments: Sequence[str] | None = None) -> None:
    """`python -m glcaustics.bench.eye_layers SCENE`: shares and cost with one and two depth layers, seeded views."""
    parser = argparse.ArgumentParser(prog="python -m glcaustics.bench.eye_layers", description=main.__doc__)
    parser.add_argument("scene", nargs="+")
    parser.add_argument("--views", type=int, default=2)
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--method", default="none", help="caustics method, for the cost of the whole frame")
    parser.add_argument("--rounds", type=int, default=3, help="frames a cost is the median of; 0: no costs")
    parser.add_argument("--backend", default="auto")
    chosen = parser.parse_args(arguments)
    width, height = map(int, chosen.size.split("x"))
    print("scene view layers     rays  right  wrong hidden second (right) cost")
    for name in chosen.scene:
        scene = load_scene(name)
        for view, camera in enumerate(seeded_cameras(scene, chosen.views)):
            found = eye_layers(scene, camera, (width, height), chosen.method, chosen.rounds, chosen.backend)
            for layers, row in found.items():
                print(
                    f"{name:12s} {view} {layers} {row.rays:8d}  {row.right:.3f}  {row.wrong:.3f}  {row.hidden:.3f}  "
                    f"{row.second:.3f}  {row.second_right:.3f}  {row.cost:.2f}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
