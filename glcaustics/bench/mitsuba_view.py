"""Irradiance by Mitsuba's `ptracer` at the pixels of a scene's own camera: of all that it sees directly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from glcaustics.bench.mitsuba_camera import camera_sensor
from glcaustics.bench.mitsuba_truth import MITSUBA_VERSION, Halves, Ptracer, larger_scene
from glcaustics.bench.mitsuba_variant import best_variant
from glcaustics.bench.store import Store, digest, scene_key
from glcaustics.scene.model import Scene

FloatArray = npt.NDArray[np.float64]
HALF_M = 20.0  # of the casters and receivers as Mitsuba gets them, see mitsuba_truth


class ViewPtracer(Ptracer):
    """Caustic irradiance (P, P), luminance, as the scene's camera sees it in a square picture.

    `ptracer` joins photons to the eye by straight lines: what lies behind water or glass stays black. Light meets one
    interface. `scene`: see `targets.bench_scene`.
    """

    def __init__(self, scene: Scene, pixels: int, variant: str | None = None) -> None:
        points = np.concatenate([i.positions_ws() for i in scene.instances_at(0.0)])
        low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
        factor = 2.0 * HALF_M / float((high - low).max())
        larger, move = larger_scene(scene, factor, 0.5 * (low + high))
        camera = scene.view_at(0.0)
        pose = np.array(camera.world_from_camera, np.float64)
        pose[:3, 3] = (move @ pose[:, 3])[:3]
        placed = replace(camera, world_from_camera=pose)
        super().__init__(larger, lambda mi: camera_sensor(mi, placed, (pixels, pixels)), (pixels, pixels), 1, variant)


def view_ptracer_reference(scene: Scene, pixels: int, photons: int, store: Store) -> Halves:
    """Two halves of `photons` photons each, from the cache when the same was rendered before."""
    variant = best_variant()
    camera = scene.view_at(0.0)
    view = [np.asarray(camera.world_from_camera), camera.yfov_rad]
    key = digest("mitsuba view", MITSUBA_VERSION, scene_key(scene), *view, pixels, photons, variant)
    source = f"Mitsuba ptracer ({variant}), 2 x {photons / 1e6:g} M photons"
    if kept := store.load(key):
        return Halves(kept[1]["first"], kept[1]["second"], 0.0, source)
    tracer = ViewPtracer(scene, pixels, variant)
    first, second = (tracer.render(photons, seed) for seed in (1001, 2002))
    store.save(key, {"source": source}, {"first": first, "second": second})
    return Halves(first, second, tracer.seconds, source)
