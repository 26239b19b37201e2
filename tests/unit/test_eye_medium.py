"""What the eye is in: below open surfaces as they stand in this frame, inside closed solids, or in air."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glcaustics.passes.eye_medium import EyeMedium, EyeMediumFinder, first_crossing, holds
from glcaustics.passes.geometry import boxes_of
from glcaustics.scene import load_scene
from glcaustics.scene.model import Instance
from tests.gpu.feature_scenes import GLASS, WATER, WHITE, box, plane, sheet, translation
from tests.gpu.physics_meshes import height_sheet, icosphere


def medium(instances: list[Instance], *eye: float) -> EyeMedium | None:
    return EyeMediumFinder().find(instances, boxes_of(instances), np.array(eye))


def waves(time_s: float) -> Instance:
    """A standing wave 0.2 m high with crests 2 m apart, its first crest at the origin at time 0."""
    height = 0.2 * np.cos(np.pi * time_s)
    wave = (lambda x: height * np.cos(np.pi * x), lambda x: -np.pi * height * np.sin(np.pi * x))
    mesh = height_sheet("sea", 4.0, 64, 64, *wave)
    return Instance("sea", mesh, WATER)


def test_above_below_and_beside_a_sheet() -> None:
    scene = [plane("floor", 9.0, -2.0), sheet("water", 2.0, 0.0)]
    found = medium(scene, 0.3, -0.5, 0.1)
    assert found is not None and found.name == "water" and found.ior == pytest.approx(1.333) and found.solid == -1
    assert medium(scene, 0.3, 0.5, 0.1) is None
    assert medium(scene, 2.5, -0.5, 0.1) is None, "the ground beside a pool is not its water"
    assert medium(scene[:1], 0.3, -5.0, 0.1) is None, "an opaque floor is no medium"


def test_waves_count_as_they_stand() -> None:
    finder = EyeMediumFinder()
    for time_s, y, wet in ((0.0, 0.15, True), (0.0, 0.25, False), (1.0, -0.15, False), (1.0, -0.25, True)):
        sea = [waves(time_s)]
        found = finder.find(sea, boxes_of(sea), np.array([0.01, y, 0.02]), version=int(10 * time_s))
        assert (found is not None) is wet, (time_s, y)


def test_the_answer_is_kept_while_nothing_moves() -> None:
    finder, sea = EyeMediumFinder(), [waves(0.0)]
    first = finder.find(sea, boxes_of(sea), np.array([0.0, -1.0, 0.0]), 3)
    assert finder.find([], np.zeros((0, 2, 3)), np.array([0.0, -1.0, 0.0]), 3) is first
    assert finder.find([], np.zeros((0, 2, 3)), np.array([0.0, -1.0, 0.0]), 4) is None


def test_a_hole_for_a_hull_does_not_drain_the_water() -> None:
    whole = sheet("water", 3.0, 0.0, cells=60)
    centres = whole.mesh.positions_m[whole.mesh.triangles].mean(axis=1)
    cut = replace(whole.mesh, triangles=whole.mesh.triangles[np.abs(centres[:, [0, 2]]).max(axis=1) > 0.25])
    assert medium([replace(whole, mesh=cut)], 0.0, -1.0, 0.0) is not None
    assert medium([replace(whole, mesh=cut)], 0.0, 0.1, 0.0) is None


def test_inside_a_closed_solid_which_counts_before_the_water_around_it() -> None:
    ball = Instance("ball", icosphere("ball", 0.3, 12), GLASS, translation(0.2, -1.0, 0.0))
    scene = [sheet("water", 2.0, 0.0), box("block", (3.0, 3.0, 3.0), (0.0, -1.0, 0.0), GLASS), ball]
    inside = medium(scene, 0.25, -1.1, 0.05)
    assert inside is not None and (inside.name, inside.solid) == ("ball", 2)
    between = medium(scene, 0.8, -1.1, 0.05)
    assert between is not None and (between.name, between.solid) == ("block", 1)


def test_a_mirrored_instance_keeps_its_sides() -> None:
    """Scaled by -1 along x the winding turns round; so does what is its back, in the picture as here."""
    water = sheet("water", 2.0, 0.0)
    mirrored = replace(water, world_from_object=np.diag([-1.0, 1.0, 1.0, 1.0]))
    for instance, from_back in ((water, True), (mirrored, False)):
        hit = first_crossing(instance, np.array([0.3, -0.5, 0.1]), np.array([0.0, 1.0, 0.0]))
        assert hit is not None and hit == (pytest.approx(0.5), from_back)


def test_holds_by_scale_and_place() -> None:
    for scale in (1e-3, 1.0, 1e3):
        matrix = translation(5.0 * scale, -2.0 * scale, scale) @ np.diag([scale, 2.0 * scale, scale, 1.0])
        ball = Instance("ball", icosphere("ball", 1.0, 16), WHITE, matrix)
        bounds = boxes_of([ball])[0]
        centre = np.array([5.0, -2.0, 1.0]) * scale
        for way in np.random.default_rng(3).normal(size=(40, 3)):
            way = way / np.linalg.norm(way) * (1.0, 2.0, 1.0) * scale
            assert holds(ball, bounds, centre + 0.97 * way) and not holds(ball, bounds, centre + 1.001 * way)


def test_built_in_waters_and_the_plan_says_so() -> None:
    from glcaustics.renderer import plan_frame
    from glcaustics.scene.model import Camera

    pool = load_scene("pool")
    under = replace(pool, camera=Camera.look_at((0.0, -1.0, 0.0), (1.0, -1.2, 0.0)), camera_at=None)
    notes = [{s.name: s.decl.note for s in plan_frame(scene, (64, 36)).steps}["refraction"] for scene in (under, pool)]
    assert "the eye is in 'water' (index 1.333, absorption" in notes[0]
    assert "the eye is in" not in notes[1]
