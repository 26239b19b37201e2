"""The closed forms against each other, against energy, and brute-force beams that share no formula with them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from glcaustics.errors import UsageError
from glcaustics.optics.beam_fan import deposit_segments
from glcaustics.optics.beams import beam_irradiance, peer_pool_field, sine_field
from glcaustics.optics.closed_form import (
    GlassSphere,
    MirrorCylinder,
    SineWater,
    flat_directional_irradiance,
    flat_directional_shift_m,
    flat_point_flux,
    flat_point_irradiance,
)
from glcaustics.optics.fresnel import fresnel_dielectric
from glcaustics.optics.pixels import box_filter, disc_quadrant_area, pixel_areas, pixel_edges, radial_to_pixels
from glcaustics.optics.refract import reflect, refract

WAVENUMBER = 2 * math.pi / 0.5
FOLDED = SineWater(6.0 / WAVENUMBER**2, WAVENUMBER, 1.0)
SMOOTH = SineWater(2.0 / WAVENUMBER**2, WAVENUMBER, 1.0)


# Flat interface


def test_flat_directional_by_hand() -> None:
    assert flat_directional_irradiance(0.0, ior=1.5, e_perp=2.0) == pytest.approx(2 * 0.96)
    angle = math.radians(60)
    expected = 0.5 * (1 - fresnel_dielectric(0.5, 1, 1.333)) * math.exp(-0.7 * 2 / math.sqrt(1 - 0.75 / 1.333**2))
    assert flat_directional_irradiance(angle, depth_m=2, sigma_a_per_m=0.7) == pytest.approx(expected)
    assert flat_directional_shift_m(angle, 2.0, ior=1.0) == pytest.approx(2 * math.tan(angle))
    with pytest.raises(UsageError, match="totally reflected"):
        flat_directional_irradiance(angle, ior=1.0, n_above=1.5)


def test_flat_point_without_interface_is_the_inverse_square_law() -> None:
    r = np.array([0.0, 0.3, 2.0])
    expected = 5.0 * 3.0 / (r**2 + 9.0) ** 1.5
    np.testing.assert_allclose(
        flat_point_irradiance(r, height_m=1.0, depth_m=2.0, ior=1.0, intensity=5.0), expected, rtol=1e-12
    )


def test_flat_point_axis_is_the_limit_and_energy_holds() -> None:
    lamp = {"height_m": 1.2, "depth_m": 0.8, "sigma_a_per_m": 0.4}
    near = flat_point_irradiance([0.0, 1e-6], **lamp)
    assert near[0] == pytest.approx(near[1], rel=1e-9)
    assert near[0] == pytest.approx(
        (1 - fresnel_dielectric(1, 1, 1.333)) * math.exp(-0.32) / (1.2 + 0.8 / 1.333) ** 2, rel=1e-9
    )
    # flux through a disc of interface equals the integral over the disc of floor it maps to
    entry, n = 1.5, 1.333
    sin_t = entry / math.hypot(entry, 1.2)
    floor_radius = entry + 0.8 * math.tan(math.asin(sin_t / n))
    node, weight = np.polynomial.legendre.leggauss(200)
    r = 0.5 * floor_radius * (node + 1)
    landed = (weight * 2 * math.pi * r * flat_point_irradiance(r, **lamp)).sum() * 0.5 * floor_radius
    t = 0.5 * math.asin(sin_t) * (node + 1)
    passed = (1 - fresnel_dielectric(np.cos(t), 1, n)) * np.exp(-0.32 / np.sqrt(1 - (np.sin(t) / n) ** 2))
    entered = (weight * 2 * math.pi * np.sin(t) * passed).sum() * 0.5 * math.asin(sin_t)
    assert landed == pytest.approx(entered, rel=1e-9)


def test_flat_point_flux_without_interface_is_the_solid_angle() -> None:
    # the solid angle of a 2a x 2b rectangle seen from height h: 4 asin(ab / sqrt((a^2 + h^2)(b^2 + h^2)))
    expected = 4 * math.asin(1.0 * 0.5 / math.sqrt((1 + 2.25) * (0.25 + 2.25)))
    assert flat_point_flux(1.0, 0.5, height_m=1.5, ior=1.0) == pytest.approx(expected, rel=1e-10)


# Cosine water


@pytest.mark.parametrize("theta_deg", [0.0, 30.0])
@pytest.mark.parametrize("water", [SMOOTH, FOLDED], ids=["smooth", "folded"])
def test_sine_water_energy(water: SineWater, theta_deg: float) -> None:
    water = replace(water, theta_rad=math.radians(theta_deg), sigma_a_per_m=0.2)
    edges = pixel_edges(2.5, 500)
    assert (water.bin_irradiance(edges) * np.diff(edges)).sum() == pytest.approx(water.flux_per_m(), rel=1e-10)


def test_sine_water_of_no_amplitude_is_flat() -> None:
    theta = math.radians(40)
    water = replace(SMOOTH, amplitude_m=0.0, theta_rad=theta, sigma_a_per_m=0.3)
    expected = flat_directional_irradiance(theta, depth_m=1.0, sigma_a_per_m=0.3)
    np.testing.assert_allclose(water.irradiance([-0.2, 0.0, 0.3]), expected, rtol=1e-12)
    shift = flat_directional_shift_m(theta, 1.0)
    np.testing.assert_allclose(water.bin_irradiance(np.linspace(-0.9, 0.9, 9) + shift), expected, rtol=1e-9)


@pytest.mark.parametrize("theta_deg", [0.0, 30.0])
def test_sine_water_points_average_to_bins(theta_deg: float) -> None:
    water = replace(SMOOTH, theta_rad=math.radians(theta_deg))
    edges = np.linspace(-0.3, 0.3, 7)
    points = np.linspace(-0.3, 0.3, 6 * 4000, endpoint=False).reshape(6, 4000) + 0.3 / (6 * 4000)
    np.testing.assert_allclose(water.irradiance(points).mean(axis=1), water.bin_irradiance(edges), rtol=1e-4)


def test_sine_water_folds_add() -> None:
    x = np.linspace(-0.25, 0.25, 50001)
    count = FOLDED.preimage_count(x)
    inside = np.flatnonzero(count >= 3)
    assert set(np.unique(count)) == {1, 3}
    at = x[inside[inside.size // 2]]
    # solve x' = at anew on a fine table and add by hand; the largest of the three alone is well below
    fan, u = FOLDED.fan(), np.linspace(-1, 1, 2_000_001)
    landing = np.asarray(fan.landing_m(u))
    hits = np.flatnonzero((landing[1:] > at) != (landing[:-1] > at))
    parts = fan.flux_per_u(u[hits]) * 1e-6 / np.abs(np.diff(landing)[hits])
    assert hits.size == 3
    assert float(FOLDED.irradiance(at)) == pytest.approx(parts.sum(), rel=1e-4)
    assert parts.max() < 0.8 * parts.sum()


def test_sine_water_bins_converge() -> None:
    edges, fan = pixel_edges(1.5, 128), FOLDED.fan()
    np.testing.assert_allclose(fan.bin_flux(edges, 1 << 17), fan.bin_flux(edges, 1 << 20), atol=1e-5 * 3.0 / 128)


def test_sine_water_refuses_shade() -> None:
    with pytest.raises(UsageError, match="shades itself"):
        SineWater(0.1, 20.0, 1.0, theta_rad=math.radians(45))
    with pytest.raises(UsageError, match="below the troughs"):
        SineWater(0.1, 1.0, 0.05)


# Glass sphere


def test_sphere_of_index_one_is_not_there() -> None:
    sphere = GlassSphere(0.5, 0.9, ior=1.0, e_perp=3.0)
    np.testing.assert_allclose(sphere.irradiance([0.1, 0.3, 0.45]), 3.0, rtol=1e-9)
    np.testing.assert_allclose(sphere.ring_irradiance(np.linspace(0, 0.5, 11)), 3.0, rtol=1e-6)


def test_sphere_agrees_with_traced_rays() -> None:
    sphere = GlassSphere(0.5, 0.6, sigma_a_per_m=0.5)
    b = np.sqrt((np.arange(200_000) + 0.5) / 200_000) * 0.5  # equal flux each
    down = np.tile([0.0, -1.0, 0.0], (b.size, 1))
    entry = np.stack([b, np.sqrt(0.25 - b**2), 0 * b], axis=1)
    inside, _ = refract(down, entry / 0.5, 1.0, 1.5)
    chord = -2 * (entry * inside).sum(1)
    leave = entry + chord[:, None] * inside
    out, tir = refract(inside, leave / 0.5, 1.5, 1.0)
    t1 = 1 - fresnel_dielectric((down * entry / 0.5).sum(1), 1.0, 1.5)
    t2 = 1 - fresnel_dielectric((inside * leave / 0.5).sum(1), 1.5, 1.0)
    flux = t1 * t2 * np.exp(-0.5 * chord) * np.pi * 0.25 / b.size
    lands = (out[:, 1] < 0) & ~tir
    radius = np.abs((leave + out * ((leave[:, 1] + 0.6) / np.where(lands, -out[:, 1], 1))[:, None])[:, 0])
    edges = np.linspace(0, 0.6, 13)
    traced, _ = np.histogram(radius[lands], edges, weights=flux[lands])
    np.testing.assert_allclose(sphere.fan().bin_flux(edges), traced, atol=2e-4 * traced.sum())
    assert sphere.transmitted_flux() == pytest.approx(flux.sum(), rel=1e-4)


def test_sphere_orders_share_out_the_flux() -> None:
    shares = [GlassSphere(1.0, 1.5, order=p).transmitted_flux() / np.pi for p in range(12)]
    assert sum(shares) == pytest.approx(1.0, abs=1e-3)  # grazing rays bounce many times
    assert shares[1] > 0.8


def test_sphere_reflection_agrees_with_traced_rays() -> None:
    sphere = GlassSphere(1.0, 1.5, order=0)
    theta = np.linspace(0.8, 1.55, 50)
    normal = np.stack([np.sin(theta), np.cos(theta)], axis=1)
    normal = np.insert(normal, 2, 0.0, axis=1)
    out = reflect(np.tile([0.0, -1.0, 0.0], (50, 1)), normal)
    radius = normal[:, 0] - out[:, 0] * (normal[:, 1] + 1.5) / out[:, 1]
    np.testing.assert_allclose(np.asarray(sphere.fan().landing_m(theta)), radius, rtol=1e-9)


@pytest.mark.parametrize("height", [1.2, 2.0], ids=["cusp on the axis", "past the focus"])
def test_sphere_pixels_hold_the_energy_and_the_profile(height: float) -> None:
    sphere = GlassSphere(1.0, height)
    edges = pixel_edges(1.5, 64)
    image = sphere.pixel_irradiance(edges, edges, rings_per_pixel=8)
    within = sphere.flux_within(1.5)
    landed = (image * pixel_areas(edges, edges)).sum()
    assert within < landed < sphere.flux_within(1.5 * math.sqrt(2))
    np.testing.assert_allclose(image, image[::-1], atol=1e-9)
    np.testing.assert_allclose(image, image.T, atol=1e-9)
    # a pixel away from folds: the average of point values
    sub = (edges[44] + np.arange(20) / 20 * (edges[45] - edges[44])) + 0.025 * (edges[45] - edges[44])
    x, z = np.meshgrid(sub, sub)
    assert image[44, 44] == pytest.approx(sphere.irradiance(np.hypot(x, z)).mean(), rel=2e-3)


def test_sphere_paraxial_axis() -> None:
    # on the axis beyond the focus f = nR / 2(n - 1) = 1.5 R: E = E_perp T^2 / (1 - h / f)^2
    sphere = GlassSphere(1.0, 3.0)
    assert float(sphere.irradiance(1e-4)) == pytest.approx(0.96**2 / (1 - 3.0 / 1.5) ** 2, rel=1e-5)


def test_sphere_refuses_to_sink() -> None:
    with pytest.raises(UsageError, match="above the floor"):
        GlassSphere(1.0, 0.5)


# Mirror cylinder


MIRROR = MirrorCylinder(1.0, math.radians(45), 0.9, e_perp=2.0, reflectance=0.9)


def test_nephroid_landing_agrees_with_mirrored_rays() -> None:
    azimuth, height = np.random.default_rng(7).uniform([-1.0, 0.1], [1.0, 0.8], (100, 2)).T
    wall = np.stack([np.cos(azimuth), height, np.sin(azimuth)], axis=1)
    light = np.array([math.cos(0.6), -math.sin(0.6), 0.0])
    out = reflect(light, wall * [1, 0, 1])
    floor = wall + out * (height / -out[:, 1])[:, None]
    x, z = MIRROR.landing_m(azimuth, height / math.tan(0.6))
    np.testing.assert_allclose(np.stack([x, z], axis=1), floor[:, [0, 2]], atol=1e-12)


def test_nephroid_has_its_cusp_at_half_the_radius() -> None:
    azimuth = np.linspace(-0.2, 0.2, 2001)
    x, z = MIRROR.landing_m(azimuth, 0.5 * np.cos(azimuth))  # the envelope
    middle = azimuth.size // 2
    assert MIRROR.cusp_m == (0.5, 0.0)
    assert (x[middle], z[middle]) == pytest.approx(MIRROR.cusp_m, abs=1e-12)
    assert x.min() == x[middle]
    # at a cusp both derivatives vanish: z grows with the cube
    assert z[-1] / z[middle + 500] == pytest.approx(8.0, rel=0.05)
    # the nephroid of a circle of radius R: x = (3 cos p - cos 3p) R / 4, z = (3 sin p - sin 3p) R / 4
    np.testing.assert_allclose(x, (3 * np.cos(azimuth) - np.cos(3 * azimuth)) / 4, atol=1e-12)
    np.testing.assert_allclose(z, (3 * np.sin(azimuth) - np.sin(3 * azimuth)) / 4, atol=1e-12)


def test_nephroid_pixels_hold_the_energy_and_the_point_values() -> None:
    edges = pixel_edges(1.3, 64)
    image = MIRROR.pixel_irradiance(edges, edges, beams_per_side=2048)
    assert (image * pixel_areas(edges, edges)).sum() == pytest.approx(MIRROR.flux(), rel=1e-9)
    assert MIRROR.flux() == pytest.approx(2 * 0.9 * math.cos(math.pi / 4) * 0.9 * 2 * math.sin(math.pi / 3))
    sub = (np.arange(16 * 64) + 0.5) / (16 * 64) * 2.6 - 1.3
    points = box_filter(MIRROR.irradiance(*np.meshgrid(sub[448:576] + 0.4, sub[448:576])), (8, 8))
    shifted = MIRROR.pixel_irradiance(edges[28:37] + 0.4, edges[28:37])
    quiet = np.abs(points - np.median(points)) < 1.0  # no fold in the pixel: there 16^2 points are too few
    assert quiet.sum() > 20
    np.testing.assert_allclose(points[quiet], shifted[quiet], rtol=0.02)
    np.testing.assert_allclose(np.median(points / shifted), 1.0, atol=2e-3)


def test_nephroid_refuses_second_reflections() -> None:
    with pytest.raises(UsageError, match="s_max"):
        MirrorCylinder(1.0, 0.7, 1.1)


# Beams


def test_beams_agree_with_the_cosine_wave() -> None:
    a, k = FOLDED.amplitude_m, FOLDED.wavenumber_per_m
    theta = math.radians(20)
    water = replace(FOLDED, theta_rad=theta, sigma_a_per_m=0.3)
    edges = pixel_edges(1.5, 96)
    image = beam_irradiance(
        sine_field([(a, k, 0.0, math.pi / 2)]),
        light_direction_ws=(math.sin(theta), -math.cos(theta), 0.0),
        depth_m=1.0,
        x_range_m=(-1, 1),
        z_range_m=(-0.5, 0.5),
        x_edges_m=edges,
        z_edges_m=edges,
        sigma_a_per_m=0.3,
        beams_per_side=1024,
    )
    expected = water.pixel_irradiance(edges, edges, (-0.5, 0.5))
    assert image.flux_landed_w == pytest.approx(water.flux_per_m(), rel=1e-4)
    assert image.flux_outside_w == image.flux_lost_w == 0.0
    assert image.flux_entered_w == pytest.approx(image.flux_landed_w + image.flux_reflected_w, rel=1e-12)
    full = expected.max(axis=0)  # over rows that the water covers wholly
    np.testing.assert_allclose(image.irradiance[40:56].mean(axis=0), full, atol=0.02 * full.mean())


def test_beams_are_deterministic_and_halves_independent() -> None:
    edges = pixel_edges(0.75, 64)
    options = {
        "light_direction_ws": (0.2, -1, 0.1),
        "depth_m": 1.0,
        "x_range_m": (-1, 1),
        "z_range_m": (-1, 1),
        "x_edges_m": edges,
        "z_edges_m": edges,
        "fresnel": False,
        "beams_per_side": 1024,
    }
    field = peer_pool_field(1.0)
    first, again, other = (beam_irradiance(field, seed=s, **options) for s in (1, 1, 2))
    np.testing.assert_array_equal(first.irradiance, again.irradiance)
    difference = first.irradiance - other.irradiance
    assert 0.0 < np.sqrt((difference**2).mean()) < 0.1 * first.irradiance.mean()
    assert first.flux_reflected_w == 0.0
    with pytest.raises(UsageError, match="does not point down"):
        beam_irradiance(field, **(options | {"light_direction_ws": (0, 1, 0)}))


def test_fields_give_their_own_gradient() -> None:
    field = peer_pool_field(2.0)
    x, z = np.random.default_rng(3).uniform(-1, 1, (2, 50))
    h = 1e-6
    slope_x, slope_z = field.gradient(x, z)
    np.testing.assert_allclose(slope_x, (field.height_m(x + h, z) - field.height_m(x - h, z)) / (2 * h), atol=1e-8)
    np.testing.assert_allclose(slope_z, (field.height_m(x, z + h) - field.height_m(x, z - h)) / (2 * h), atol=1e-8)


# Bins and pixels


def test_deposit_spreads_evenly_and_keeps_what_lies_inside() -> None:
    edges = np.array([0.0, 1.0, 2.0, 4.0])
    start, end = np.array([0.5, 3.0, -1.0, 0.2, np.nan]), np.array([3.5, 2.5, 0.5, 0.2, 1.0])
    deposited = deposit_segments(start, end, np.array([3.0, 1.0, 3.0, 7.0, 9.0]), edges)
    np.testing.assert_allclose(deposited, [0.5 + 1.0 + 7.0, 1.0, 1.5 + 1.0])


def test_disc_areas() -> None:
    assert disc_quadrant_area(5, 5, 2) == pytest.approx(math.pi)
    assert disc_quadrant_area(1, 1, 2) == pytest.approx(1.0)
    assert disc_quadrant_area(-1, 1, 2) == pytest.approx(-1.0)
    x = (np.arange(2000) + 0.5) / 2000
    inside = np.hypot(*np.meshgrid(x * 0.9, x * 0.7)) < 1.0
    assert disc_quadrant_area(0.9, 0.7, 1.0) == pytest.approx(inside.mean() * 0.63, rel=1e-4)


def test_constant_rings_fill_pixels_evenly() -> None:
    edges = np.linspace(0, 2, 41)
    pixels = pixel_edges(1.0, 8, 0.1)
    image = radial_to_pixels(np.pi * np.diff(edges**2) * 2.5, edges, pixels, pixels)
    np.testing.assert_allclose(image, 2.5, rtol=1e-10)


def test_box_filter() -> None:
    np.testing.assert_allclose(box_filter(np.arange(16.0).reshape(4, 4), (2, 2)), [[2.5, 4.5], [10.5, 12.5]])
    assert box_filter(np.zeros((8, 4, 3)), (4, 2)).shape == (4, 2, 3)
    with pytest.raises(UsageError, match="does not reduce"):
        box_filter(np.zeros((5, 4)), (2, 2))
