"""The share of solved eye rays against the solver's iterations, as in table 2 of Mayer, Assarsson, Sintorn 2026."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.convergence import ITERATIONS, SCENES, pooled, seeded_cameras
from glcaustics.bench.eye_truth import EyeTruth, eye_truth, has_open_surface, solid_truth
from glcaustics.errors import UsageError
from glcaustics.gpu import create_device
from glcaustics.renderer import Renderer
from glcaustics.scene.load import load_scene
from glcaustics.scene.model import Camera, FloatArray, Scene

SOLVED_BY_NEWTON, SOLVED_BY_MARCHING = 1, 5  # of `solve_status`
_AOVS = ("solve_status", "solve_hit")
_STEPS = {"refraction_steps": 16384, "reflection_steps": 1}  # refracted rays are judged; reflections only cost

# The published code on its own pool, as we measured it: 1280x720, views A (31 % water) and B (99 % water).
PUBLISHED: dict[str, dict[str, Any]] = {
    "published, view A": {"iterations": (1, 2, 3, 4, 7), "within_1px": (0.62, 0.89, 0.941, 0.942, 0.945), "dda": 0.987},
    "published, view B": {
        "iterations": (1, 2, 3, 4, 7),
        "within_1px": (0.76, 0.992, 0.998, 0.998, 0.998),
        "dda": 0.998,
    },
}


@dataclass(frozen=True)
class EyeConvergence:
    """Shares of the resolvable pixels of one view; resolvable = pixel-exact marching (DDA) finds a surface.

    `pixels`: specular pixels; `resolvable`: of them, the share; `iterations`: texel look-ups, 0 = the start alone.
    `within_1px[k]`: Newton's estimate after `iterations[k]` lies within one pixel (max norm) of the marched hit.
    `reported[k]`: and Newton itself says that it is solved. `wrong[k]`: says so, but is more than one pixel off.
    `cascade`, `hierarchical`: solved within 1 px by these.
    """

    pixels: int
    resolvable: float
    iterations: tuple[int, ...]
    within_1px: tuple[float, ...]
    reported: tuple[float, ...]
    wrong: tuple[float, ...]
    cascade: float
    hierarchical: float

    @property
    def weight(self) -> float:
        """Number of resolvable pixels: what pooled shares are weighed by."""
        return self.pixels * self.resolvable


Solved = tuple[FloatArray, FloatArray]  # status (H, W), hit in pixels (H, W, 2)


@contextmanager
def _solver(scene: Scene, size: tuple[int, int], name: str, **renderer: Any) -> Iterator[Callable[..., Solved]]:
    """One renderer for all views and counts of a solver: solve(camera, iterations)."""
    options = {"refraction": name, **_STEPS}
    with Renderer(scene, size, "none", aovs=_AOVS, stats=False, options=options, **renderer) as made:

        def solve(camera: Camera, iterations: int = 4) -> Solved:
            made.tune(camera=camera, refraction_iterations=iterations)
            frame = made.render()
            return frame.aov["solve_status"], frame.aov["solve_hit"][..., :2] * np.asarray(size, np.float32)

        yield solve


def eye_convergence(
    scene: Scene,
    cameras: Sequence[Camera],
    size: tuple[int, int] = (1280, 720),
    iterations: Sequence[int] = ITERATIONS,
    **renderer: Any,
) -> list[EyeConvergence]:
    """Render every view with every solver and compare; one result a view that shows refraction.

    `renderer`: further arguments of `Renderer`, such as `backend`.

    Raises:
        UsageError: no view shows any refraction.
    """
    truths: list[tuple[Camera, int, FloatArray, FloatArray]] = []  # specular pixels, resolvable (H, W), hit
    with _solver(scene, size, "dda", **renderer) as solve:
        for camera in cameras:
            status, hit = solve(camera)
            resolvable = status == SOLVED_BY_MARCHING
            if resolvable.any():
                truths.append((camera, int((status > 0).sum()), resolvable, hit[resolvable]))
    if not truths:
        raise UsageError(f"scene '{scene.name}' shows no refraction from these cameras", where="eye_convergence")
    shares: list[dict[str, Any]] = [{"within_1px": (), "reported": (), "wrong": ()} for _ in truths]
    with _solver(scene, size, "newton", **renderer) as solve:
        for (camera, _, resolvable, hit), found in zip(truths, shares, strict=True):
            for count in iterations:
                says, px = solve(camera, count)
                near, solved = _near(px[resolvable], hit), says[resolvable] == SOLVED_BY_NEWTON
                found["within_1px"] += (float(near.mean()),)
                found["reported"] += (float((near & solved).mean()),)
                found["wrong"] += (float((solved & ~near).mean()),)
    for name in ("cascade", "hierarchical"):
        with _solver(scene, size, name, **renderer) as solve:
            for (camera, _, resolvable, hit), found in zip(truths, shares, strict=True):
                says, px = solve(camera)
                solved = np.isin(says[resolvable], (SOLVED_BY_NEWTON, SOLVED_BY_MARCHING))
                found[name] = float((_near(px[resolvable], hit) & solved).mean())
    return [
        EyeConvergence(pixels, float(resolvable.sum()) / pixels, tuple(iterations), **found)
        for (_, pixels, resolvable, _), found in zip(truths, shares, strict=True)
    ]


def solids_truth(
    scene: Scene, cameras: Sequence[Camera], size: tuple[int, int], iterations: Sequence[int], **renderer: Any
) -> list[EyeTruth]:
    """What the frame shows through solids against float64 ray casting; orthographic cameras are left out."""
    views = []
    with create_device(str(renderer.get("backend", "auto"))) as device:
        for camera in cameras:
            if not camera.orthographic:
                exact, seen, rays = solid_truth(scene, camera, size, device)
                if seen.any():
                    views.append((camera, exact[::-1][seen[::-1]], seen[::-1], rays))  # AOVs have row 0 on top
    shares: list[list[float]] = [[] for _ in views]
    for name, counts in (("newton", iterations), ("dda", (4,))):
        with _solver(scene, size, name, **renderer) as solve:
            for (camera, exact, seen, _), found in zip(views, shares, strict=True):
                for count in counts:
                    px = solve(camera, count)[1]
                    found.append(float(_near(px[seen], exact).mean()))
    return [
        EyeTruth(rays, float(seen.sum()) / rays, tuple(iterations), tuple(found[:-1]), found[-1])
        for (_, _, seen, rays), found in zip(views, shares, strict=True)
    ]


def _near(px: FloatArray, hit: FloatArray) -> npt.NDArray[np.bool_]:
    """(n,): which of the pixels (n, 2) lie within one of the hits, by the larger coordinate."""
    return np.abs(px - hit).max(axis=-1) <= 1.0


def eye_study(
    scenes: Sequence[str] = SCENES,
    views: int = 6,
    size: tuple[int, int] = (1280, 720),
    iterations: Sequence[int] = ITERATIONS,
    seed: int = 0,
    report: Callable[[str], None] = lambda _: None,
    **renderer: Any,
) -> dict[str, Any]:
    """The instrument of the bench, ready for JSON.

    Args:
        scenes: names or paths for `load_scene`. views: cameras a scene, see `seeded_cameras`.
        report: told the name of each scene as its turn comes.

    Returns:
        `size`, `views`, `seed`, `iterations`, `seconds`, `published` (see PUBLISHED) and `scenes`: for each `scene`,
        `seconds`, `pooled` (shares over the resolvable pixels of all views), `views` (EyeConvergence each) and
        `by_ray_casting`: `pooled` and `views` of EyeTruth: of open surfaces, or of solids where there are no others,
        then with all that the search for the way out adds to the error; None where neither shows anything.
    """
    begin, rows = time.perf_counter(), []
    for name in scenes:
        report(f"{name}: eye rays")
        rows.append(_study_scene(load_scene(name), views, size, iterations, seed, renderer))
    return {
        "size": list(size),
        "views": views,
        "seed": seed,
        "iterations": list(iterations),
        "seconds": time.perf_counter() - begin,
        "published": PUBLISHED,
        "scenes": rows,
    }


def _study_scene(
    scene: Scene,
    views: int,
    size: tuple[int, int],
    iterations: Sequence[int],
    seed: int,
    renderer: Mapping[str, Any],
) -> dict[str, Any]:
    start, cameras = time.perf_counter(), seeded_cameras(scene, views, seed)
    row = {"scene": scene.name, **_both(eye_convergence(scene, cameras, size, iterations, **renderer))}
    if has_open_surface(scene):
        truth = eye_truth(scene, cameras, size, iterations, str(renderer.get("backend", "auto")))
    else:
        truth = solids_truth(scene, cameras, size, iterations, **renderer)
    return {**row, "by_ray_casting": _both(truth) if truth else None, "seconds": time.perf_counter() - start}


def _both(found: Sequence[EyeConvergence] | Sequence[EyeTruth]) -> dict[str, Any]:
    """`views` and `pooled`."""
    each = [asdict(view) for view in found]
    together = pooled(each, [view.weight for view in found])
    together["resolvable"] = sum(view.weight for view in found) / max(together["pixels"], 1)
    return {"pooled": together, "views": each}


def _print_row(label: str, row: dict[str, Any]) -> None:
    print(f"{label}: {row['pixels']:.0f} specular pixels, {row['resolvable']:.3f} of them resolvable")
    for name in ("within_1px", "reported", "wrong"):
        print(f"  {name:12s}" + " ".join(f"{share:.4f}" for share in row[name]))
    print(f"  cascade {row['cascade']:.4f}  hierarchical {row['hierarchical']:.4f}")


def _print_costs(scene: Scene, camera: Camera, size: tuple[int, int], rounds: int, backend: str) -> None:
    from glcaustics.bench.eye_cost import eye_cost

    for reflections in (True, False):
        costs = eye_cost(scene, camera, size, rounds=rounds, reflections=reflections, backend=backend)
        print(f"cost in fetch passes, {'with' if reflections else 'without'} reflections")
        for solver, parts in costs.items():
            stages = "  ".join(f"{name} {cost:.2f}" for name, cost in parts.items() if name != "total")
            ratio = parts["total"] / costs["dda"]["total"]
            print(f"  {solver:12s} {parts['total']:6.2f}  {ratio:.2f} of dda   {stages}", flush=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """`python -m glcaustics.bench.eye_rays [SCENE ...]`: convergence and cost over seeded views, some grazing."""
    parser = argparse.ArgumentParser(prog="python -m glcaustics.bench.eye_rays", description=main.__doc__)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--views", type=int, default=6)
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--backend", default="auto")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=5, help="frames a cost is the median of; 0: no costs")
    parser.add_argument("--cost-only", action="store_true")
    parser.add_argument("--json", help="write what was found to this file")
    chosen = parser.parse_args(arguments)
    width, height = map(int, chosen.size.split("x"))
    if not chosen.cost_only:
        found = eye_study(
            chosen.scenes, chosen.views, (width, height), seed=chosen.seed, report=print, backend=chosen.backend
        )
        for row in found["scenes"]:
            for index, view in enumerate(row["views"]):
                _print_row(f"{row['scene']}, view {index}", view)
            _print_row(f"{row['scene']}, pooled ({row['seconds']:.0f} s)", row["pooled"])
            if row["by_ray_casting"]:
                true = row["by_ray_casting"]["pooled"]
                shares = " ".join(f"{share:.4f}" for share in true["within_1px"])
                print(f"  by float64 ray casting: {true['resolvable']:.3f} resolvable; {shares}; dda {true['dda']:.4f}")
        if chosen.json:
            with open(chosen.json, "w", encoding="utf-8") as file:
                json.dump(found, file, indent=1)
    for name in chosen.scenes if chosen.rounds else ():
        scene = load_scene(name)
        for index, camera in enumerate(seeded_cameras(scene, chosen.views, chosen.seed)):
            print(f"{scene.name}, view {index}")
            _print_costs(scene, camera, (width, height), chosen.rounds, chosen.backend)


if __name__ == "__main__":
    main()
