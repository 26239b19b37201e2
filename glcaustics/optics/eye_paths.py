"""Eye rays through specular surfaces to the receiver points that they show (E D and E S+ D), in float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from glcaustics.optics.beam_paths import PathTracer
from glcaustics.optics.beam_scene import BeamScene
from glcaustics.optics.raycast import RayCaster

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class EyeHits:
    """What n eye rays show: `found` (n,) whether a receiver was met; `point_ws`, `normal_ws` (n, 3), the normal on the
    side that the eye's path comes from; `throughput` (n, 3): Fresnel and absorption along the path, without the
    radiance scale of the interfaces."""

    found: npt.NDArray[np.bool_]
    point_ws: FloatArray
    normal_ws: FloatArray
    throughput: FloatArray


def eye_hits(scene: BeamScene, origin_ws: FloatArray, direction_ws: FloatArray, max_events: int = 2) -> EyeHits:
    """First non-specular point along each ray: straight, else refracted at every interface, else reflected once.

    Args:
        origin_ws, direction_ws: (n, 3), unit directions. max_events: interfaces passed at most.

    Raises:
        UsageError: embreex is not installed.
    """
    tracer = PathTracer(scene, RayCaster(scene))
    n = len(origin_ws)
    result = EyeHits(np.zeros(n, bool), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)))
    for branch in ("", *("T" * k for k in range(1, max_events + 1)), "R"):
        open_rays = np.flatnonzero(~result.found)
        if open_rays.size == 0:
            break
        landed = tracer.follow(origin_ws[open_rays], direction_ws[open_rays], branch, from_light=False)
        good = landed.signature >= 0
        index = open_rays[good]
        result.found[index] = True
        result.point_ws[index], result.normal_ws[index] = landed.point_ws[good], landed.normal_ws[good]
        result.throughput[index] = landed.throughput[good]
    return result
