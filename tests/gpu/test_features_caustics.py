"""Dispersion, absorption, the three intersection estimates and the paper's own flux, each against its closed form."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from glcaustics.optics.closed_form import (
    flat_directional_irradiance,
    flat_directional_shift_m,
    flat_point_entry_radius_m,
    flat_point_irradiance,
)
from glcaustics.optics.fresnel import transmittance_dielectric
from glcaustics.optics.glass_sphere import GlassSphere
from glcaustics.optics.pixels import box_filter, pixel_edges
from glcaustics.renderer import Frame
from glcaustics.scene.model import Camera, Instance, Material, OpticalKind
from tests.gpu.feature_scenes import (
    GLASS,
    WATER,
    box,
    from_above,
    grid_xz,
    lamp,
    plane,
    relative_rmse,
    scene_of,
    sheet,
    shoot,
    sun,
    translation,
)
from tests.gpu.physics_meshes import icosphere
from tests.gpu.physics_scenes import BINS, PhysicsCase, mirror_nephroid, sine_water

pytestmark = pytest.mark.gpu
NO_REFLECTION = {"reflect": False}
PIXELS = 128


def caustic(frame: Frame) -> np.ndarray:
    """(H, W, 3) float64."""
    return frame.aov["caustic_irradiance"].astype(np.float64)


def pool(material: Material, light_deg: float, depth_m: float = 1.0, half_m: float = 0.8) -> Frame:
    scene = scene_of(
        [plane("floor", 3.0, -depth_m), sheet("water", half_m, 0.0, material)],
        [sun(light_deg)],
        from_above(2.0, -depth_m),
    )
    return shoot(scene, (PIXELS, PIXELS), options={**NO_REFLECTION, "caster_size": 512})


# -- dispersion -------------------------------------------------------------------------------------------------------


def test_dispersive_water_shifts_each_channel_by_snell() -> None:
    material = replace(WATER, ior=1.5, dispersion=6.0)
    image = caustic(pool(material, 55.0))
    x, _ = grid_xz(2.0, PIXELS)
    centroid = (image * x[..., None]).sum(axis=(0, 1)) / image.sum(axis=(0, 1))
    shift = np.array([flat_directional_shift_m(math.radians(55.0), 1.0, ior=n) for n in material.ior_rgb()])
    print("centroids", centroid, "closed form", shift)
    assert np.ptp(shift) > 0.08
    np.testing.assert_allclose(centroid, shift, atol=1.5e-3)
    for c, n in enumerate(material.ior_rgb()):
        expected = flat_directional_irradiance(math.radians(55.0), ior=float(n))
        lit = np.abs(x[64] - shift[c]) < 0.7
        np.testing.assert_allclose(image[64, lit, c], expected, rtol=0.01)


def test_dispersive_sphere_focuses_each_channel_by_itself() -> None:
    """Ball of glass over a floor: within its shadow every channel has the radial profile of its own index."""
    material = replace(GLASS, dispersion=8.0)
    height, half, pixels = 2.0, 1.5, 192
    ball = Instance("ball", icosphere("ball", 1.0, 48), material, translation(0.0, height, 0.0))
    scene = scene_of([plane("floor", 2.0), ball], [sun()], from_above(half, 0.0, 5.0))
    image = box_filter(shoot(scene, (pixels, pixels)).aov["caustic_irradiance"], (64, 64))
    edges = pixel_edges(half, 64)
    x, z = grid_xz(half, 64)
    within = np.hypot(x, z) < 0.95
    mean_radius = []
    for c, n in enumerate(material.ior_rgb()):
        truth = GlassSphere(1.0, height, float(n)).pixel_irradiance(edges, edges, 8)
        error = relative_rmse(image[..., c][within], truth[within])
        radius = [(e[within] * np.hypot(x, z)[within]).sum() / e[within].sum() for e in (image[..., c], truth)]
        print(f"n = {n:.3f}: relative RMSE {error:.4f}, mean radius {radius[0]:.4f} m, closed form {radius[1]:.4f} m")
        assert error < 0.05
        assert radius[0] == pytest.approx(radius[1], abs=4e-3)
        mean_radius.append(radius[1])
    assert np.ptp(mean_radius) > 0.02


def test_without_dispersion_the_channels_are_one() -> None:
    image = caustic(pool(WATER, 40.0))
    assert np.array_equal(image[..., 0], image[..., 1]) and np.array_equal(image[..., 0], image[..., 2])
    off = shoot(
        scene_of(
            [plane("floor", 3.0, -1.0), sheet("water", 0.8, 0.0, replace(WATER, dispersion=6.0))],
            [sun(40.0)],
            from_above(2.0, -1.0),
        ),
        (64, 64),
        options={"dispersion": False},
    )
    assert np.array_equal(caustic(off)[..., 0], caustic(off)[..., 2])


# -- absorption -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("theta", [0.0, 50.0])
def test_water_absorbs_by_beer_lambert(theta: float) -> None:
    depth = 1.0
    material = replace(WATER, attenuation_color=(0.2, 0.5, 0.9), attenuation_distance_m=1.5)
    image = caustic(pool(material, theta, depth))
    shift = float(flat_directional_shift_m(math.radians(theta), depth))
    x, z = grid_xz(2.0, PIXELS)
    lit = (np.abs(x - shift) < 0.7) & (np.abs(z) < 0.7)
    for c, sigma in enumerate(material.sigma_a):
        expected = flat_directional_irradiance(math.radians(theta), depth_m=depth, sigma_a_per_m=float(sigma))
        np.testing.assert_allclose(image[lit, c], expected, rtol=0.01)


def test_lamp_under_water_loses_what_it_crosses() -> None:
    """A lamp in the water below the surface, a floor above it facing down: absorbed over the way to the surface."""
    material = replace(WATER, attenuation_color=(0.3, 0.6, 0.95), attenuation_distance_m=1.0)
    ceiling = plane("ceiling", 1.0, 1.0, up=False)
    scene = scene_of(
        [ceiling, sheet("water", 2.0, 0.0, material)],
        [lamp((0.0, -1.0, 0.0), 10.0)],
        Camera.look_at((0.0, -0.5, 0.0), (0.0, 1.0, 0.0), yfov_rad=math.radians(50.0)),
    )
    frame = shoot(scene, (96, 96), quality="high", options=NO_REFLECTION)
    image, position = caustic(frame), frame.aov["position_ws"].astype(np.float64)
    radius = np.hypot(position[..., 0], position[..., 2])
    near = (radius < 0.6) & (np.abs(position[..., 1] - 1.0) < 1e-3)
    assert near.sum() > 500
    for c, sigma in enumerate(material.sigma_a):
        clear = flat_point_irradiance(radius[near], height_m=1.0, depth_m=1.0, ior=1.0, n_above=1.333, intensity=10.0)
        entry = flat_point_entry_radius_m(radius[near], height_m=1.0, depth_m=1.0, ior=1.0, n_above=1.333)
        np.testing.assert_allclose(image[near, c], clear * np.exp(-sigma * np.hypot(1.0, entry)), rtol=0.02)


@pytest.mark.parametrize("theta", [0.0, 40.0])
@pytest.mark.parametrize("clear", [True, False])
def test_slab_of_glass_transmits_by_fresnel_and_beer_lambert(theta: float, clear: bool) -> None:
    """Plane-parallel slab, two interfaces: E = E_perp cos T^2 exp(-sigma d / cos t'), moved sideways, not spread."""
    thick = 0.3
    material = GLASS if clear else replace(GLASS, attenuation_color=(0.1, 0.4, 0.8), attenuation_distance_m=0.5)
    slab = box("slab", (2.0, thick, 2.0), (0.0, 0.5, 0.0), material)
    assert slab.optical_kind is OpticalKind.SOLID
    scene = scene_of([plane("floor", 3.0), slab], [sun(theta)], from_above(2.0))
    # What the side faces reflect totally falls on the same floor: another path, left out here.
    options = {**NO_REFLECTION, "internal_bounces": 0}
    image = caustic(shoot(scene, (PIXELS, PIXELS), quality="high", options=options))
    cos_i = math.cos(math.radians(theta))
    sin_t = math.sin(math.radians(theta)) / 1.5
    cos_t = math.sqrt(1 - sin_t**2)
    shift = 0.35 * math.tan(math.radians(theta))  # the underside stands 0.35 m above the floor
    x, z = grid_xz(2.0, PIXELS)
    centre = shift + thick * sin_t / cos_t  # of what enters the top face, at the floor
    lit = (np.abs(x - centre) < 0.65) & (np.abs(z) < 0.85)
    passed = float(transmittance_dielectric(cos_i, 1.0, 1.5)) ** 2
    for c, sigma in enumerate(material.sigma_a):
        expected = cos_i * passed * math.exp(-float(sigma) * thick / cos_t)
        np.testing.assert_allclose(image[lit, c], expected, rtol=0.01)
    if theta == 0.0:
        total = image.sum(axis=(0, 1)) * (4.0 / PIXELS) ** 2
        np.testing.assert_allclose(total, 4.0 * passed * np.exp(-material.sigma_a * thick), rtol=0.006)


def test_cube_of_glass_by_closed_form() -> None:
    """Slanted light enters a cube by its top and one side. From the top all of it reaches the floor, some by a total
    reflection at the far side; from the side, what meets the bottom is totally reflected and leaves upwards."""
    size, theta = 0.6, math.radians(40.0)
    cube = box("cube", (size, size, size), (0.0, 0.5, 0.0), GLASS)
    scene = scene_of([plane("floor", 4.0), cube], [sun(40.0)], from_above(2.0))
    (solve,) = shoot(scene, (96, 96), options=NO_REFLECTION).stats["solves"]
    by_top = size**2 * math.cos(theta) * float(transmittance_dielectric(math.cos(theta), 1.0, 1.5)) ** 2
    by_side = size**2 * math.sin(theta) * float(transmittance_dielectric(math.sin(theta), 1.0, 1.5)) ** 2
    straight = 1.0 - math.tan(
        math.asin(math.cos(theta) / 1.5)
    )  # share of the side's light that meets the far side first
    print(solve["flux_landed"], by_top + straight * by_side, solve["flux_left_the_scene"], (1 - straight) * by_side)
    assert solve["flux_landed"] == pytest.approx(by_top + straight * by_side, rel=0.01)
    assert solve["flux_left_the_scene"] == pytest.approx((1.0 - straight) * by_side, rel=0.03)
    assert solve["flux_lost_share"] < 0.01


# -- the three estimates ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("theta", [0.0, 45.0])
@pytest.mark.parametrize("estimate", ["fixed_point", "newton_fd", pytest.param("hybrid", marks=pytest.mark.smoke)])
def test_every_estimate_is_exact_on_flat_water(estimate: str, theta: float) -> None:
    scene = scene_of([plane("floor", 3.0, -1.0), sheet("water", 0.8, 0.0)], [sun(theta)], from_above(2.0, -1.0))
    frame = shoot(scene, (PIXELS, PIXELS), options={"estimate": estimate, "reflect": False})
    image = caustic(frame)[..., 1]
    shift = float(flat_directional_shift_m(math.radians(theta), 1.0))
    x, z = grid_xz(2.0, PIXELS)
    lit = (np.abs(x - shift) < 0.7) & (np.abs(z) < 0.7)
    expected = float(flat_directional_irradiance(math.radians(theta)))
    assert image[lit].mean() == pytest.approx(expected, rel=0.003)
    np.testing.assert_allclose(image[lit], expected, rtol=0.015)  # single pixels at quality medium
    (solve,) = frame.stats["solves"]
    print(
        estimate,
        theta,
        {k: solve[k] for k in ("rays", "converged", "bracketed", "failed", "lookups_mean", "lookups_max")},
    )
    assert solve["converged"] == solve["rays"] > 1000 and solve["failed"] == 0
    assert 1.0 <= solve["lookups_mean"] <= 6.0 and solve["flux_lost"] == 0.0


@cache
def sine_case() -> PhysicsCase:
    return sine_water(2.0, 30.0)


@pytest.mark.parametrize("estimate", ["fixed_point", "newton_fd", "hybrid"])
def test_every_estimate_gives_the_sine_caustic(estimate: str) -> None:
    case = sine_case()
    frame = shoot(case.scene, (256, 256), options={"estimate": estimate, "reflect": False})
    image = box_filter(frame.aov["caustic_irradiance"], (BINS, BINS))
    error = relative_rmse(image[case.region], case.reference[case.region])
    (solve,) = frame.stats["solves"]
    print(f"{estimate}: RMSE {error:.4f}, {solve['lookups_mean']:.2f} look-ups, lost {solve['flux_lost_share']:.2e}")
    assert error < 0.05
    assert solve["flux_lost_share"] < 0.002


def test_hybrid_converges_where_the_fixed_point_does_not() -> None:
    """Reflected light (the nephroid): no reason for the fixed point to contract; the hybrid loses next to nothing."""
    case = mirror_nephroid()
    lost, error = {}, {}
    for estimate in ("fixed_point", "newton_fd", "hybrid"):
        frame = shoot(case.scene, (256, 256), quality="medium", options={"estimate": estimate})
        image = box_filter(frame.aov["caustic_irradiance"], (BINS, BINS))
        error[estimate] = relative_rmse(image[case.region], case.reference[case.region])
        (solve,) = frame.stats["solves"]
        lost[estimate] = solve["flux_lost_share"]
        print(
            f"{estimate}: lost {lost[estimate]:.4f}, RMSE {error[estimate]:.4f}, {solve['lookups_mean']:.2f} look-ups"
        )
    assert lost["hybrid"] < 0.005
    assert lost["fixed_point"] > lost["hybrid"]
    assert error["hybrid"] < 0.12 and error["hybrid"] <= min(error.values())


# -- flux -------------------------------------------------------------------------------------------------------------


def test_the_papers_flux_counts_the_cosine_twice() -> None:
    """Their eq. 6 gives each texel N.L / V, though seen from a directional light all have the same cross-section: on
    flat water the result is too dark by the cosine."""
    for theta in (30.0, 60.0):
        scene = scene_of([plane("floor", 3.0, -1.0), sheet("water", 0.8, 0.0)], [sun(theta)], from_above(2.0, -1.0))
        exact, naive = (
            caustic(shoot(scene, (96, 96), options={"reflect": False, "naive_flux": flag}))[..., 1]
            for flag in (False, True)
        )
        ratio = naive.sum() / exact.sum()
        print(f"{theta:g} degrees: naive / exact {ratio:.4f}, cos {math.cos(math.radians(theta)):.4f}")
        assert ratio == pytest.approx(math.cos(math.radians(theta)), rel=0.01)
