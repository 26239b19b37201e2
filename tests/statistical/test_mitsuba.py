"""Mitsuba, which nobody here wrote, against the reference beams: the export, the units, and four scenes.

`./run test` installs Mitsuba and sets GLC_REQUIRE_BENCH, so that there a missing package fails instead of skipping.
"""

from __future__ import annotations

import importlib.util
import math
import os
from pathlib import Path

import numpy as np
import pytest

from glcaustics.bench.mitsuba_seen import seen_radiance
from glcaustics.bench.mitsuba_truth import Halves, PhotonMap, Pinhole, agreement, enlarged, mitsuba_reference
from glcaustics.bench.mitsuba_variant import SURE_VARIANT, best_variant
from glcaustics.bench.mitsuba_view import view_ptracer_reference
from glcaustics.bench.references import beam_reference
from glcaustics.bench.store import Store
from glcaustics.bench.targets import Target, bench_scene, luminance, target_of
from glcaustics.bench.view_reference import view_reference
from glcaustics.errors import UsageError
from glcaustics.scene.load import load_scene
from glcaustics.scene.model import Camera, Instance, Light, LightKind, Material, Mesh, Scene

MISSING = [name for name in ("mitsuba", "embreex") if importlib.util.find_spec(name) is None]
REQUIRED = bool(os.environ.get("GLC_REQUIRE_BENCH") or os.environ.get("CI"))
pytestmark = pytest.mark.skipif(
    bool(MISSING) and not REQUIRED, reason=f"not installed: {', '.join(MISSING)}; pip install '.[bench]'"
)

GREY = Material("floor", base_color=(0.5, 0.5, 0.5))
WATER = Material("water", base_color=(1.0, 1.0, 1.0), roughness=0.0, transmission=1.0, ior=1.333)


def square(name: str, half_m: float, y_m: float, material: Material) -> Instance:
    """A horizontal square with its normal up."""
    corners = [(-half_m, y_m, -half_m), (half_m, y_m, -half_m), (-half_m, y_m, half_m), (half_m, y_m, half_m)]
    points = np.array(corners, np.float32)
    normals = np.tile(np.array([0, 1, 0], np.float32), (4, 1))
    triangles = np.array([[0, 2, 1], [1, 2, 3]], np.uint32)
    return Instance(name, Mesh(name, points, normals, points[:, [0, 2]], triangles, False), material)


def flat_pool(light: Light) -> Scene:
    """Flat water over |x|, |z| <= 1, floor 0.5 m below."""
    camera = Camera.look_at((0, 3, 0), (0, 0, 0), (0, 0, -1), yfov_rad=0.3)
    return Scene("flat", (square("floor", 3.0, -0.5, GREY), square("water", 1.0, 0.0, WATER)), (light,), camera)


TARGET = Target("flat", (0.0, -0.5, 0.0), 0.3, (0.0, -0.1, 0.0), 1)
R0 = ((1.333 - 1.0) / (1.333 + 1.0)) ** 2


@pytest.mark.parametrize("variant", sorted({SURE_VARIANT, best_variant()}))
def test_directional_light_through_flat_water_has_its_closed_form(variant: str) -> None:
    """Straight down: E = E_perp (1 - R0), everywhere. Each variant that runs here."""
    scene = flat_pool(Light(LightKind.DIRECTIONAL, intensity=7.0, color=(1.0, 0.5, 0.25)))
    luminance = 0.2126 + 0.7152 * 0.5 + 0.0722 * 0.25
    image = PhotonMap(scene, TARGET, 16, variant).render(1 << 22, seed=1)  # 0.17 % noise
    assert image.mean() == pytest.approx(7.0 * luminance * (1.0 - R0), rel=0.006)


def test_point_and_spot_lights_keep_their_candela() -> None:
    """Straight below, water of depth d acts as one of d / n: E = I (1 - R0) / (h + d / n)^2 (paraxial)."""
    target = Target("flat", (0.0, -0.5, 0.0), 0.05, (0.0, -0.3, 0.0), 1)
    expected = 10.0 * (1.0 - R0) / (2.0 + 0.5 / 1.333) ** 2
    position = (0.0, 2.0, 0.0)
    point = Light(LightKind.POINT, intensity=10.0, position_ws=position)
    spot = Light(LightKind.SPOT, intensity=10.0, position_ws=position, inner_cone_rad=0.1, outer_cone_rad=0.2)
    for light, photons in ((point, 1 << 22), (spot, 1 << 20)):
        image = PhotonMap(flat_pool(light), target, 4, best_variant()).render(photons, seed=2)
        assert image.mean() == pytest.approx(expected, rel=0.02), light.kind


def test_a_spot_falls_off_as_gltf_says() -> None:
    """Halfway, in the cosine, from the outer to the inner cone the factor is a quarter of what is at the middle."""
    inner, outer = 0.1, 0.2
    angle = math.acos(0.5 * (math.cos(inner) + math.cos(outer)))
    landing_m = 2.0 * math.tan(angle) + 0.5 * math.tan(math.asin(math.sin(angle) / 1.333))
    light = Light(LightKind.SPOT, intensity=10.0, position_ws=(0, 2.0, 0), inner_cone_rad=inner, outer_cone_rad=outer)
    means = []
    for x in (0.0, landing_m):
        target = Target("flat", (x, -0.5, 0.0), 0.01, (x, -0.4, 0.0), 1)
        means.append(PhotonMap(flat_pool(light), target, 2, best_variant()).render(1 << 22, seed=3).mean())
    depth_m = 2.0 + 0.5 / 1.333  # as it looks from straight above; the slant takes cos^3 and a little more
    slant = (depth_m / math.hypot(depth_m, landing_m)) ** 3
    assert means[1] / means[0] == pytest.approx(0.25 * slant, abs=0.012)


