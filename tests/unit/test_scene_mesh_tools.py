"""Welding, normals and topology of triangle meshes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from glcaustics.scene import mesh_tools as tools
from tests.unit.glb_builder import cube, plane, torus


def arrays(mesh: dict) -> tuple[np.ndarray, np.ndarray]:
    return np.array(mesh["positions"], float), np.array(mesh["indices"])


def test_weld_joins_what_rounding_moved_apart_and_nothing_else() -> None:
    rng = np.random.default_rng(0)
    points = rng.random((2000, 3))
    near = points + rng.uniform(-4e-7, 4e-7, points.shape)
    apart = points + 1e-4
    labels = tools.weld(np.concatenate((points, near, points, apart)))
    own = np.arange(2000)
    assert np.array_equal(labels, np.concatenate((own, own, own, own + 6000)))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_weld_is_scale_free(scale: float) -> None:
    positions, _ = arrays(torus())
    assert np.array_equal(tools.weld(positions * scale), tools.weld(positions))
    assert len(np.unique(tools.weld(positions))) == 32 * 16


def test_weld_far_from_the_origin_in_float32() -> None:
    positions, triangles = arrays(torus())
    far = (positions + 5000.0).astype(np.float32)
    assert tools.is_watertight(far, triangles)


def test_weld_of_nothing_and_of_one_place() -> None:
    assert len(tools.weld(np.zeros((0, 3)))) == 0
    assert np.array_equal(tools.weld(np.zeros((3, 3))), [0, 0, 0])


def test_topology() -> None:
    positions, triangles = arrays(cube())
    assert tools.topology(positions, triangles) == tools.Topology(0, 0)
    assert tools.topology(positions, triangles[1:]) == tools.Topology(3, 0)
    turned = triangles.copy()
    turned[0] = turned[0, ::-1]
    assert tools.topology(positions, turned) == tools.Topology(0, 3)
    assert not tools.is_watertight(positions, triangles[:0])
    assert not tools.is_watertight(*arrays(plane()))


def test_two_cubes_that_touch_along_an_edge_are_still_closed() -> None:
    positions, triangles = arrays(cube())
    both = np.concatenate((positions, positions + (1.0, 1.0, 0.0)))
    assert tools.is_watertight(both, np.concatenate((triangles, triangles + 8)))


def test_volume_and_enclosure() -> None:
    positions, triangles = arrays(cube(1.0))
    assert tools.signed_volume(positions + 100.0, triangles) == pytest.approx(8.0)
    assert tools.signed_volume(positions, triangles[:, ::-1]) == pytest.approx(-8.0)
    assert tools.enclosure(positions, triangles) == pytest.approx(1.0)
    assert tools.enclosure(*arrays(plane())) == pytest.approx(0.0)


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
def test_nondegenerate_is_scale_free(scale: float) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [0.5, 1e-3, 0]]) * scale
    triangles = np.array([[0, 1, 2], [0, 1, 3], [0, 0, 1], [0, 1, 4]])
    assert tools.nondegenerate(points, triangles).tolist() == [True, False, False, True]


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
def test_smooth_normals_of_a_cube_weigh_its_three_faces_alike(scale: float) -> None:
    positions, triangles = arrays(cube())
    # a face cut along its diagonal must not count twice: the weight is the angle
    normals = tools.smooth_normals(positions * scale, triangles)
    assert np.allclose(normals, np.sign(positions) / math.sqrt(3.0))


def test_smooth_normals_without_a_triangle_point_up() -> None:
    points = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [9, 9, 9]], float)
    assert np.allclose(tools.smooth_normals(points, np.array([[0, 1, 2]])), (0, 1, 0))


@pytest.mark.parametrize(("bend_deg", "vertices"), [(55.0, 4), (65.0, 6)])
def test_crease_angle(bend_deg: float, vertices: int) -> None:
    bend = math.radians(bend_deg)
    points = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-math.cos(bend), -math.sin(bend), 0]])
    split = tools.crease_normals(points, np.array([[0, 1, 2], [1, 0, 3]]))
    assert len(split.normals) == vertices
    assert np.array_equal(np.sort(np.unique(split.source)), np.arange(4))


def test_creases_are_found_across_seams_of_doubled_vertices() -> None:
    positions, triangles = arrays(torus())
    corners = positions[triangles].reshape(-1, 3)
    split = tools.crease_normals(corners, np.arange(len(corners)).reshape(-1, 3))
    whole = tools.smooth_normals(positions, triangles)
    assert np.allclose(split.normals, whole[triangles.ravel()[split.source]], atol=1e-6)


def test_crease_keeps_smooth_sides_and_sharp_caps_of_a_cylinder() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    ring = np.stack((np.cos(angle), np.zeros(24), -np.sin(angle)), axis=1)
    positions = np.concatenate((ring, ring + (0, 1, 0), [[0, 0, 0], [0, 1, 0]]))
    i, j = np.arange(24), np.roll(np.arange(24), -1)
    sides = np.concatenate((np.stack((i, j, j + 24), 1), np.stack((i, j + 24, i + 24), 1)))
    caps = np.concatenate((np.stack((j, i, np.full(24, 48)), 1), np.stack((i + 24, j + 24, np.full(24, 49)), 1)))
    triangles = np.concatenate((sides, caps))
    assert tools.is_watertight(positions, triangles)
    split = tools.crease_normals(positions, triangles)
    assert len(split.normals) == 2 * 48 + 2
    upright = np.abs(split.normals[:, 1]) > 0.5
    assert np.allclose(np.abs(split.normals[upright, 1]), 1.0)
    outward = positions[split.source][~upright] * (1.0, 0.0, 1.0)
    assert np.allclose(split.normals[~upright], outward)


def test_convex_bodies_are_told_from_others() -> None:
    box, ring = arrays(cube()), arrays(torus())
    apart = np.concatenate((box[0], box[0] + 3.0)), np.concatenate((box[1], box[1] + len(box[0])))
    dented = box[0].copy()
    dented[-1] *= 0.2
    assert tools.is_convex(*box) and tools.is_convex(box[0] * (1.0, 100.0, 0.01), box[1])
    assert not tools.is_convex(*ring)
    assert not tools.is_convex(*apart), "two pieces"
    assert not tools.is_convex(dented, box[1])
    assert not tools.is_convex(box[0], box[1][1:]), "a hole"
