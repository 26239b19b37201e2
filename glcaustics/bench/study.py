"""The whole run: references, methods, peers and scaling, cell by cell, each kept as soon as it is measured."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import glcaustics
from glcaustics.bench.analysis import fit_power, pareto
from glcaustics.bench.luxcore_peer import SCENES as LUXCORE_SCENES
from glcaustics.bench.luxcore_peer import has_luxcore, luxcore_rows
from glcaustics.bench.machine import code_key, commit, machine, versions
from glcaustics.bench.measure import Case, Timing, errors, measure, picture, reduced, regular
from glcaustics.bench.mitsuba_truth import Halves, mitsuba_reference
from glcaustics.bench.peers import PtracerPeer, has_denoiser
from glcaustics.bench.progress import Progress
from glcaustics.bench.references import beam_reference
from glcaustics.bench.scaling import samples_option, scaling_cases
from glcaustics.bench.store import Arrays, Store, default_cache, digest, scene_key
from glcaustics.bench.targets import Target, bench_scene, target_of
from glcaustics.caustics.registry import METHODS
from glcaustics.errors import UsageError
from glcaustics.scene.model import Scene

SCHEMA = "glcaustics-bench/1"
FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Plan:
    """What is measured. `sizes`: pixels a side, each a divisor of the largest; `photons`: of the peers;
    `validate`: photons of each Mitsuba half that the beams are held against, 0 = not; `seconds`: given to LuxCore."""

    scenes: tuple[str, ...]
    methods: tuple[str, ...]
    qualities: tuple[str, ...]
    sizes: tuple[int, ...]
    photons: tuple[int, ...]
    validate: int
    cells: int
    scaling_scene: str | None
    timing: Timing = field(default_factory=Timing)
    backend: str = "auto"
    quick: bool = False
    seconds: tuple[float, ...] = (1.0, 4.0, 16.0)

    @property
    def largest(self) -> int:
        return max(self.sizes)


FULL = Plan(
    ("pool", "peer-pool", "glass-sphere", "glass-bunny", "metal-ring"),
    tuple(METHODS),
    ("draft", "low", "medium", "high"),
    (256, 512),
    (1 << 16, 1 << 18, 1 << 20, 1 << 22, 1 << 24),
    1 << 23,
    1024,
    "peer-pool",
)
QUICK = replace(
    FULL,
    scenes=("pool", "peer-pool", "glass-sphere", "metal-ring"),
    qualities=("draft", "low", "medium"),
    sizes=(128,),
    photons=(1 << 15, 1 << 17, 1 << 19),
    validate=1 << 19,
    cells=320,
    timing=Timing(3, 30, 0.5),
    quick=True,
    seconds=(1.0, 4.0),
)


@dataclass(eq=False)
class Study:
    """Runs a plan. `folder`: of the report; its `cells` keep what is measured, so that a run can go on.

    Raises:
        UsageError: a scene without a target, an unknown method, or a package that is missing.
    """

    plan: Plan
    folder: Path
    peers: bool = True
    command: str = ""
    rows: list[dict[str, Any]] = field(default_factory=list)
    images: dict[str, FloatArray] = field(default_factory=dict)
    pictures: dict[str, npt.NDArray[np.uint8]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        for size in self.plan.sizes:
            if self.plan.largest % size:
                remedy = "choose sizes that divide the largest"
                raise UsageError(f"size {size} does not divide {self.plan.largest}", where="--sizes", remedy=remedy)
        self._targets = {name: target_of(name) for name in self.plan.scenes}
        self._scenes = {name: bench_scene(name) for name in self.plan.scenes}
        self._cells = Store(self.folder / "cells")
        self._truths = Store(default_cache())
        self._code = digest(code_key(), machine()["cpu"], machine()["cores"], self.plan.backend)
        self._progress = Progress(self._count())

    def run(self) -> dict[str, Any]:
        """Measure everything and return the report."""
        begin = time.perf_counter()
        references: list[dict[str, Any]] = []
        validation: list[dict[str, Any]] = []
        for name in self.plan.scenes:
            scene, target = self._scenes[name], self._targets[name]
            truth = self._reference(scene, target, references)
            if self.plan.validate:
                validation.append(self._validation(scene, target))
            self._methods(scene, target, truth)
            self._picture(scene)
            if self.peers:
                self._peers(scene, target, truth)
                self._luxcore(scene, target, truth)
        scaling = self._scaling()
        self._progress.close()
        return self._report(references, validation, scaling, time.perf_counter() - begin)

    def _count(self) -> int:
        p = self.plan
        ours = (len(p.methods) + 1) * len(p.qualities) * len(p.sizes)
        each = 2 + bool(p.validate) + ours + (len(p.photons) if self.peers else 0)
        each_luxcore = sum(self._with_luxcore(name) for name in p.scenes)
        return each * len(p.scenes) + each_luxcore + (len(list(self._scaling_cases())) if p.scaling_scene else 0)

    # ------------------------------------------------------------ cells

    def _cell(self, label: str, key: str, make: Callable[[], tuple[dict[str, Any], Arrays]]) -> tuple[Any, Arrays]:
        """A measurement, from the folder when it was made before by the same code on the same machine."""
        self._progress.step(label)
        kept = self._cells.load(key)
        if kept is None:
            kept = make()
            self._cells.save(key, *kept)
        return kept

    def _reference(self, scene: Scene, target: Target, references: list[dict[str, Any]]) -> Halves:
        self._progress.step(f"{scene.name}: reference beams")
        truth = beam_reference(scene, target, self.plan.largest, self.plan.cells, self._truths)
        mean = float(truth.mean.mean())
        singular = ~regular(truth.mean)
        references.append(
            {
                "scene": scene.name,
                "source": truth.source,
                "pixels": self.plan.largest,
                "mean": mean,
                "noise": float(truth.noise) / mean,
                "singular_pixels": float(singular.mean()),
                "singular_flux": float(truth.mean[singular].sum() / truth.mean.sum()),
                "seconds": truth.seconds,
            }
        )
        self.images[f"{scene.name} reference"] = truth.mean
        return truth

    def _validation(self, scene: Scene, target: Target) -> dict[str, Any]:
        """Beams against Mitsuba, at a size at which Mitsuba's noise is small enough to see something."""
        self._progress.step(f"{scene.name}: Mitsuba against the beams")
        pixels = 64
        beams = reduced(beam_reference(scene, target, self.plan.largest, self.plan.cells, self._truths), pixels)
        photons = reduced(mitsuba_reference(scene, target, 2 * pixels, self.plan.validate, self._truths), pixels)
        return {"scene": scene.name, "source": photons.source, "pixels": pixels} | agreement(beams, photons)

    def _methods(self, scene: Scene, target: Target, truth: Halves) -> None:
        for size in self.plan.sizes:
            small = reduced(truth, size)
            for quality in self.plan.qualities:
                for method in ("none", *self.plan.methods):
                    case = Case(scene, target, method, quality, size, self.plan.backend)
                    self._ours(case, small)

    def _ours(self, case: Case, truth: Halves | None) -> dict[str, Any]:
        label = f"{case.scene.name}: {case.method} {case.quality} {case.pixels}^2"
        timing = vars(self.plan.timing)
        key = digest(self._code, scene_key(case.scene), case.method, case.quality, case.pixels, case.options, timing)

        def make() -> tuple[dict[str, Any], Arrays]:
            row, image = measure(case, self.plan.timing)
            return row, {"image": image}

        row, arrays = self._cell(label, key, make)
        if truth is not None:
            judged = case.method != "none"
            row["errors"] = errors(truth, arrays["image"]) if judged else {"non_finite": 0.0}
            self.rows.append(row)
            if judged and case.pixels == self.plan.largest:
                self.images[f"{case.scene.name} {case.method} {case.quality}"] = arrays["image"]
        return dict(row)

    def _picture(self, scene: Scene) -> None:
        method, quality = self.plan.methods[0], self.plan.qualities[-1]
        key = digest("picture", self._code, scene_key(scene), scene.name, method, quality)

        def make() -> tuple[dict[str, Any], Arrays]:
            return {}, {"ldr": picture(scene.name, method, quality, self.plan.backend)}

        _, arrays = self._cell(f"{scene.name}: picture", key, make)
        self.pictures[scene.name] = arrays["ldr"]

    # ------------------------------------------------------------ peers

    def _peers(self, scene: Scene, target: Target, truth: Halves) -> None:
        size, peer = self.plan.largest, None
        small = reduced(truth, size)
        with_denoiser = has_denoiser()
        if not with_denoiser and "Open Image Denoise is not installed: left out" not in self.notes:
            self.notes.append("Open Image Denoise is not installed: left out")
        for photons in self.plan.photons:
            key = digest("peer", 1, self._code, versions(), scene_key(scene), size, photons, with_denoiser)

            def make(photons: int = photons) -> tuple[dict[str, Any], Arrays]:
                nonlocal peer
                peer = peer or PtracerPeer(scene, target, size)
                row, image = peer.measure(photons)
                rows, arrays = {"ptracer": row}, {"ptracer": image}
                if with_denoiser:
                    rows["ptracer+oidn"], arrays["ptracer+oidn"] = peer.denoised(row, image)
                return rows, arrays

            rows, arrays = self._cell(f"{scene.name}: Mitsuba, {photons} photons", key, make)
            for method, row in rows.items():
                self.rows.append(row | {"errors": errors(small, arrays[method])})
                self.images[f"{scene.name} {method} {photons}"] = arrays[method]

    def _with_luxcore(self, name: str) -> bool:
        return self.peers and name in LUXCORE_SCENES and bool(self.plan.seconds) and has_luxcore()

    def _luxcore(self, scene: Scene, target: Target, truth: Halves) -> None:
        if not self._with_luxcore(scene.name):
            if scene.name in LUXCORE_SCENES and not has_luxcore():
                self.notes.append("pyluxcore is not installed (extra luxcore): LuxCore's LIGHTCPU is left out")
            return
        size, seconds = self.plan.largest, self.plan.seconds
        key = digest("luxcore", 1, self._code, versions(), scene_key(scene), size, seconds)

        def make() -> tuple[dict[str, Any], Arrays]:
            rows, images = luxcore_rows(scene, target, size, seconds)
            qualities = [row["quality"] for row in rows]
            return dict(zip(qualities, rows, strict=True)), dict(zip(qualities, images, strict=True))

        rows, arrays = self._cell(f"{scene.name}: LuxCore", key, make)
        small = reduced(truth, size)
        for quality, row in rows.items():
            self.rows.append(row | {"errors": errors(small, arrays[quality])})
            self.images[f"{scene.name} LIGHTCPU {quality}"] = arrays[quality]

    # ------------------------------------------------------------ scaling

    def _scaling_cases(self) -> list[tuple[str, float, Case]]:
        name = self.plan.scaling_scene
        if name is None:
            return []
        return scaling_cases(name, self.plan.methods, quick=self.plan.quick, backend=self.plan.backend)

    def _scaling(self) -> list[dict[str, Any]]:
        """Time against pixels, light samples and caster triangles; and error against time over the quality ladder."""
        series: dict[tuple[str, str], list[tuple[float, float]]] = {}
        for what, x, case in self._scaling_cases():
            row = self._ours(case, None)
            series.setdefault((what, case.method), []).append((x, row["time_ms"]["median"]))
        found = [
            {"what": what, "scene": self.plan.scaling_scene, "method": method, "points": points}
            | {"fit": fit_power(*zip(*points, strict=True))}
            for (what, method), points in series.items()
        ]
        missing = [m for m in self.plan.methods if samples_option(m) is None]
        if missing and self.plan.scaling_scene:
            self.notes.append(f"scaling with light samples is not measured for: {', '.join(missing)}")
        return found + self._error_against_time()

    def _error_against_time(self) -> list[dict[str, Any]]:
        groups: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
        for row in self.rows:
            if row["pixels"] == self.plan.largest and row["errors"].get("rrmse"):
                key = (row["scene"], row["tool"], row["method"])
                groups.setdefault(key, []).append((row["time_ms"]["median"], row["errors"]["rrmse"]))
        return [
            {"what": "error against time", "scene": scene, "tool": tool, "method": method, "points": sorted(points)}
            | {"fit": fit_power(*zip(*points, strict=True))}
            for (scene, tool, method), points in groups.items()
        ]

    # ------------------------------------------------------------ report

    def _report(
        self, references: list[Any], validation: list[Any], scaling: list[Any], seconds: float
    ) -> dict[str, Any]:
        opengl = next((r for r in self.rows if r["tool"] == "glcaustics"), None)
        plan = {k: v for k, v in vars(self.plan).items() if k != "timing"} | {"timing": vars(self.plan.timing)}
        return {
            "schema": SCHEMA,
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "command": self.command,
            "glcaustics": glcaustics.__version__,
            **commit(),
            "code": code_key(),
            "machine": machine() | {"gl_renderer": opengl["gl_renderer"] if opengl else None},
            "versions": versions(),
            "plan": plan,
            "seconds": round(seconds, 1),
            "notes": self.notes,
            "references": references,
            "validation": validation,
            "rows": self.rows,
            "pareto": self._fronts(),
            "scaling": scaling,
        }

    def _fronts(self) -> list[dict[str, Any]]:
        fronts = []
        for name in self.plan.scenes:
            rows = [r for r in self.rows if r["scene"] == name and r["pixels"] == self.plan.largest]
            rows = [r for r in rows if r["errors"].get("rrmse")]
            points = [(r["time_ms"]["median"], r["errors"]["rrmse"]) for r in rows]
            front = [{k: rows[i][k] for k in ("tool", "method", "quality")} for i in pareto(points)]
            fronts.append({"scene": name, "front": front})
        return fronts


def agreement(truth: Halves, other: Halves) -> dict[str, float | bool]:
    """Whether two references differ by their noise alone: relative RMSE against what chance explains, bias of the mean.

    `agree`: RMSE within 1.2 times the noise, and the bias under 0.5 % or three of its own standard errors.
    """
    mean = float(truth.mean.mean())
    difference = other.mean - truth.mean
    rrmse = float(np.sqrt(np.mean(difference**2))) / mean
    expected = float(np.hypot(truth.noise, other.noise)) / mean
    bias = float(difference.mean()) / mean
    bias_noise = 0.5 * abs(float(other.first.mean() - other.second.mean())) / mean
    sigma = max(bias_noise, expected / np.sqrt(truth.mean.size))
    ok = rrmse <= 1.2 * expected and abs(bias) <= max(0.005, 3.0 * sigma)
    return {
        "rrmse": rrmse,
        "expected_noise": expected,
        "ratio": rrmse / expected,
        "bias": bias,
        "bias_sigma": float(sigma),
        "agree": bool(ok),
    }
