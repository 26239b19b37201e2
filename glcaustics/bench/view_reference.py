"""The truth of E_c at a camera's pixels: float64 beams over the scene's analytic water, as two halves, from a cache."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from glcaustics.bench.references import BEAMS_VERSION
from glcaustics.bench.scene_export import beam_scene, renderer_events
from glcaustics.bench.store import Store, digest, scene_key
from glcaustics.optics.beam_scene import BeamScene, SurfaceKind
from glcaustics.optics.pixels import box_filter
from glcaustics.optics.raycast import RayCaster
from glcaustics.optics.reference import BeamSettings, trace_beams
from glcaustics.optics.view_receiver import PinholeView, ViewReceiver
from glcaustics.scene.model import Camera, Scene

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
LOOK_RAYS = 2  # per side of a pixel, to tell what it shows


@dataclass(frozen=True, eq=False)
class ViewReference:
    """Irradiance (H, W, 3) at a square picture's receivers, specular surfaces invisible, as two independent halves.

    `plain` (H, W): the pixel shows one surface alone; `direct` (H, W): the eye sees it past nothing specular.
    """

    first: FloatArray
    second: FloatArray
    plain: BoolArray
    direct: BoolArray
    seconds: float
    source: str

    @property
    def mean(self) -> FloatArray:
        return 0.5 * (self.first + self.second)

    @property
    def noise(self) -> float:
        """Relative root mean square error of `mean` by chance alone."""
        return float(np.sqrt(np.mean((0.5 * (self.first - self.second)) ** 2)) / self.mean.mean())

    def reduced(self, side: int) -> ViewReference:
        """The same in larger pixels; a flag holds where it holds for all of its pixels."""
        size = (side, side)
        flags = [box_filter(flag, size) > 1.0 - 1e-9 for flag in (self.plain, self.direct)]
        first, second = box_filter(self.first, size), box_filter(self.second, size)
        return ViewReference(first, second, flags[0], flags[1], self.seconds, self.source)


def pinhole_view(camera: Camera, side: int) -> PinholeView:
    """A perspective camera with a square picture."""
    return PinholeView(np.asarray(camera.world_from_camera, np.float64), math.tan(0.5 * camera.yfov_rad), side, side)


def view_reference(scene: Scene, side: int, cells: int, store: Store) -> ViewReference:
    """Reference at the scene's own camera at time 0, from the cache when it was traced before.

    Args:
        cells: of the light mesh, per side.

    Raises:
        UsageError: embreex is missing, or nothing in the scene is specular.
    """
    camera, settings = scene.view_at(0.0), BeamSettings(cells=cells, max_events=renderer_events(scene))
    view = [np.asarray(camera.world_from_camera), camera.yfov_rad, side]
    key = digest("view", BEAMS_VERSION, scene_key(scene), *view, vars(settings))
    source = f"float64 beams at the camera's pixels, light mesh of {cells}^2, two halves"
    if kept := store.load(key):
        a = kept[1]
        return ViewReference(a["first"], a["second"], a["plain"], a["direct"], 0.0, source)
    start = time.perf_counter()
    beams = beam_scene(scene)
    halves, plain = [], np.zeros(0, bool)
    for seed in (0, 1):
        receiver = ViewReceiver(beams, pinhole_view(camera, side))
        trace_beams(beams, receiver, BeamSettings(**{**vars(settings), "seed": seed}))
        halves.append(receiver.irradiance())
        plain = receiver.plain
    direct = _seen_directly(beams, pinhole_view(camera, side))
    arrays = {"first": halves[0], "second": halves[1], "plain": plain, "direct": direct}
    store.save(key, {"source": source}, arrays)
    return ViewReference(halves[0], halves[1], plain, direct, time.perf_counter() - start, source)


def _seen_directly(beams: BeamScene, view: PinholeView) -> BoolArray:
    """(H, W): every eye ray of the pixel meets a receiver first."""
    caster, kinds = RayCaster(beams), np.array([int(o.kind) for o in beams.optics()])
    direct = np.zeros((view.height, view.width), bool)
    rows = max(1, (1 << 20) // (view.width * LOOK_RAYS**2))
    for first in range(0, view.height, rows):
        part = slice(first, min(first + rows, view.height))
        direction, _ = view.rays(LOOK_RAYS, part)
        number = caster.first_hits(np.broadcast_to(view.eye_ws, direction.shape), direction).object_id
        diffuse = (number >= 0) & (kinds[number] == SurfaceKind.DIFFUSE)
        shape = (part.stop - part.start, LOOK_RAYS, view.width, LOOK_RAYS)
        direct[part] = diffuse.reshape(shape).all(axis=(1, 3))
    return direct
