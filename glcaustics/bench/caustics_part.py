"""Part "caustics": references, methods, peers and scaling of every scene with a target, cell by cell."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.analysis import cost_ms, fit_power, pareto
from glcaustics.bench.cells import Part
from glcaustics.bench.equal_error import equal_error
from glcaustics.bench.luxcore_peer import SCENES as LUXCORE_SCENES
from glcaustics.bench.luxcore_peer import has_luxcore, luxcore_rows
from glcaustics.bench.machine import versions
from glcaustics.bench.measure import Case, errors, measure, picture, reduced, regular
from glcaustics.bench.mitsuba_truth import Halves, PhotonMap, agreement, mitsuba_reference
from glcaustics.bench.peers import PtracerPeer, has_denoiser
from glcaustics.bench.plan import Plan
from glcaustics.bench.references import beam_reference
from glcaustics.bench.scaling import samples_option, scaling_cases
from glcaustics.bench.store import Arrays, scene_key
from glcaustics.bench.targets import Target, bench_scene, target_of
from glcaustics.caustics.registry import METHODS
from glcaustics.errors import UsageError
from glcaustics.scene.model import Scene

FloatArray = npt.NDArray[np.float64]


@dataclass(eq=False)
class CausticsPart(Part):
    """Measures the plan's scenes, methods, qualities and sizes.

    Raises:
        UsageError: a scene without a target, sizes that do not divide, or a package that is missing.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)

    def run(self) -> dict[str, Any]:
        """Measure everything; the report's keys of this part."""
        references: list[dict[str, Any]] = []
        validation: list[dict[str, Any]] = []
        for name in self.plan.scenes:
            scene, target = bench_scene(name), target_of(name)
            truth = self._reference(scene, target, references)
            if self.plan.validate:
                validation.append(self._validation(scene, target))
            self._methods(scene, target, truth)
            self._picture(scene)
            if self.peers:
                self._peers(scene, target, truth)
                self._luxcore(scene, target, truth)
        scaling = self._scaling()
        return {
            "references": references,
            "validation": validation,
            "rows": self.rows,
            "pareto": self._fronts(),
            "equal_error": equal_error(self.rows),
            "scaling": scaling,
        }

    def _reference(self, scene: Scene, target: Target, references: list[dict[str, Any]]) -> Halves:
        self.cells.step(f"{scene.name}: reference beams")
        truth = beam_reference(scene, target, self.plan.largest, self.plan.cells, self.cells.truths)
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
        self.cells.step(f"{scene.name}: Mitsuba against the beams")
        pixels = 64
        beams = reduced(beam_reference(scene, target, self.plan.largest, self.plan.cells, self.cells.truths), pixels)
        photons = reduced(mitsuba_reference(scene, target, 2 * pixels, self.plan.validate, self.cells.truths), pixels)
        return {"scene": scene.name, "source": photons.source, "pixels": pixels} | agreement(beams, photons)

    def _methods(self, scene: Scene, target: Target, truth: Halves) -> None:
        for size in self.plan.sizes:
            small = reduced(truth, size)
            for quality in self.plan.qualities:
                for method in ("none", *self.plan.methods):
                    frames = self.plan.frames if method in METHODS and METHODS[method].noisy else 1
                    case = Case(scene, target, method, quality, size, self.plan.backend, frames=frames)
                    self._ours(case, small)

    def _ours(self, case: Case, truth: Halves | None) -> dict[str, Any]:
        label = f"{case.scene.name}: {case.method} {case.quality} {case.pixels}^2"
        timing = vars(self.plan.timing)
        key = self.cells.key(
            scene_key(case.scene), case.method, case.quality, case.pixels, case.options, timing, case.frames
        )

        def make() -> tuple[dict[str, Any], Arrays]:
            row, image = measure(case, self.plan.timing)
            return row, {"image": image}

        row, arrays = self.cells.cell(label, key, make)
        if truth is not None:
            judged = case.method != "none"
            row["errors"] = errors(truth, arrays["image"]) if judged else {"non_finite": 0.0}
            self.rows.append(row)
            if judged and case.pixels == self.plan.largest:
                self.images[f"{case.scene.name} {case.method} {case.quality}"] = arrays["image"]
        return dict(row)

    def _picture(self, scene: Scene) -> None:
        method, quality = self.plan.methods[0], self.plan.qualities[-1]
        key = self.cells.key("picture", scene_key(scene), scene.name, method, quality)

        def make() -> tuple[dict[str, Any], Arrays]:
            return {}, {"ldr": picture(scene.name, method, quality, self.plan.backend)}

        _, arrays = self.cells.cell(f"{scene.name}: picture", key, make)
        self.pictures[scene.name] = arrays["ldr"]

    # ------------------------------------------------------------ peers

    def _peers(self, scene: Scene, target: Target, truth: Halves) -> None:
        size, peer = self.plan.largest, None
        small = reduced(truth, size)
        with_denoiser = has_denoiser()
        if not with_denoiser:
            self.cells.note("Open Image Denoise is not installed: left out")
        for photons in self.plan.photons:
            key = self.cells.key("peer", 2, versions(), scene_key(scene), size, photons, with_denoiser)

            def make(photons: int = photons) -> tuple[dict[str, Any], Arrays]:
                nonlocal peer
                peer = peer or PtracerPeer(scene.name, size, lambda: PhotonMap(scene, target, size))
                row, image = peer.measure(photons)
                rows, arrays = {"ptracer": row}, {"ptracer": image}
                if with_denoiser:
                    rows["ptracer+oidn"], arrays["ptracer+oidn"] = peer.denoised(row, image)
                return rows, arrays

            rows, arrays = self.cells.cell(f"{scene.name}: Mitsuba, {photons} photons", key, make)
            for method, row in rows.items():
                self.rows.append(row | {"errors": errors(small, arrays[method])})
                self.images[f"{scene.name} {method} {photons}"] = arrays[method]

    def _with_luxcore(self, name: str) -> bool:
        return self.peers and name in LUXCORE_SCENES and bool(self.plan.seconds) and has_luxcore()

    def _luxcore(self, scene: Scene, target: Target, truth: Halves) -> None:
        if not self._with_luxcore(scene.name):
            if scene.name in LUXCORE_SCENES and not has_luxcore():
                self.cells.note("pyluxcore is not installed (extra luxcore): LuxCore's LIGHTCPU is left out")
            return
        size, seconds = self.plan.largest, self.plan.seconds
        key = self.cells.key("luxcore", 1, versions(), scene_key(scene), size, seconds)

        def make() -> tuple[dict[str, Any], Arrays]:
            rows, images = luxcore_rows(scene, target, size, seconds)
            qualities = [row["quality"] for row in rows]
            return dict(zip(qualities, rows, strict=True)), dict(zip(qualities, images, strict=True))

        rows, arrays = self.cells.cell(f"{scene.name}: LuxCore", key, make)
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
            self.cells.note(f"scaling with light samples is not measured for: {', '.join(missing)}")
        return found + self._error_against_time()

    def _error_against_time(self) -> list[dict[str, Any]]:
        groups: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
        for row in self.rows:
            if row["pixels"] == self.plan.largest and row["errors"].get("rrmse"):
                key = (row["scene"], row["tool"], row["method"])
                groups.setdefault(key, []).append((cost_ms(row), row["errors"]["rrmse"]))
        return [
            {"what": "error against time", "scene": scene, "tool": tool, "method": method, "points": sorted(points)}
            | {"fit": fit_power(*zip(*points, strict=True))}
            for (scene, tool, method), points in groups.items()
        ]

    def _fronts(self) -> list[dict[str, Any]]:
        fronts = []
        for name in self.plan.scenes:
            rows = [r for r in self.rows if r["scene"] == name and r["pixels"] == self.plan.largest]
            rows = [r for r in rows if r["errors"].get("rrmse")]
            points = [(cost_ms(r), r["errors"]["rrmse"]) for r in rows]
            front = [{k: rows[i][k] for k in ("tool", "method", "quality")} for i in pareto(points)]
            fronts.append({"scene": name, "front": front})
        return fronts


def check_plan(plan: Plan) -> None:
    """Raises UsageError for a scene without a target, or sizes that do not divide the largest."""
    for size in plan.sizes:
        if plan.largest % size:
            remedy = "choose sizes that divide the largest"
            raise UsageError(f"size {size} does not divide {plan.largest}", where="--sizes", remedy=remedy)
    for name in plan.scenes:
        target_of(name)


def count_steps(plan: Plan, peers: bool) -> int:
    """How many cells and references `run` goes through, for the progress."""
    ours = (len(plan.methods) + 1) * len(plan.qualities) * len(plan.sizes)
    each = 2 + bool(plan.validate) + ours + (len(plan.photons) if peers else 0)
    luxcore = sum(peers and name in LUXCORE_SCENES and bool(plan.seconds) and has_luxcore() for name in plan.scenes)
    scaling = 0
    if plan.scaling_scene:
        scaling = len(scaling_cases(plan.scaling_scene, plan.methods, quick=plan.quick, backend=plan.backend))
    return each * len(plan.scenes) + luxcore + scaling
