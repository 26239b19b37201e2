"""The truth of a target: float64 beams, kept as two halves and by content."""

from __future__ import annotations

import time

import numpy as np

from glcaustics.bench.mitsuba_truth import Halves
from glcaustics.bench.scene_export import beam_scene
from glcaustics.bench.store import Store, digest, scene_key
from glcaustics.bench.targets import Target, luminance
from glcaustics.optics.receivers import PlaneGrid
from glcaustics.optics.reference import BeamSettings, reference_map
from glcaustics.scene.model import Scene

BEAMS_VERSION = 1  # of the cache: raise it when the beams' results change


def beam_grid(target: Target, pixels: int) -> PlaneGrid:
    """The target's pixels as the beams take them."""
    x, y, z = target.centre_ws
    return PlaneGrid.floor(target.half_m, y, pixels, (x, z))


def beam_reference(scene: Scene, target: Target, pixels: int, cells: int, store: Store) -> Halves:
    """Luminance of irradiance by beams of a light mesh of `cells`^2, from the cache when it was traced before."""
    settings = BeamSettings(cells=cells, max_events=target.interfaces)
    key = digest("beams", BEAMS_VERSION, scene_key(scene), list(vars(target).values()), pixels, vars(settings))
    source = f"float64 beams, light mesh of {cells}^2, two halves"
    if kept := store.load(key):
        return Halves(kept[1]["first"], kept[1]["second"], 0.0, source)
    start = time.perf_counter()
    found = reference_map(beam_scene(scene), beam_grid(target, pixels), settings, check_step=False)
    halves = Halves(luminance(found.half_a), luminance(found.half_b), time.perf_counter() - start, source)
    document = {"source": source, "noise": float(halves.noise), "mean": float(np.mean(halves.mean))}
    store.save(key, document, {"first": halves.first, "second": halves.second})
    return halves
