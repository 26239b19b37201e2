"""The share of solved light rays against the solver's iterations: the red curves in table 2 of Mayer, Assarsson,
Sintorn 2026, for the light maps' solve (`common/intersect.glsl`)."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.convergence import ITERATIONS, SCENES, pooled
from glcaustics.bench.light_solver import LightSolver
from glcaustics.bench.scene_export import opaque_caster
from glcaustics.caustics.branches import SOLID, Branch
from glcaustics.errors import UsageError
from glcaustics.gpu import create_device
from glcaustics.optics.refract import refract
from glcaustics.passes.light_views import LightView
from glcaustics.scene.load import load_scene
from glcaustics.scene.model import Light, LightKind, OpticalKind, Scene

CONVERGED = 1  # of the landing's status, see intersect.glsl
DENSE_ITERATIONS, DENSE_STEPS = 64, 512
ON_SURFACE = 0.5  # texel widths between a visible point and the plane of what the view stores there
FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class LightConvergence:
    """Shares of the resolvable rays of one light; one ray a texel of the casters' view.

    Resolvable: its true landing point is seen by the receivers' view. Truth: float64 ray casting of the refracted ray
    against the receivers' triangles (open surfaces); the solver's own dense march (`truth` = "dense march": solids,
    whose inner way is solved in screen space).
    `rays`: refracted rays; `resolvable`: of them, the share; `iterations`: of the estimate, 0 = its start alone.
    `within_1texel[k]`: the estimate lies within one texel of the receivers' view of the truth, in space.
    `wrong[k]`: the solver says converged, but is farther off. `marched`: within one texel by the solver as shipped,
    with its bracketing fallback.
    """

    truth: str
    rays: int
    resolvable: float
    iterations: tuple[int, ...]
    within_1texel: tuple[float, ...]
    wrong: tuple[float, ...]
    marched: float

    @property
    def weight(self) -> float:
        """Number of resolvable rays: what pooled shares are weighed by."""
        return self.rays * self.resolvable


def seeded_lights(scene: Scene, count: int, seed: int = 0) -> list[tuple[Light, float]]:
    """The scene's first light at rest, then others and times: (light, time in seconds); every third one grazing.

    A directional light gets other directions, a lamp stays where it is while the water moves on.
    """
    rng = np.random.default_rng(seed)
    base = next(light for light in scene.lights if light.shines)
    found = [(base, 0.0)]
    for index in range(1, count):
        elevation = np.radians(rng.uniform(15.0, 25.0) if index % 3 == 2 else rng.uniform(35.0, 85.0))
        azimuth, light = rng.uniform(0.0, 2.0 * np.pi), base
        if base.kind is LightKind.DIRECTIONAL:
            level = float(np.cos(elevation))
            x, z = level * float(np.cos(azimuth)), level * float(np.sin(azimuth))
            light = replace(base, direction_ws=(x, -float(np.sin(elevation)), z))
        found.append((light, float(rng.uniform(0.0, 6.0))))
    return found


def _project(view: LightView, points: FloatArray) -> FloatArray:
    """(n, 2) texel coordinates of world points (n, 3)."""
    clip = np.concatenate([points, np.ones_like(points[:, :1])], axis=1) @ view.matrices[0].T
    return (clip[:, :2] / clip[:, 3:] * 0.5 + 0.5) * np.asarray(view.size)


def _texel_width_m(view: LightView, points: FloatArray) -> FloatArray:
    """(n,) width of a texel at world points (n, 3); as glc_texel_width."""
    if view.light.kind is LightKind.DIRECTIONAL:
        return np.full(len(points), np.sqrt(view.texel_measure))
    d = points - np.asarray(view.light.position_ws)
    length = np.linalg.norm(d, axis=1)
    cosine = np.maximum(d @ view.forward_ws / length, 1e-3)
    return np.asarray(np.sqrt(view.texel_measure * cosine**3) * length)


def _visible(
    view: LightView, stored: FloatArray, points: FloatArray, normals: FloatArray, ray: FloatArray
) -> BoolArray:
    """Whether the view stores the surface of each point in its texel, and sees the side that the light arrives at."""
    height, width = stored.shape[:2]
    px, texel_m = _project(view, points), _texel_width_m(view, points)
    inside = np.all((px >= 0.0) & (px < (width, height)), axis=1)
    x, y = np.clip(px[:, 0].astype(int), 0, width - 1), np.clip(px[:, 1].astype(int), 0, height - 1)
    gap = np.abs(np.einsum("ij,ij->i", stored[y, x, :3] - points, normals))
    found = (stored[y, x, 3] > 0.0) & (gap < ON_SURFACE * texel_m)
    light = np.asarray(view.light.direction_ws, np.float64)
    if view.light.kind is not LightKind.DIRECTIONAL:
        light = points - np.asarray(view.light.position_ws)
    along, seen = np.einsum("ij,ij->i", normals, ray), np.einsum("ij,ij->i", normals, np.broadcast_to(light, ray.shape))
    return inside & found & (along * seen > 0.0)


def _refracted(solver: LightSolver) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Origins and unit directions (H, W, 3) behind open surfaces, and the mask (H, W) of the texels that have one."""
    position, normal = solver.texture("caster.position_ws"), solver.texture("caster.normal_ws")
    light = solver.light.light
    d = np.broadcast_to(np.asarray(light.direction_ws, np.float64), position[..., :3].shape)
    if light.kind is not LightKind.DIRECTIONAL:
        d = position[..., :3] - np.asarray(light.position_ws)
    d = d / np.linalg.norm(d, axis=-1, keepdims=True)
    index = np.rint(position[..., 3]).astype(int) - 1  # row of the object table, see solve.frag
    ior = np.array([i.material.ior_rgb()[1] for i in solver.instances])[np.maximum(index, 0)]
    is_open = np.array([i.optical_kind is OpticalKind.INTERFACE for i in solver.instances])[np.maximum(index, 0)]
    from_dense = normal[..., 3] < 0.0
    n = normal[..., :3] * np.where(from_dense, -1.0, 1.0)[..., None]
    out, tir = refract(d, n, np.where(from_dense, ior, 1.0), np.where(from_dense, 1.0, ior))
    return position[..., :3], out, (index >= 0) & is_open & ~tir & (np.sum(d * n, axis=-1) < 0.0)


