"""Part "seen": the caustic as an eye sees it through water (paths L S D S E), against Mitsuba in two stages.

No integrator of Mitsuba's follows these paths from a directional light. Its irradiance at the receiver becomes the
receiver's emission, which `path` follows through the water; see mitsuba_seen. The truth is made so from the beams.
Ours is judged where the picture holds what the refracted ray meets; `solved` tells the share of its pixels.
"""

from __future__ import annotations

import math
import time
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics import metrics
from glcaustics.bench.cells import Measured, Part
from glcaustics.bench.equal_error import compare
from glcaustics.bench.machine import instrument_key, versions
from glcaustics.bench.measure import Timing, frame_ms, summary
from glcaustics.bench.mitsuba_seen import seen_radiance
from glcaustics.bench.mitsuba_truth import Halves, PhotonMap
from glcaustics.bench.mitsuba_variant import best_variant
from glcaustics.bench.peers import denoise, has_denoiser
from glcaustics.bench.plan import Plan, SeenPlan
from glcaustics.bench.references import beam_reference
from glcaustics.bench.store import digest, scene_key
from glcaustics.bench.targets import SPECULAR, Target, bench_scene, luminance, target_of
from glcaustics.optics.pixels import box_filter
from glcaustics.renderer import Renderer
from glcaustics.scene.model import Camera, Scene, Sky

FloatArray = npt.NDArray[np.float64]
ALBEDO = 0.5
OVERSAMPLING = 2  # ours is drawn this much larger a side and averaged, as Mitsuba averages over its pixels
SLANT_RAD, DISTANCE, SPAN = math.radians(25.0), 4.0, 0.45  # of the eye; in half sides of the target
METHOD = "auto"
SOLVED = (1, 5)  # of `solve_status`: the picture holds what the eye's ray meets
INSTRUMENTS = ("seen_part", "mitsuba_seen")  # whose code the cells depend on


def count_steps(plan: Plan) -> int:
    """How many steps `run` goes through."""
    return 1 + len(plan.seen.qualities) + len(plan.seen.peers)


def seen_scene(name: str, target: Target) -> Scene:
    """The bench's scene without sky, its receivers grey, and an eye that sees the target's middle through the water."""
    scene = bench_scene(name)
    instances = tuple(
        i
        if i.optical_kind in SPECULAR
        else replace(i, material=replace(i.material, base_color=(ALBEDO,) * 3, base_color_image=None))
        for i in scene.instances
    )
    black = (0.0, 0.0, 0.0)
    middle = np.asarray(target.centre_ws, np.float64)
    away = np.array([0.0, math.cos(SLANT_RAD), math.sin(SLANT_RAD)])
    eye = middle + DISTANCE * target.half_m * away
    camera = Camera.look_at(tuple(eye), target.centre_ws, (0, 1, 0), yfov_rad=2.0 * math.atan(SPAN / DISTANCE))
    return replace(scene, instances=instances, sky=Sky(black, black, black), camera=camera, camera_at=None)


