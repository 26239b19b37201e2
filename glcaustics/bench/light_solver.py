"""The light maps' solve alone, with counts of one's choice: what the instrument of light rays works with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from glcaustics.caustics.branches import INTERFACE, SOLID, Branch, branches_of, read_rgba32f
from glcaustics.caustics.light_solve import LightMapMethod
from glcaustics.caustics.registry import METHODS
from glcaustics.errors import UsageError
from glcaustics.gpu import Device
from glcaustics.graph import FrameGraph
from glcaustics.passes.camera import CameraState
from glcaustics.passes.frame import FrameSetup, FrameState, LightSetup
from glcaustics.passes.geometry import GpuScene
from glcaustics.passes.light_views import LightView
from glcaustics.passes.runner import PlanRunner
from glcaustics.renderer import resolve_options
from glcaustics.scene.model import Light, Scene

FloatArray = npt.NDArray[np.float64]


class LightSolver:
    """The light solve of one scene, light and time: of refracted light, without total reflections or the rest of the
    frame.

    Raises:
        UsageError: the method solves in no light view, or the light needs a cube of views.
    """

    def __init__(self, device: Device, scene: Scene, light: Light, time_s: float, method: str, quality: str) -> None:
        lit = replace(scene, lights=(light,))
        chosen = METHODS[method]
        if not issubclass(chosen, LightMapMethod):
            raise UsageError(f"method {method} has no light solve to count iterations of", where="light_rays")
        self._method = chosen()
        # Total reflections inside a solid are marched, not iterated: they would count against every count.
        options = resolve_options(chosen, quality, {"reflect": False, "dispersion": False, "internal_bounces": 0})
        self.setup = FrameSetup.analyse(lit, (64, 64), options, transmissive_shadows=True)
        self.light: LightSetup = self.setup.lights[0]
        self.device, self._gpu = device, GpuScene(device)
        self.instances = lit.instances_at(time_s)
        self._gpu.update(self.instances)
        camera = CameraState.make(lit.view_at(time_s), self.setup.size, self.setup.scene_bounds_ws)
        self._frame = FrameState(time_s, camera, camera, self._gpu, 1.0)
        self._method.prepare(device, self.setup, self._frame)
        self.branches = [b for b in branches_of(self.setup, self.light, method) if b.kind in (INTERFACE, SOLID)]
        if (
            self.light.caster is None
            or self.light.caster.faces != 1
            or any(self.view(b).faces != 1 for b in self.branches)
        ):
            raise UsageError(f"light '{light.name}' needs a cube of views", where="light_rays", remedy="use a sun")
        self._runner = self._make_runner()

    def _make_runner(self) -> PlanRunner:
        graph = FrameGraph()
        self._method.declare_solves(graph, self.setup, self.light, self.branches)
        outputs = [self.light.resource(name) for name in ("caster.position_ws", "caster.normal_ws")]
        for branch in self.branches:
            outputs += [branch.landing, self.light.resource(f"receiver.{branch.view}.position_ws")]
        return PlanRunner(self.device, graph.compile(outputs=list(dict.fromkeys(outputs))), self.setup, keep=False)

    def view(self, branch: Branch) -> LightView:
        """The receivers' view in which a branch lands."""
        return self.light.receivers[branch.view].view

    def solve(self, branch: Branch, iterations: int, march_steps: int) -> tuple[FloatArray, FloatArray]:
        """Landing points (H, W, 3) in metres and status (H, W) of a branch."""
        counts = {"max_iterations": iterations, "march_steps": march_steps}
        self.setup.options = {**self.setup.options, **counts}
        self._runner.run(self._frame)
        landing = read_rgba32f(self._runner, branch.landing).astype(np.float64)
        return landing[..., :3], landing[..., 3]

    def texture(self, name: str) -> FloatArray:
        """(H, W, 4) of a resource of the light, after a solve."""
        return read_rgba32f(self._runner, self.light.resource(name)).astype(np.float64)

    def release(self) -> None:
        """Give textures and meshes back."""
        self._runner.release()
        self._gpu.release()
