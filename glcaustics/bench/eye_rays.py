"""The share of solved eye rays against the solver's iterations, as in table 2 of Mayer, Assarsson, Sintorn 2026."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glcaustics.errors import UsageError
from glcaustics.renderer import Renderer
from glcaustics.scene.load import load_scene
from glcaustics.scene.model import Camera, FloatArray, Scene

SOLVED_BY_NEWTON, SOLVED_BY_MARCHING = 1, 5  # of `solve_status`
_AOVS = ("solve_status", "solve_hit")


@dataclass(frozen=True)
class EyeConvergence:
    """Shares of the resolvable pixels of one view; resolvable = pixel-exact marching finds a surface.

    `pixels`: specular pixels; `resolvable`: of them, the share. `within_1px[k]`: Newton's estimate after k iterations
    lies within one pixel (max norm) of the marched hit. `reported[k]`: and Newton itself says that it is solved.
    `wrong[k]`: says so, but is more than one pixel off. `cascade`, `hierarchical`: solved within 1 px by these.
    """

    pixels: int
    resolvable: float
    within_1px: tuple[float, ...]
    reported: tuple[float, ...]
    wrong: tuple[float, ...]
    cascade: float
    hierarchical: float


def seeded_cameras(scene: Scene, count: int, seed: int = 0) -> list[Camera]:
    """The scene's own camera, then its orbits around the point that it looks at; every third one grazing."""
    rng = np.random.default_rng(seed)
    base = scene.view_at(0.0)
    m = np.asarray(base.world_from_camera, np.float64)
    eye, forward = m[:3, 3], -m[:3, 2]
    target = eye + forward * (eye[1] / max(-forward[1], 0.2)) * 0.9
    radius = float(np.linalg.norm(eye - target))
    cameras = [base]
    for index in range(1, count):
        azimuth = rng.uniform(0.0, 2.0 * np.pi)
        elevation = np.radians(rng.uniform(12.0, 20.0) if index % 3 == 2 else rng.uniform(30.0, 75.0))
        offset = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(elevation), np.sin(azimuth) * np.cos(elevation)])
        cameras.append(
            replace(base, world_from_camera=look_at(target + radius * rng.uniform(0.6, 1.1) * offset, target))
        )
    return cameras


def look_at(eye: FloatArray, target: FloatArray) -> FloatArray:
    """(4, 4) world_from_camera of a camera at `eye` that looks at `target`, world +y up; metres."""
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    m = np.eye(4)
    m[:3, 0], m[:3, 1], m[:3, 2], m[:3, 3] = right, np.cross(back, right), back, eye
    return m


def eye_convergence(
    scene: Scene,
    camera: Camera,
    size: tuple[int, int] = (1280, 720),
    iterations: Sequence[int] = range(1, 9),
    **renderer: Any,
) -> EyeConvergence:
    """Render one view with every solver and compare. `renderer`: further arguments of `Renderer`, such as `backend`."""
    still = replace(scene, camera=camera, camera_at=None)

    def solve(solver: str, k: int = 4) -> tuple[FloatArray, FloatArray]:
        options = {"refraction": solver, "refraction_iterations": k, "refraction_steps": 16384}
        with Renderer(still, size, "none", aovs=_AOVS, options=options, **renderer) as made:
            frame = made.render()
        return frame.aov["solve_status"], frame.aov["solve_hit"][..., :2] * np.asarray(size, np.float32)

    status, hit = solve("dda")
    specular, resolvable = status > 0, status == SOLVED_BY_MARCHING
    if not resolvable.any():
        raise UsageError(f"scene '{scene.name}' shows no refraction from this camera", where="eye_convergence")

    def near(px: FloatArray) -> FloatArray:
        return np.abs(px - hit).max(axis=-1)[resolvable] <= 1.0

    within, reported, wrong = [], [], []
    for k in iterations:
        says, px = solve("newton", k)
        solved = (says == SOLVED_BY_NEWTON)[resolvable]
        within.append(float(near(px).mean()))
        reported.append(float((near(px) & solved).mean()))
        wrong.append(float((solved & np.logical_not(near(px))).mean()))
    others = []
    for solver in ("cascade", "hierarchical"):
        says, px = solve(solver)
        others.append(float((near(px) & np.isin(says, (SOLVED_BY_NEWTON, SOLVED_BY_MARCHING))[resolvable]).mean()))
    return EyeConvergence(
        int(specular.sum()),
        float(resolvable.sum() / max(specular.sum(), 1)),
        tuple(within),
        tuple(reported),
        tuple(wrong),
        *others,
    )


def _print_view(index: int, found: EyeConvergence) -> None:
    print(f"view {index}: {found.pixels} specular pixels, {found.resolvable:.3f} of them resolvable")
    for name in ("within_1px", "reported", "wrong"):
        print(f"  {name:12s}" + " ".join(f"{share:.4f}" for share in getattr(found, name)))
    print(f"  cascade {found.cascade:.4f}  hierarchical {found.hierarchical:.4f}")


def main(arguments: Sequence[str] | None = None) -> None:
    """`python -m glcaustics.bench.eye_rays SCENE`: convergence and cost over seeded views, grazing ones among them."""
    from glcaustics.bench.eye_cost import eye_cost

    parser = argparse.ArgumentParser(prog="python -m glcaustics.bench.eye_rays", description=main.__doc__)
    parser.add_argument("scene")
    parser.add_argument("--views", type=int, default=6)
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--backend", default="auto")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=5, help="frames a cost is the median of; 0: no costs")
    parser.add_argument("--cost-only", action="store_true")
    chosen = parser.parse_args(arguments)
    width, height = map(int, chosen.size.split("x"))
    scene = load_scene(chosen.scene)
    for index, camera in enumerate(seeded_cameras(scene, chosen.views, chosen.seed)):
        if not chosen.cost_only:
            counts = range(1, 9)
            _print_view(index, eye_convergence(scene, camera, (width, height), counts, backend=chosen.backend))
        for reflections in (True, False) if chosen.rounds else ():
            costs = eye_cost(
                scene, camera, (width, height), rounds=chosen.rounds, reflections=reflections, backend=chosen.backend
            )
            print(f"view {index}: cost in fetch passes, {'with' if reflections else 'without'} reflections")
            for solver, parts in costs.items():
                stages = "  ".join(f"{name} {cost:.2f}" for name, cost in parts.items() if name != "total")
                ratio = parts["total"] / costs["dda"]["total"]
                print(f"  {solver:12s} {parts['total']:6.2f}  {ratio:.2f} of dda   {stages}", flush=True)


if __name__ == "__main__":
    main()
