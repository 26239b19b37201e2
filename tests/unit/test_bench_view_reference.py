"""Reference beams at a camera's pixels: closed form of flat water, the area of receivers, and what hides what."""

from __future__ import annotations

import importlib.util
import os

import numpy as np
import pytest

from glcaustics.optics.beam_scene import BeamLight, BeamMesh, BeamScene, SurfaceKind, SurfaceOptics
from glcaustics.optics.reference import BeamSettings, trace_beams
from glcaustics.optics.view_receiver import PinholeView, ViewReceiver

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("embreex") is None and not os.environ.get("GLC_REQUIRE_BENCH"), reason="no embreex"
)
DIFFUSE = SurfaceOptics(SurfaceKind.DIFFUSE)
WATER = SurfaceOptics(SurfaceKind.DIELECTRIC, (1.333, 1.333, 1.333))
TRANSMITTED = 1.0 - ((1.333 - 1.0) / (1.333 + 1.0)) ** 2


def square(half_m: float, y_m: float, optics: SurfaceOptics, x_m: float = 0.0) -> BeamMesh:
    """Horizontal, facing up, around (x, y, 0)."""
    points = np.array([(x_m + x, y_m, z) for z in (-half_m, half_m) for x in (-half_m, half_m)], float)
    return BeamMesh(points, np.tile([0.0, 1.0, 0.0], (4, 1)), np.array([[0, 2, 1], [1, 2, 3]]), optics)


def scene(*more: BeamMesh) -> BeamScene:
    """Flat water over |x|, |z| <= 1, sun straight down with 2 W/m^2, floor half a metre below."""
    return BeamScene((square(4.0, -0.5, DIFFUSE), square(1.0, 0.0, WATER), *more), (BeamLight((2.0, 2.0, 2.0)),))


def slanted(pixels: int = 24) -> PinholeView:
    """From (0, 1.5, 2) towards the floor's middle: receivers at every slant, edges of the lit square in the picture."""
    back = np.array([0.0, 2.0, 2.0]) / np.hypot(2.0, 2.0)
    pose = np.eye(4)
    pose[:3, 1], pose[:3, 2] = np.cross(back, [1.0, 0.0, 0.0]), back
    pose[:3, 3] = (0.0, 1.5, 2.0)
    return PinholeView(pose, 0.5, pixels, pixels)


def gathered(beams: BeamScene, view: PinholeView, cells: int = 64) -> ViewReceiver:
    receiver = ViewReceiver(beams, view, samples=4)
    trace_beams(beams, receiver, BeamSettings(cells=cells, max_events=1))
    return receiver


def test_flat_water_has_its_closed_form_at_every_pixel() -> None:
    receiver = gathered(scene(), slanted())
    image, point = receiver.irradiance()[..., 0], receiver.point_ws
    inside = (np.abs(point[..., [0, 2]]) < 0.85).all(axis=2) & receiver.plain
    outside = (np.abs(point[..., [0, 2]]) > 1.25).any(axis=2)
    assert inside.sum() > 100 and outside.sum() > 10
    assert image[inside] == pytest.approx(2.0 * TRANSMITTED, rel=0.01)
    assert image[outside] == pytest.approx(0.0, abs=1e-12)


def test_all_flux_is_in_the_picture() -> None:
    receiver = gathered(scene(), slanted(32))
    flux = float((receiver.irradiance()[..., 0] * receiver.area_m2).sum())
    assert flux == pytest.approx(4.0 * 2.0 * TRANSMITTED, rel=1e-3)


def test_what_is_hidden_from_the_eye_is_not_counted() -> None:
    """A board under the eye hides a part of the lit floor, and itself shows its dark side."""
    view = slanted()
    board = square(0.4, 0.8, DIFFUSE)
    board = BeamMesh(board.positions_ws + [0.0, 0.0, 1.6], board.normals_ws, board.triangles, DIFFUSE)
    free, hidden = gathered(scene(), view), gathered(scene(board), view)
    on_board = hidden.point_ws[..., 1] > 0.5
    assert on_board.sum() > 20
    assert hidden.irradiance()[on_board & hidden.plain] == pytest.approx(0.0, abs=1e-12)
    lit = (free.irradiance()[..., 0] > 0.0) & hidden.plain & ~on_board
    assert hidden.irradiance()[lit] == pytest.approx(free.irradiance()[lit], rel=0.02)


def test_a_pixel_finds_itself() -> None:
    """Rays through pixels, projected again."""
    view = slanted(8)
    direction, solid_angle = view.rays(2, slice(0, 8))
    xy, depth = view.pixels(view.eye_ws + 3.0 * direction)
    columns, rows = np.meshgrid((np.arange(16) + 0.5) / 2, (np.arange(16) + 0.5) / 2)
    assert xy == pytest.approx(np.stack([columns.ravel(), rows.ravel()], axis=1))
    assert (depth > 0.0).all()
    assert solid_angle.sum() == pytest.approx(4.0 * np.arcsin(0.25 / 1.25), rel=2e-3)  # of a square pyramid
