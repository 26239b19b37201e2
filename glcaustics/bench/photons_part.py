"""Part "photons": photon_trace in the flooded scenes, where the light does not see all that it reaches."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics import metrics
from glcaustics.bench.cells import Measured, Part
from glcaustics.bench.equal_error import compare
from glcaustics.bench.flicker import pan_flicker
from glcaustics.bench.machine import instrument_key, versions
from glcaustics.bench.measure import flip_of
from glcaustics.bench.mitsuba_truth import Halves, agreement
from glcaustics.bench.mitsuba_view import ViewPtracer, view_ptracer_reference
from glcaustics.bench.peers import PtracerPeer, has_denoiser
from glcaustics.bench.photons import (
    KEPT_FRAMES,
    METHOD,
    QUALITY,
    photon_options,
    picture_with,
    stage_table,
    static_frames,
)
from glcaustics.bench.plan import PhotonPlan, Plan
from glcaustics.bench.store import scene_key
from glcaustics.bench.targets import bench_scene, luminance
from glcaustics.bench.view_reference import ViewReference, view_reference
from glcaustics.caustics.registry import METHODS
from glcaustics.scene.load import load_scene
from glcaustics.scene.model import Scene

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
VALIDATION_SIDE = 64
INSTRUMENTS = ("photons", "given")  # whose code the cells depend on


def count_steps(plan: Plan, peers: bool) -> int:
    """How many steps `run` goes through."""
    p = plan.photon
    each = 4 + 3 * len(p.photons) + (len(p.peer_photons) if peers else 0) + bool(plan.validate)
    return each * len(p.scenes)


@dataclass(eq=False)
class PhotonsPart(Part):
    """Measures the photon plan's scenes."""

    _kept: dict[str, Measured] = field(default_factory=dict)

    @property
    def settings(self) -> PhotonPlan:
        return self.plan.photon

    def run(self) -> dict[str, Any]:
        """The report's keys of this part: `photons`, one entry a scene."""
        found = [self._scene(load_scene(name)) for name in self.settings.scenes]
        return {"photons": found}

    def _scene(self, scene: Scene) -> dict[str, Any]:
        self.cells.step(f"{scene.name}: reference beams at the camera's pixels")
        p = self.settings
        truth = view_reference(scene, p.side, p.cells, self.cells.truths)
        small = truth.reduced(p.filtered)
        self.images[f"{scene.name} view reference"] = luminance(small.mean)
        found: dict[str, Any] = {
            "scene": scene.name,
            "settings": asdict(p),
            "reference": {
                "source": truth.source,
                "seconds": truth.seconds,
                "noise": small.noise,
                "mean": float(small.mean.mean()),
                "plain": float(small.plain.mean()),
                "direct": float((small.plain & small.direct).mean()),
            },
            "validation": self._validation(scene, truth) if self.plan.validate else None,
            "static": self._static(scene, small),
            "final": self._final(scene, truth),
            "stages": self._stages(scene),
            "flicker": self._flicker(scene),
        }
        if self.peers:
            found["equal"] = self._equal(scene, small)
        return found

    def _key(self, scene: Scene, *parts: Any) -> str:
        camera = scene.view_at(0.0)
        return self.cells.key(
            "photons",
            instrument_key(*INSTRUMENTS),
            scene.name,
            scene_key(scene),
            np.asarray(camera.world_from_camera),
            *parts,
        )

    # -- the reference ------------------------------------------------------------------------------------------------

    def _validation(self, scene: Scene, truth: ViewReference) -> dict[str, Any]:
        """The beams against Mitsuba on what the eye sees directly, in pixels large enough to see something."""
        self.cells.step(f"{scene.name}: Mitsuba against the beams")
        small = truth.reduced(VALIDATION_SIDE)
        other = view_ptracer_reference(
            bench_scene(scene.name), VALIDATION_SIDE, self.settings.validate, self.cells.truths
        )
        mask = small.plain & small.direct
        beams = Halves(luminance(small.first)[mask][:, None], luminance(small.second)[mask][:, None])
        photons = Halves(other.first[mask][:, None], other.second[mask][:, None])
        return {"source": other.source, "pixels": VALIDATION_SIDE, "share": float(mask.mean())} | agreement(
            beams, photons
        )

    # -- frames of a still --------------------------------------------------------------------------------------------

    def _frames(self, scene: Scene, side: int, photons: int | None) -> Measured:
        """Of so many photons and the plan's light views; None: of the quality as it is."""
        p = self.settings
        options = {} if photons is None else photon_options(photons, p.view_size)
        options = {name: value for name, value in options.items() if METHODS[METHOD].ladder[QUALITY].get(name) != value}
        what = f"{QUALITY} quality" if photons is None else f"{photons} photons"

        def make() -> Measured:
            return static_frames(scene, side, p.filtered, p.frames, options, self.cells.backend)

        key = self._key(scene, "frames", side, p.filtered, p.frames, options)
        if key in self._kept:
            return self._kept[key]
        self._kept[key] = found = self.cells.cell(f"{scene.name}: {p.frames} frames, {what}, {side}^2", key, make)
        return found

    def _static(self, scene: Scene, truth: ViewReference) -> list[dict[str, Any]]:
        """Errors of irradiance, all channels, over all pixels and over those that show one surface alone."""
        p, found = self.settings, []
        for photons in p.photons:
            document, arrays = self._frames(scene, p.side, photons)
            series = [{"frames": number, **_errors(truth, arrays[f"frame {number}"])} for number in self._kept_frames()]
            found.append({"photons": photons, "side": p.side, **document, "series": series, **series[-1]})
            self.images[f"{scene.name} view {photons}"] = luminance(arrays[f"frame {p.frames}"])
        return found

    def _kept_frames(self) -> list[int]:
        last = self.settings.frames
        return sorted({number for number in KEPT_FRAMES if number < last} | {last})

    # -- the final picture --------------------------------------------------------------------------------------------

    def _final(self, scene: Scene, truth: ViewReference) -> list[dict[str, Any]]:
        """LDR-FLIP of the picture against the same renderer's picture with the reference's irradiance in it."""
        reference = self._picture(scene, "the reference", truth.mean)
        self.pictures[f"{scene.name} with the reference"] = reference
        found = []
        for photons in self.settings.photons:
            irradiance = self._frames(scene, self.settings.side, photons)[1]["last"]
            ldr = self._picture(scene, f"{photons} photons", irradiance)
            self.pictures[f"{scene.name} {photons} photons"] = ldr
            found.append({"photons": photons, "flip": flip_of(reference / 255.0, ldr / 255.0)})
        return found

    def _picture(self, scene: Scene, what: str, irradiance: npt.NDArray[np.floating]) -> npt.NDArray[np.uint8]:
        def make() -> Measured:
            return {}, {"ldr": picture_with(scene, irradiance, self.cells.backend)}

        key = self._key(scene, "picture", np.asarray(irradiance, np.float32))
        ldr: npt.NDArray[np.uint8] = self.cells.cell(f"{scene.name}: picture, {what}", key, make)[1]["ldr"]
        return ldr

    def _flicker(self, scene: Scene) -> dict[str, Any]:
        """Of a pan over still light: the filter and plainer means."""
        plan = self.settings.flicker

        def make() -> Measured:
            return pan_flicker(scene, plan, self.cells.backend), {"none": np.zeros(0)}

        key = self._key(scene, "flicker", instrument_key("flicker"), asdict(plan))
        return self.cells.cell(f"{scene.name}: flicker while the camera pans", key, make)[0]

    # -- cost ---------------------------------------------------------------------------------------------------------

    def _stages(self, scene: Scene) -> list[dict[str, Any]]:
        p, found = self.settings, []
        for photons in p.photons:

            def make(photons: int = photons) -> Measured:
                rows = stage_table(scene, p.table_size, [photons], p.view_size, p.table_frames, self.cells.backend)
                return {"rows": rows}, {"none": np.zeros(0)}

            key = self._key(scene, "stages", p.table_size, photons, p.view_size, p.table_frames)
            found += self.cells.cell(f"{scene.name}: cost of {photons} photons", key, make)[0]["rows"]
        return found

    # -- peers --------------------------------------------------------------------------------------------------------

    def _equal(self, scene: Scene, truth: ViewReference) -> dict[str, Any]:
        """Ours and Mitsuba at `filtered`^2 on the pixels that Mitsuba can show: seen directly, one surface alone."""
        p, mask = self.settings, truth.plain & truth.direct
        halves = Halves(luminance(truth.first), luminance(truth.second))
        rows: list[dict[str, Any]] = []
        clean_rows: list[dict[str, Any]] = []
        for row, image in self._peer_rows(scene):
            clock = {"median": row["processor_ms"]}  # of all threads: a busy machine slows one tool and not the other
            row = row | {"errors": {"rrmse": _masked(halves, image, mask)}, "time_ms": clock}
            (clean_rows if "oidn" in row["method"] else rows).append(row)
        ours = []
        document, arrays = self._frames(scene, p.filtered, None)
        for number in self._kept_frames():
            error = _masked(halves, luminance(arrays[f"frame {number}"]), mask)
            entry = compare(error, number * document["processor_ms"], rows, clean_rows)
            ours.append(entry | {"frames": number, "quality": QUALITY})
        return {
            "pixels": p.filtered,
            "share": float(mask.mean()),
            "ours": ours,
            "ptracer": [_point(row) for row in rows],
            "ptracer+oidn": [_point(row) for row in clean_rows],
        }

    def _peer_rows(self, scene: Scene) -> list[tuple[dict[str, Any], FloatArray]]:
        p, peer, found = self.settings, None, []
        with_denoiser = has_denoiser()
        clear = bench_scene(scene.name)
        for photons in p.peer_photons:

            def make(photons: int = photons) -> Measured:
                nonlocal peer
                peer = peer or PtracerPeer(scene.name, p.filtered, lambda: ViewPtracer(clear, p.filtered))
                row, image = peer.measure(photons)
                rows, arrays = {"ptracer": row}, {"ptracer": image}
                if with_denoiser:
                    rows["ptracer+oidn"], arrays["ptracer+oidn"] = peer.denoised(row, image)
                return rows, arrays

            key = self._key(scene, "peer", versions(), p.filtered, photons, with_denoiser)
            rows, arrays = self.cells.cell(f"{scene.name}: Mitsuba, {photons} photons", key, make)
            found += [(row, arrays[method]) for method, row in rows.items()]
        return found


def _errors(truth: ViewReference, image: npt.NDArray[np.floating]) -> dict[str, float]:
    return {
        "rrmse": metrics.relative_rmse(truth.first, image, other_half=truth.second),
        "rrmse_plain": metrics.relative_rmse(truth.first, image, other_half=truth.second, mask=truth.plain),
        "bias": metrics.bias_of_mean(truth.mean, image),
    }


def _masked(truth: Halves, image: FloatArray, mask: BoolArray) -> float:
    return metrics.relative_rmse(truth.first, image, other_half=truth.second, mask=mask)


def _point(row: dict[str, Any]) -> dict[str, float]:
    return {"photons": row["photons"], "ms": row["time_ms"]["median"], "rrmse": row["errors"]["rrmse"]}
