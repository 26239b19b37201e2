"""Part "mesh": the displaced mesh on `peer-pool` as published implementations were measured: refined, and with folds.

The eye looks straight down past the water; pictures are box filtered to BINS^2 over |x|, |z| < 1 m and divided by the
mean over |x|, |z| < 0.75 m. Truth: float64 beams over the water's formula, two halves; their noise is off the RMSE.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics import metrics
from glcaustics.bench.cells import Measured, Part
from glcaustics.bench.machine import instrument_key
from glcaustics.bench.mitsuba_truth import Halves
from glcaustics.bench.plan import MeshPlan, Plan
from glcaustics.bench.references import BEAMS_VERSION
from glcaustics.bench.scene_export import beam_scene
from glcaustics.bench.store import digest, scene_key
from glcaustics.bench.targets import luminance
from glcaustics.optics.pixels import box_filter
from glcaustics.optics.receivers import PlaneGrid
from glcaustics.optics.reference import BeamSettings, reference_map
from glcaustics.renderer import Renderer
from glcaustics.scene.load import load_scene
from glcaustics.scene.model import Camera, Scene

FloatArray = npt.NDArray[np.float64]
METHOD, QUALITY = "displaced_mesh", "high"
BINS, INNER = 512, 64  # bins a side, and those cut off at each edge
SLANTED = (0.2, -1.0, 0.1)
INSTRUMENTS = ("mesh_part",)  # whose code the cells depend on


def count_steps(plan: Plan) -> int:
    """How many steps `run` goes through."""
    return 2 + len(plan.mesh.smooth) + len(plan.mesh.folded)


def peer_pool(strength: float) -> Scene:
    """`peer-pool` with its slanted light and its waves times `strength`, seen from straight above."""
    changes = {"water[0].amplitude_scale": strength, "light[0].direction": list(SLANTED)}
    above = Camera.look_at((0.0, 2.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), orthographic=True, ymag_m=1.0)
    return replace(load_scene("peer-pool", changes), camera=above)


def inner(image: FloatArray) -> FloatArray:
    """|x|, |z| < 0.75 m."""
    return image[INNER:-INNER, INNER:-INNER]


class MeshPart(Part):
    """Measures the mesh plan's sizes, (mesh, map) each."""

    @property
    def settings(self) -> MeshPlan:
        return self.plan.mesh

    def run(self) -> dict[str, Any]:
        """The report's key of this part: `mesh`."""
        rows, noise = [], {}
        for strength, sizes in ((1.0, self.settings.smooth), (2.0, self.settings.folded)):
            truth = self._truth(strength)
            noise[f"s={strength:g}"] = float(truth.noise / truth.mean.mean())
            rows += [self._row(strength, size, truth) for size in sizes]
        orders = _orders([row for row in rows if row["strength"] == 1.0])
        return {"mesh": {"rows": rows, "noise": noise, "orders": orders, "pixels": self.settings.pixels}}

    def _truth(self, strength: float) -> Halves:
        """Luminance of irradiance (inner bins), two halves."""
        self.cells.step(f"peer-pool, s={strength:g}: reference beams")
        scene, settings = peer_pool(strength), BeamSettings(cells=self.settings.cells, max_events=1)
        key = digest("mesh", BEAMS_VERSION, scene_key(scene), BINS, vars(settings))
        kept = self.cells.truths.load(key)
        if kept is None:
            grid = PlaneGrid.floor(1.0, -1.0, BINS)
            found = reference_map(beam_scene(scene), grid, settings, check_step=False)
            arrays = {"first": inner(luminance(found.half_a)), "second": inner(luminance(found.half_b))}
            kept = {"noise": found.noise, "cells": self.settings.cells}, arrays
            self.cells.truths.save(key, *kept)
        return Halves(kept[1]["first"], kept[1]["second"])

    def _row(self, strength: float, size: tuple[int, int], truth: Halves) -> dict[str, Any]:
        image = inner(self._render(strength, size))
        scaled = image / image.mean()
        first, second = (half / truth.mean.mean() for half in (truth.first, truth.second))
        row = {
            "strength": strength,
            "mesh": size[0],
            "map": size[1],
            "rrmse": metrics.relative_rmse(first, scaled, other_half=second),
            "mae": metrics.mean_absolute_error(0.5 * (first + second), scaled),
            "bias": float(image.mean() / truth.mean.mean() - 1.0),
        }
        return row

    def _render(self, strength: float, size: tuple[int, int]) -> FloatArray:
        """Irradiance (BINS, BINS), luminance."""
        scene, pixels = peer_pool(strength), self.settings.pixels
        options = {"caster_size": size[0], "map_size": size[1]}

        def make() -> Measured:
            with Renderer(
                scene,
                (pixels, pixels),
                METHOD,
                QUALITY,
                self.cells.backend,
                aovs=("caustic_irradiance",),
                specular_view=False,
                options=options,
                stats=False,
            ) as renderer:
                image = luminance(renderer.render().aov["caustic_irradiance"])
            return {"options": options}, {"image": box_filter(image, (BINS, BINS)).astype(np.float32)}

        key = self.cells.key("mesh", instrument_key(*INSTRUMENTS), scene_key(scene), pixels, options)
        label = f"peer-pool, s={strength:g}: mesh {size[0]}^2, map {size[1]}^2"
        return self.cells.cell(label, key, make)[1]["image"].astype(np.float64)


def _orders(rows: Sequence[dict[str, Any]]) -> list[float]:
    """log2 of the error's fall from each size to the next, both sides of mesh and map doubled."""
    return [math.log2(a["rrmse"] / b["rrmse"]) for a, b in zip(rows, rows[1:], strict=False) if b["rrmse"] > 0.0]
