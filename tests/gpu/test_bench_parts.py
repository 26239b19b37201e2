"""The bench's instruments that need a renderer, at tiny sizes: given irradiance, frames, stages, hits, flicker."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import glcaustics as glc
from glcaustics.bench.flicker import EXPONENTIAL, FILTER, PLAIN, RAW, exponential_mean, pan_flicker, panned
from glcaustics.bench.given import given_irradiance
from glcaustics.bench.photons import (
    MARCHES,
    STAGES,
    photon_options,
    picture_with,
    same_hits,
    stage_table,
    stages_of,
    static_frames,
)
from glcaustics.bench.plan import FlickerPlan
from glcaustics.caustics.registry import METHODS
from glcaustics.errors import UsageError
from glcaustics.passes.camera import CameraState
from glcaustics.scene.model import Camera, Scene
from tests.gpu.feature_scenes import BACKEND, box, from_above, plane, scene_of, sheet, sun

pytestmark = pytest.mark.gpu
SIZE = (48, 48)


def room() -> Scene:
    """Flat water over a floor, a box beside it that catches what the water throws back; seen from a corner."""
    parts = [plane("floor", 3.0, -1.0), sheet("water", 1.0, 0.0), box("wall", (0.1, 2.0, 2.0), (1.6, 1.0, 0.0))]
    return scene_of(parts, [sun(45.0)], Camera.look_at((-2.5, 2.5, 2.0), (0.4, 0.0, 0.0), yfov_rad=0.8))


def test_a_given_irradiance_makes_the_frame_of_the_method_that_made_it() -> None:
    """Bit for bit, water and all; and the registry is as it was."""
    scene, before = room(), dict(METHODS)
    options = {"caster_size": 64, "map_size": 64}
    with glc.Renderer(
        scene, SIZE, "caustic_map", "medium", BACKEND,
        aovs=("caustic_irradiance",), specular_view=False, options=options,
    ) as renderer:  # fmt: skip
        irradiance = renderer.render().aov["caustic_irradiance"]
    with glc.Renderer(scene, SIZE, "caustic_map", "medium", BACKEND, options=options) as renderer:
        renderer.draw()
        expected = renderer.render().ldr
    with glc.Renderer(scene, SIZE, "none", "medium", BACKEND) as renderer:
        dark = renderer.render().ldr
    assert np.array_equal(picture_with(scene, irradiance, BACKEND), expected)
    assert not np.array_equal(dark, expected)
    assert dict(METHODS) == before


def test_a_given_irradiance_of_another_size_is_refused() -> None:
    scene = room()
    with given_irradiance(np.zeros((8, 9, 3), np.float32)) as name, pytest.raises(UsageError, match="9x8"):
        with glc.Renderer(scene, SIZE, name, backend=BACKEND) as renderer:
            renderer.render()


def test_static_frames_are_those_of_the_renderer() -> None:
    scene, options = room(), photon_options(2000, 64)
    document, arrays = static_frames(scene, 32, 16, 4, options, BACKEND)
    assert sorted(arrays) == ["frame 1", "frame 2", "frame 4", "last"]
    assert document["frame_ms"] > 0.0 and arrays["frame 4"].shape == (16, 16, 3)
    with glc.Renderer(
        scene, (32, 32), "photon_trace", "medium", BACKEND,
        aovs=("caustic_irradiance",), specular_view=False, options=options,
    ) as renderer:  # fmt: skip
        frames = [renderer.render().aov["caustic_irradiance"] for _ in range(4)]
    mean = frames[-1].astype(np.float64).reshape(16, 2, 16, 2, 3).mean(axis=(1, 3))
    assert arrays["frame 4"] == pytest.approx(mean, rel=1e-5, abs=1e-5 * mean.mean())
    assert arrays["last"] == pytest.approx(frames[-1], rel=1e-5, abs=1e-5 * mean.mean())


def test_stages_and_hits_of_both_marches() -> None:
    rows = stage_table(room(), SIZE, [3000], 64, 1, BACKEND)
    assert [row["march"] for row in rows] == list(MARCHES)
    for row in rows:
        assert set(row["ms"]) == {*STAGES, "reflected"} and all(row["ms"].values())
    assert rows[0]["same_hits"]["photons"] > 1000 and rows[0]["same_hits"]["share"] > 0.98


def test_stages_are_told_by_name() -> None:
    timings = {
        "photon_trace.trace.interface@0": 3.0,
        "photon_trace.trace.reflect@0": 5.0,
        "photon_trace.scatter": 2.0,
        "svgf.atrous_0": 1.0,
        "svgf.atrous_0/x": 9.0,
    }
    found = stages_of(timings | {"depth_chain.4": 4.0, "shade": 7.0})
    assert found == {"tracing": 8.0, "storing": 2.0, "denoising": 1.0, "buffers": 4.0, "reflected": 5.0}


def test_hits_are_the_same_within_one_pixel() -> None:
    """Columns: x, y, inverse area, status (1, 2 landed)."""
    exact = np.array([[[5.5, 5.5, 1, 1], [5.5, 5.5, 1, 2], [5.5, 5.5, 1, 2], [0, 0, 0, -2]]], float)
    ours = np.array([[[6.4, 5.5, 1, 1], [7.5, 5.5, 1, 2], [5.5, 4.5, 1, 1], [3, 3, 1, 1]]], float)
    assert same_hits([ours], [exact]) == {"share": 2 / 3, "photons": 3, "marched": 0.5, "marched_photons": 2}


def test_a_pan_is_followed_and_judged() -> None:
    """Less noise is less flicker; the scene's own camera is the middle one of the pan."""
    plan = FlickerPlan(
        SIZE, 2000, frames=6, shown=4, pan_px=0.5, reference_photons=8000, reference_frames=2, reference_views=2
    )
    scene = room()
    found = pan_flicker(scene, plan, BACKEND)
    rows = {row["name"]: row for row in found["rows"]}
    assert list(rows) == [RAW, PLAIN, EXPONENTIAL, FILTER] and found["points"] > found["points_off_edges"] > 100
    assert 0.2 < found["motion_px"] < 1.0  # 0.5 at the median depth
    assert rows[RAW]["flicker"] > rows[PLAIN]["flicker"] > 0.0 and rows[RAW]["rmse"] > rows[FILTER]["rmse"] > 0.0
    middle = panned(scene, plan, BACKEND).view_at(0.5 * plan.frames)
    assert np.array_equal(middle.world_from_camera, scene.camera.world_from_camera)


