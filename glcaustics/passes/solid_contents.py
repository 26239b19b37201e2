"""Whether closed solids of a scene may hold opaque things, or lie in walls: then the eye's rays may end in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glcaustics.passes.geometry import bounds_ws
from glcaustics.scene.model import FloatArray, Instance, OpticalKind

TOUCHES = 1e-4  # of a solid's box: what comes this near to a side of it touches it
STANDS_ON = 1  # sides of its box that a solid may touch: what stands on a floor is dry below, what fills a basin is not


def holds_opaque(instances: Sequence[Instance]) -> bool:
    """Whether a triangle of an opaque surface reaches into the box of a solid, or such surfaces touch more than one
    side of it. Boxes hold more than solids: what stands beside a ball counts, too, and only costs time.
    """
    opaque = [(i, bounds_ws(i)) for i in instances if i.optical_kind is OpticalKind.DIFFUSE]
    for solid in instances:
        if solid.optical_kind is not OpticalKind.SOLID:
            continue
        low, high = bounds_ws(solid)
        air = TOUCHES * float((high - low).max())
        touched: set[int] = set()
        for instance, box in opaque:
            if np.all((box[0] <= high + air) & (box[1] >= low - air)):
                reaches, sides = _contact(instance, low, high, air)
                touched |= sides
                if reaches or len(touched) > STANDS_ON:
                    return True
    return False


def triangle_boxes(instance: Instance) -> tuple[FloatArray, FloatArray]:
    """Least and greatest corners (N, 3) of the boxes around an instance's triangles, metres, world space."""
    corners = instance.positions_ws()[instance.mesh.triangles]
    return corners.min(axis=1), corners.max(axis=1)


def reach_into(least: FloatArray, most: FloatArray, low: FloatArray, high: FloatArray, air: FloatArray | float) -> bool:
    """Whether a box of (N, 3) `least` to `most` reaches into the box `low` to `high` by more than `air`, metres."""
    return bool(((least < high - air) & (most > low + air)).all(axis=1).any())


def _contact(instance: Instance, low: FloatArray, high: FloatArray, air: float) -> tuple[bool, set[int]]:
    """Whether a triangle reaches into a box by more than `air`, metres; sides (0-2 low, 3-5 high) that some touch."""
    least, most = triangle_boxes(instance)
    meets = np.all((least <= high + air) & (most >= low - air), axis=1)
    beside = np.concatenate((most[meets] <= low + air, least[meets] >= high - air), axis=1)
    return reach_into(least, most, low, high, air), set(np.flatnonzero(beside.any(axis=0)).tolist())