def test_irradiance_does_not_depend_on_the_scale() -> None:
    scene = flat_pool(Light(LightKind.POINT, intensity=10.0, position_ws=(0.2, 1.0, 0.1)))
    big, target = enlarged(scene, TARGET, 4.0)
    assert big.lights[0].intensity == pytest.approx(160.0)
    assert big.lights[0].position_ws == pytest.approx((0.8, 6.0, 0.4))
    assert target.half_m == pytest.approx(1.2) and target.centre_ws == pytest.approx((0.0, 0.0, 0.0))


@pytest.mark.parametrize("name", ["pool", "glass-sphere", "glass-bunny"])
def test_the_pinhole_shares_its_pixel_edges_with_the_target(name: str) -> None:
    target = target_of(name)
    hole = Pinhole.over(target, 64)
    step = 2.0 * hole.half_film_m / hole.side
    assert step == pytest.approx(2.0 * target.half_m / 64)
    assert hole.eye_ws[0] - hole.half_film_m + hole.column * step == pytest.approx(target.centre_ws[0] - target.half_m)
    assert hole.eye_ws[2] - hole.half_film_m + hole.row * step == pytest.approx(target.centre_ws[2] - target.half_m)
    assert min(hole.row, hole.column) >= 0 and max(hole.row, hole.column) + 64 <= hole.side


def test_a_pinhole_behind_a_caster_is_refused() -> None:
    hidden = Target("glass-sphere", (0.6, 0.0, -0.03), 0.35, (-0.6, 0.6, 0.0), 2)
    with pytest.raises(UsageError, match="sees .* of the target"):
        PhotonMap(bench_scene("glass-sphere"), hidden, 16)


# 64 x 64 pixels; the full comparison, with more of both, is in `./run bench`
@pytest.mark.parametrize(
    ("name", "photons", "cells"),
    [
        ("pool", 1 << 19, 256),
        ("glass-sphere", 1 << 19, 192),
        ("glass-bunny", 1 << 20, 192),
        ("metal-ring", 1 << 18, 192),
    ],
)
def test_beams_and_mitsuba_differ_by_noise_alone(name: str, photons: int, cells: int, tmp_path: Path) -> None:
    """Relative RMSE within 1.2 times the noise of both; bias of the mean under 0.5 % (or three of its own sigmas)."""
    scene, target, store = bench_scene(name), target_of(name), Store(tmp_path)
    beams = beam_reference(scene, target, 64, cells, store)
    other = mitsuba_reference(scene, target, 64, photons, store)
    found = agreement(beams, other)
    assert found["agree"], found
    again = mitsuba_reference(scene, target, 64, photons, store)
    assert again.seconds == 0.0 and np.array_equal(again.first, other.first), "the second time it is from the cache"


def test_a_caustic_seen_through_water_has_the_right_radiance_and_place() -> None:
    """Second stage: L = albedo / pi E (1 - R0) / n^2 straight above the water; each quarter is where it belongs."""
    scene = flat_pool(Light(LightKind.DIRECTIONAL))
    target = Target("flat", (0.0, -0.5, 0.0), 0.3, (0.0, -0.1, 0.0), 1)
    irradiance = np.ones((16, 16))
    irradiance[:8, 8:] = 3.0  # the quarter at -z, +x
    camera = Camera.look_at((0, 5, 0), (0, 0, 0), (0, 0, -1), yfov_rad=2 * math.atan(0.2 / 5.375))
    image = seen_radiance(scene, target, irradiance, camera, (16, 16), albedo=0.5, spp=256)
    per_unit = image / (0.5 / math.pi * (1.0 - R0) / 1.333**2)
    quarters = [
        per_unit[r][:, c][1:7, 1:7].mean() for r in (slice(0, 8), slice(8, 16)) for c in (slice(0, 8), slice(8, 16))
    ]
    assert quarters == pytest.approx([1.0, 3.0, 1.0, 1.0], rel=0.02)


def test_beams_at_the_cameras_pixels_and_mitsuba_differ_by_noise_alone(tmp_path: Path) -> None:
    """Walls and ceiling of `flooded-cornell`, seen directly: the lamp sees no part of them."""
    store = Store(tmp_path)
    beams = view_reference(load_scene("flooded-cornell"), 96, 128, store).reduced(32)
    other = view_ptracer_reference(bench_scene("flooded-cornell"), 32, 1 << 18, store)
    seen = beams.plain & beams.direct
    assert 0.4 < seen.mean() < 0.8
    halves = Halves(luminance(beams.first)[seen][:, None], luminance(beams.second)[seen][:, None])
    found = agreement(halves, Halves(other.first[seen][:, None], other.second[seen][:, None]))
    assert found["agree"], found
    again = view_reference(load_scene("flooded-cornell"), 96, 128, store)
    assert again.seconds == 0.0 and np.array_equal(again.reduced(32).first, beams.first)