def _truth(solver: LightSolver, branch: Branch) -> tuple[str, int, BoolArray, FloatArray]:
    """How it was found, refracted rays, the mask (H, W) of the resolvable ones, and their landing points (n, 3)."""
    landed, status = solver.solve(branch, DENSE_ITERATIONS, DENSE_STEPS)
    if branch.kind == SOLID:
        resolvable = status > 0
        return "dense march", int((status != 0).sum()), resolvable, landed[resolvable]
    origin, direction, refracts = _refracted(solver)
    hits = opaque_caster(solver.instances).first_hits(origin[refracts], direction[refracts])
    found = hits.object_id >= 0
    view, stored = solver.view(branch), solver.texture(f"receiver.{branch.view}.position_ws")
    seen = _visible(view, stored, hits.point_ws[found], hits.geometric_ws[found], direction[refracts][found])
    found[found] = seen
    resolvable = refracts.copy()
    resolvable[refracts] = found
    return "float64 ray casting", int(refracts.sum()), resolvable, hits.point_ws[found]


def light_convergence(solver: LightSolver, branch: Branch, iterations: Sequence[int] = ITERATIONS) -> LightConvergence:
    """Solve with every count and compare; the estimate alone, without the march that the shipped solver falls back on.

    Raises:
        UsageError: no ray of the branch lands where the receivers' view sees it; embreex is not installed.
    """
    shipped = int(solver.setup.options["max_iterations"]), int(solver.setup.options["march_steps"])
    truth, rays, resolvable, points = _truth(solver, branch)
    if not len(points):
        raise UsageError(f"no {branch.words} light lands in sight of '{solver.light.light.name}'", where="light_rays")
    texel_m = _texel_width_m(solver.view(branch), points)

    def near(landed: FloatArray) -> BoolArray:
        return np.asarray(np.linalg.norm(landed[resolvable] - points, axis=1) <= texel_m)

    within, wrong = [], []
    for count in iterations:
        landed, status = solver.solve(branch, count, 0)
        within.append(float(near(landed).mean()))
        wrong.append(float(((status[resolvable] == CONVERGED) & ~near(landed)).mean()))
    landed, status = solver.solve(branch, *shipped)
    marched = float((near(landed) & (status[resolvable] > 0)).mean())
    share = float(resolvable.sum()) / max(rays, 1)
    return LightConvergence(truth, rays, share, tuple(iterations), tuple(within), tuple(wrong), marched)


