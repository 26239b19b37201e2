"""Which receivers lie under a sheet of water, and whether opaque things reach into solids."""

from __future__ import annotations

import numpy as np
import pytest

from glcaustics.caustics.solid_views import receivers_inside_solids
from glcaustics.passes.receiver_views import points_under
from glcaustics.scene.model import Instance
from tests.gpu.feature_scenes import GLASS, WHITE, box_mesh, plane, translation


def test_a_floor_cut_by_the_plane_counts_with_the_cut() -> None:
    """Of a square floor, a plane that cuts a corner off leaves a triangle: its hull, not its one vertex."""
    normal = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
    found = points_under([plane("floor", 2.0)], (*normal, -np.sqrt(2.0)))  # x + z > 2
    corners = {tuple(p) for p in np.round(found, 6).tolist()}
    assert {(2.0, 0.0, 2.0), (0.0, 0.0, 2.0), (2.0, 0.0, 0.0)} <= corners
    assert (found @ normal >= np.sqrt(2.0) - 1e-9).all()


def test_nothing_lies_under_a_plane_below_all() -> None:
    assert points_under([plane("floor", 2.0)], (0.0, -1.0, 0.0, -1.0)).shape == (0, 3)


@pytest.mark.parametrize(("sunk_m", "expected"), [(0.0, False), (0.1, True), (-0.1, False)])
def test_only_what_reaches_into_a_solid_may_end_light_there(sunk_m: float, expected: bool) -> None:
    block = Instance("block", box_mesh("block", (1.0, 1.0, 1.0)), GLASS, translation(0.0, 0.5 - sunk_m, 0.0))
    assert receivers_inside_solids((plane("floor", 4.0), block)) is expected
    assert not receivers_inside_solids((plane("floor", 4.0),))
    stone = Instance("stone", box_mesh("stone", (0.1, 0.1, 0.1)), WHITE, translation(0.2, 0.5 - sunk_m, 0.0))
    assert receivers_inside_solids((plane("floor", 4.0), block, stone))
