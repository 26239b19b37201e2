"""The scenes of the GPU physics tests are what their truths say: closed, finely meshed, rightly oriented, in view."""

from __future__ import annotations

import numpy as np
import pytest

from glcaustics.scene.mesh_tools import is_watertight, signed_volume
from glcaustics.scene.model import OpticalKind
from tests.gpu.physics_meshes import cylinder_wall, grid_triangles, icosphere
from tests.gpu.physics_scenes import CASES, eroded

KINDS = {"flat": OpticalKind.INTERFACE, "sine": OpticalKind.INTERFACE, "sphere": OpticalKind.SOLID}


def test_icosphere_is_a_closed_sphere() -> None:
    mesh = icosphere("s", 0.5, 80)
    assert len(mesh.triangles) == 20 * 80**2 >= 100_000
    assert len(mesh.positions_m) == 10 * 80**2 + 2
    assert is_watertight(mesh.positions_m, mesh.triangles)
    assert signed_volume(mesh.positions_m, mesh.triangles) == pytest.approx(4 / 3 * np.pi * 0.125, rel=1e-3)
    np.testing.assert_allclose(mesh.positions_m / 0.5, mesh.normals, atol=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_case(name: str) -> None:
    case = CASES[name]()
    floor, caster = case.scene.instances
    mesh = caster.mesh
    assert floor.optical_kind is OpticalKind.DIFFUSE
    assert caster.optical_kind is KINDS.get(name.split("-")[0], OpticalKind.MIRROR)
    points = mesh.positions_m.astype(np.float64)
    a, b, c = (points[mesh.triangles[:, i]] for i in range(3))
    mean_normal = mesh.normals[mesh.triangles].mean(axis=1)
    face = np.cross(b - a, c - a)
    assert np.all((face * mean_normal).sum(1) > 0.99 * np.linalg.norm(face, axis=1))
    assert len(mesh.triangles) >= 8000
    assert np.isfinite(case.reference).all() and case.region.sum() > 1000
    # what the truth puts into the view is the flux that must land in the view
    landed = case.reference[case.flux_region].sum(axis=0) * case.bin_area_m2
    np.testing.assert_allclose(landed, case.flux_w, rtol=2e-3 if name == "flat-point" else 1e-6)
    assert case.reference[0].max() == case.reference[:, 0].max() == 0.0 or name.startswith("sphere")


def test_folds_are_there_and_hold_more_than_their_largest_branch() -> None:
    case = CASES["sine-folds"]()
    folded = case.extra["folded"] > 0
    assert folded.sum() > 500
    assert (case.extra["largest"][folded] <= case.reference[folded] + 1e-6).all()
    assert case.extra["largest"][folded].sum() < 0.9 * case.reference[folded].sum()
    assert not CASES["sine"]().extra["folded"].any()


def test_wall_faces_the_axis_and_grids_are_complete() -> None:
    wall = cylinder_wall("w", 2.0, 1.0, 1.0, 16, 4)
    assert len(wall.triangles) == 2 * 16 * 4
    assert np.all((wall.normals * wall.positions_m * [1, 0, 1]).sum(1) < 0)
    assert set(np.unique(grid_triangles(3, 5))) == set(range(24))


def test_erosion() -> None:
    mask = np.ones((6, 6), bool)
    mask[2, 2] = False
    assert eroded(mask).sum() == 16 - 9