class SeenPart(Part):
    """Measures the seen plan's scene."""

    @property
    def settings(self) -> SeenPlan:
        return self.plan.seen

    def run(self) -> dict[str, Any]:
        """The report's key of this part: `seen`."""
        p = self.settings
        target = target_of(p.scene)
        scene = seen_scene(p.scene, target)
        truth = self._truth(scene, target)
        self.images[f"{p.scene} seen reference"] = truth.mean
        raw, clean = self._peers(scene, target, truth) if self.peers else ([], [])
        ours = []
        for quality in p.qualities:
            row, arrays = self._ours(scene, quality)
            image, solved = arrays["image"], arrays["solved"]
            error = metrics.relative_rmse(truth.first, image, other_half=truth.second, mask=solved)
            bias = metrics.bias_of_mean(truth.mean, image, mask=solved)
            entry = compare(error, row["time_ms"]["median"], raw, clean)
            ours.append(entry | row | {"bias": bias, "quality": quality})
            self.images[f"{p.scene} seen {quality}"] = image
        rows = [
            {"photons": r["photons"], "spp": r["spp"], "ms": r["time_ms"]["median"], "rrmse": r["errors"]["rrmse"]}
            | {"method": r["method"]}
            for r in (*raw, *clean)
        ]
        seen = {
            "scene": p.scene,
            "settings": asdict(p),
            "source": truth.source,
            "noise": float(truth.noise / truth.mean.mean()),
            "ours": ours,
            "peers": rows,
        }
        return {"seen": seen}

    def _truth(self, scene: Scene, target: Target) -> Halves:
        """Radiance (H, W), luminance: beams, then Mitsuba's `path`; two halves of both."""
        p = self.settings
        self.cells.step(f"{p.scene}: reference through the water")
        source = f"float64 beams at {p.map_side}^2, then Mitsuba path ({best_variant()}), 2 x {p.spp} samples a pixel"
        pose = np.asarray(scene.camera.world_from_camera)
        key = digest(
            "seen",
            instrument_key(*INSTRUMENTS),
            scene_key(scene),
            pose,
            scene.camera.yfov_rad,
            asdict(p),
            self.plan.cells,
            source,
        )
        if kept := self.cells.truths.load(key):
            return Halves(kept[1]["first"], kept[1]["second"], 0.0, source)
        start = time.perf_counter()
        beams = beam_reference(bench_scene(p.scene), target, p.map_side, self.plan.cells, self.cells.truths)
        size = (p.side, p.side)
        halves = [
            seen_radiance(scene, target, each, scene.camera, size, albedo=ALBEDO, spp=p.spp, seed=seed)
            for seed, each in ((1, beams.first), (2, beams.second))
        ]
        self.cells.truths.save(key, {"source": source}, {"first": halves[0], "second": halves[1]})
        return Halves(halves[0], halves[1], time.perf_counter() - start, source)

    def _ours(self, scene: Scene, quality: str) -> Measured:
        p = self.settings
        timing: Timing = self.plan.timing

        def make() -> Measured:
            size = (OVERSAMPLING * p.side, OVERSAMPLING * p.side)
            with Renderer(
                scene, size, METHOD, quality, self.cells.backend, aovs=("solve_status",), stats=False, keep=False
            ) as renderer:
                renderer.render()
                times = summary(timing.run(lambda: frame_ms(renderer)), renderer.device.timer_kind)
                frame = renderer.render()
            solved = np.isin(frame.aov["solve_status"], SOLVED)
            arrays = {
                "image": box_filter(luminance(frame.image), (p.side, p.side)),
                "solved": box_filter(solved, (p.side, p.side)) > 1.0 - 1e-9,
            }
            return {"time_ms": times, "pixels": p.side, "solved": float(arrays["solved"].mean())}, arrays

        key = self.cells.key("seen", instrument_key(*INSTRUMENTS), scene_key(scene), asdict(p), vars(timing), quality)
        return self.cells.cell(f"{p.scene} through the water: {quality}", key, make)

    def _peers(self, scene: Scene, target: Target, truth: Halves) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        """Both stages by Mitsuba, photons and samples a pixel growing together; raw, and the picture denoised."""
        p = self.settings
        lists: dict[str, list[dict[str, Any]]] = {"ptracer": [], "ptracer+oidn": []}
        tracer: PhotonMap | None = None
        with_denoiser = has_denoiser()
        for count, spp in p.peers:

            def make(count: int = count, spp: int = spp) -> Measured:
                nonlocal tracer
                if tracer is None:
                    tracer = PhotonMap(bench_scene(p.scene), target, p.map_side)
                    tracer.render(1, seed=99)  # compiles the kernels, of the second stage too
                    seen_radiance(
                        scene, target, truth.mean, scene.camera, (p.side, p.side), albedo=ALBEDO, spp=1, seed=99
                    )
                return self._two_stages(scene, target, tracer, count, spp, with_denoiser)

            key = self.cells.key(
                "seen peer",
                instrument_key(*INSTRUMENTS),
                versions(),
                scene_key(scene),
                asdict(p),
                count,
                spp,
                with_denoiser,
            )
            rows, arrays = self.cells.cell(f"{p.scene} through the water: Mitsuba, {count} photons", key, make)
            for method, row in rows.items():
                error = metrics.relative_rmse(truth.first, arrays[method], other_half=truth.second)
                lists[method].append(row | {"errors": {"rrmse": error}})
        return lists["ptracer"], lists["ptracer+oidn"]

    def _two_stages(
        self, scene: Scene, target: Target, tracer: PhotonMap, count: int, spp: int, with_denoiser: bool
    ) -> Measured:
        p, tracer.seconds = self.settings, 0.0
        irradiance = tracer.render(count, seed=31)
        start = time.perf_counter()
        image = seen_radiance(
            scene, target, irradiance, scene.camera, (p.side, p.side), albedo=ALBEDO, spp=spp, seed=31
        )
        middle = time.perf_counter()
        raw_ms = 1e3 * (tracer.seconds + middle - start)
        row = {"method": "ptracer", "photons": tracer.photons(count), "spp": spp}
        rows = {"ptracer": row | {"time_ms": summary([raw_ms], "wall clock")}}
        arrays = {"ptracer": image}
        if with_denoiser:
            arrays["ptracer+oidn"] = denoise(image)
            ms = raw_ms + 1e3 * (time.perf_counter() - middle)
            rows["ptracer+oidn"] = row | {"method": "ptracer+oidn", "time_ms": summary([ms], "wall clock")}
        return rows, arrays