def light_study(
    scenes: Sequence[str] = SCENES,
    views: int = 6,
    iterations: Sequence[int] = ITERATIONS,
    seed: int = 0,
    method: str = "displaced_mesh",
    quality: str = "medium",
    report: Callable[[str], None] = lambda _: None,
    backend: str = "auto",
) -> dict[str, Any]:
    """The instrument of the bench, ready for JSON.

    Args:
        scenes: names or paths for `load_scene`. views: lights and times a scene, see `seeded_lights`.
        method, quality: whose light solve. report: told the name of each scene as its turn comes.

    Returns:
        `views`, `seed`, `method`, `quality`, `iterations`, `seconds` and `scenes`: for each `scene`, `branch`
        ("interface", "solid"), `seconds`, `pooled` (shares over all resolvable rays), `views` (LightConvergence each).
    """
    begin = time.perf_counter()
    rows = []
    for name in scenes:
        report(f"{name}: light rays")
        rows += _study_scene(load_scene(name), views, iterations, seed, method, quality, backend)
    return {
        "views": views,
        "seed": seed,
        "method": method,
        "quality": quality,
        "iterations": list(iterations),
        "seconds": time.perf_counter() - begin,
        "scenes": rows,
    }


def _study_scene(
    scene: Scene, views: int, iterations: Sequence[int], seed: int, method: str, quality: str, backend: str
) -> list[dict[str, Any]]:
    """One row a branch that refracts."""
    start = time.perf_counter()
    found: dict[str, list[LightConvergence]] = {}
    device = create_device(backend)
    try:
        for light, time_s in seeded_lights(scene, views, seed):
            solver = LightSolver(device, scene, light, time_s, method, quality)
            try:
                for branch in solver.branches:
                    found.setdefault(branch.kind, []).append(light_convergence(solver, branch, iterations))
            finally:
                solver.release()
    finally:
        device.close()
    rows = []
    for kind, results in found.items():
        each = [asdict(result) for result in results]
        together = pooled(each, [result.weight for result in results])
        together["resolvable"] = sum(result.weight for result in results) / max(together["rays"], 1)
        seconds = time.perf_counter() - start
        rows.append({"scene": scene.name, "branch": kind, "seconds": seconds, "pooled": together, "views": each})
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """`python -m glcaustics.bench.light_rays [SCENE ...]`: convergence of light rays over seeded lights and times."""
    parser = argparse.ArgumentParser(prog="python -m glcaustics.bench.light_rays", description=main.__doc__)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--views", type=int, default=6)
    parser.add_argument("--quality", default="medium")
    parser.add_argument("--backend", default="auto")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", help="write what was found to this file")
    chosen = parser.parse_args(arguments)
    found = light_study(
        chosen.scenes, chosen.views, seed=chosen.seed, quality=chosen.quality, report=print, backend=chosen.backend
    )
    for row in found["scenes"]:
        for label, values in [*enumerate(row["views"]), (f"pooled ({row['seconds']:.0f} s)", row["pooled"])]:
            name = f"{row['scene']}, {row['branch']}, {label}"
            print(f"{name}: {values['rays']} rays, {values['resolvable']:.3f} of them resolvable")
            for name in ("within_1texel", "wrong"):
                print(f"  {name:14s}" + " ".join(f"{share:.4f}" for share in values[name]))
            print(f"  as shipped     {values['marched']:.4f}")
    if chosen.json:
        with open(chosen.json, "w", encoding="utf-8") as file:
            json.dump(found, file, indent=1)


if __name__ == "__main__":
    main()