def test_the_plain_mean_follows_surfaces_and_begins_anew_where_they_were_hidden() -> None:
    """A floor seen from above, one pixel a frame to the right: its pattern stays; a column that comes in is new."""
    size, scene = (12, 8), scene_of([], [], from_above(4.0))
    cameras, positions, frames = [], [], []
    for k in range(3):
        world = np.array(scene.camera.world_from_camera)
        world[0, 3] += k  # 1 m: a pixel
        view = replace(scene.camera, world_from_camera=world)
        x, z = np.meshgrid(np.arange(12) - 5.5 + k, np.arange(8) - 3.5)
        cameras.append(CameraState.make(view, size, np.array([[-9.0, -1.0, -9.0], [9.0, 1.0, 9.0]])))
        positions.append(np.stack([x, 0.0 * x, z], axis=2))
        frames.append(np.cos(x) + (0.0, 1.0, 0.0)[k])
    positions[0][:, 5, 1] = -8.0  # something else was there
    means = exponential_mean(np.stack(frames), np.stack(positions), cameras)
    assert means[0] == pytest.approx(frames[0])
    settled = np.cos(np.arange(12) - 5.5 + 2) + 0.8 * np.where(np.isin(np.arange(12), (3, 10)), 1.0, 0.2)
    settled[11] = frames[2][0, 11]
    assert means[2] == pytest.approx(np.broadcast_to(settled, (8, 12)))
