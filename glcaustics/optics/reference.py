"""Reference caustic irradiance E_c (light paths L S+ D) by beams: triangles of light, traced in float64.

A light's rays form a grid of triangles. Each corner is refracted or reflected through the scene along one sequence of
events; where the three corners of a triangle met the same objects, its flux is spread evenly over the triangle they
land on (Watt 1990, "Light-water interaction using backward beam tracing"), with exact area coverage per pixel. Other
triangles, and those that land wide or bent, are split in four. No noise but that of the grid's random turn and shift;
two seeds give two independent halves. The same limits as the renderer's methods are set by `max_events`: water 1,
a solid's two interfaces 2, mirrors 1; total internal reflection is followed as far as `max_events` goes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from glcaustics.optics.beam_scene import BeamScene
from glcaustics.optics.beam_trace import BeamSettings, FluxBalance, trace_beams
from glcaustics.optics.receivers import PlaneGrid, PlaneReceiver, PointReceiver

__all__ = [
    "BeamSettings",
    "FluxBalance",
    "Reference",
    "reference_map",
    "reference_points",
    "relative_rms",
    "trace_beams",
]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Reference:
    """Two independent halves of a reference, each (H, W, 3) or (n, 3), W/m^2, and their own error.

    `noise`: of the mean of the halves, RMS(a - b) / 2 over the mean irradiance: what the grid's place and turn decide.
    `step`: relative RMSE between N / 4 beams and N (None when not asked for): what their size decides. The triangles'
    error falls as 1 / N (measured on the closed forms), so that of N is about a third of `step`.
    """

    half_a: FloatArray
    half_b: FloatArray
    noise: float
    step: float | None
    balance: FluxBalance

    @property
    def mean(self) -> FloatArray:
        return np.asarray(0.5 * (self.half_a + self.half_b))

    def report(self) -> str:
        """One line: the reference's own error."""
        step = "" if self.step is None else f", beams N/4 against N {self.step:.2e}"
        caught, landed = float(self.balance.caught.sum()), float(self.balance.landed.sum())
        unsplit = float(self.balance.unsplit.sum()) / max(caught, 1e-300)
        return (
            f"noise of the mean {self.noise:.2e}{step}; {self.balance.rays / 1e6:.1f} M rays, caught "
            f"{caught / max(landed, 1e-300):.4f} of the flux that landed, {unsplit:.1e} of it as points"
        )


def reference_map(
    scene: BeamScene, grid: PlaneGrid, settings: BeamSettings | None = None, *, check_step: bool = True
) -> Reference:
    """Irradiance (height, width, 3) on a plane, as two halves, with its error. See BeamSettings."""
    return _halves(scene, lambda: PlaneReceiver(grid), settings or BeamSettings(), check_step)


def reference_points(
    scene: BeamScene,
    points_ws: FloatArray,
    normals_ws: FloatArray,
    detail_m: float,
    settings: BeamSettings | None = None,
    *,
    check_step: bool = True,
) -> Reference:
    """Irradiance (n, 3) at receiver points (n, 3) with lit-side normals (n, 3), as two halves. See PointReceiver.

    Values at points, not means of pixels: beside a fold they are as large as they are, and `noise` is ruled by them.
    Average points over a pixel's footprint to compare with pixels.
    """
    points, normals = np.asarray(points_ws, np.float64), np.asarray(normals_ws, np.float64)
    return _halves(scene, lambda: PointReceiver(points, normals, detail_m), settings or BeamSettings(), check_step)


def relative_rms(a: FloatArray, b: FloatArray) -> float:
    """RMS(a - b) over the mean of b."""
    return float(np.sqrt(np.mean((a - b) ** 2)) / max(abs(float(b.mean())), 1e-300))


def _halves(
    scene: BeamScene, make: Callable[[], PlaneReceiver | PointReceiver], settings: BeamSettings, check_step: bool
) -> Reference:
    halves, balance = [], FluxBalance()
    for half in range(2):
        receiver = make()
        balance = trace_beams(scene, receiver, replace(settings, seed=2 * settings.seed + half))
        halves.append(receiver.irradiance())
    a, b = halves
    mean = 0.5 * (a + b)
    step = None
    if check_step:
        receiver = make()
        coarse = replace(settings, cells=max(2, settings.cells // 2), seed=2 * settings.seed)
        trace_beams(scene, receiver, coarse)
        step = relative_rms(receiver.irradiance(), mean)
    return Reference(a, b, 0.5 * relative_rms(a, b) if mean.any() else 0.0, step, balance)
