"""Fresnel, absorption, reflection and refraction against textbook values and against each other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from glcaustics.errors import UsageError
from glcaustics.optics.fresnel import beer_lambert, fresnel_dielectric, fresnel_schlick, transmittance_dielectric
from glcaustics.optics.refract import reflect, refract


def unit_vectors(count: int, seed: int) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize(("n_from", "n_to"), [(1.0, 1.5), (1.5, 1.0), (1.0, 1.333)])
def test_fresnel_at_normal_incidence(n_from: float, n_to: float) -> None:
    assert fresnel_dielectric(1.0, n_from, n_to) == pytest.approx(((n_to - n_from) / (n_to + n_from)) ** 2, rel=1e-14)


def test_fresnel_at_brewsters_angle_is_half_of_s() -> None:
    theta = math.atan(1.5)  # no p-polarised reflection here; r_s = -cos(2 theta)
    assert fresnel_dielectric(math.cos(theta), 1.0, 1.5) == pytest.approx(0.5 * math.cos(2 * theta) ** 2, rel=1e-13)


def test_fresnel_limits() -> None:
    assert fresnel_dielectric(0.0, 1.0, 1.5) == 1.0
    critical = math.cos(math.asin(1 / 1.5))
    cosines = np.array([critical * 0.999, critical * 1.001, 0.0])
    reflectance = fresnel_dielectric(cosines, 1.5, 1.0)
    assert reflectance[0] == 1.0 and 0.5 < reflectance[1] < 1.0 and reflectance[2] == 1.0
    assert np.all(fresnel_dielectric(np.linspace(0, 1, 11), 1.3, 1.3) == 0.0)


def test_fresnel_is_reciprocal() -> None:
    cos_i = np.linspace(0.01, 1.0, 100)
    cos_t = np.sqrt(1 - (1 - cos_i**2) / 1.5**2)
    np.testing.assert_allclose(fresnel_dielectric(cos_i, 1.0, 1.5), fresnel_dielectric(cos_t, 1.5, 1.0), rtol=1e-9)
    np.testing.assert_allclose(fresnel_dielectric(-cos_i, 1.0, 1.5), fresnel_dielectric(cos_i, 1.0, 1.5))


def test_fresnel_of_water_from_the_tables() -> None:
    # Hecht, Optics: water reflects 2.0 % at 0, 6 % at 60 and 34.9 % at 80 degrees of unpolarised light
    reflectance = fresnel_dielectric(np.cos(np.radians([0, 60, 80])), 1.0, 1.333)
    np.testing.assert_allclose(reflectance, [0.0204, 0.0596, 0.348], atol=1e-3)


def test_fresnel_broadcasts_and_refuses_nonsense() -> None:
    assert fresnel_dielectric(np.ones((4, 1)), 1.0, np.array([1.3, 1.5, 1.7])).shape == (4, 3)
    np.testing.assert_allclose(transmittance_dielectric(1.0, 1.0, 1.5), 0.96)
    with pytest.raises(UsageError, match="index of refraction"):
        fresnel_dielectric(1.0, 0.0, 1.5)
    with pytest.raises(UsageError, match="cos_i"):
        fresnel_dielectric(1.1, 1.0, 1.5)


def test_schlick_of_a_metal() -> None:
    gold = np.array([1.0, 0.766, 0.336])
    np.testing.assert_allclose(fresnel_schlick(1.0, gold), gold)
    np.testing.assert_allclose(fresnel_schlick(0.0, gold), 1.0)
    np.testing.assert_allclose(fresnel_schlick(0.5, 0.04), 0.04 + 0.96 / 32)


def test_beer_lambert() -> None:
    np.testing.assert_allclose(beer_lambert(np.log(2.0), [0.0, 1.0, 2.0]), [1.0, 0.5, 0.25])
    with pytest.raises(UsageError):
        beer_lambert(-1.0, 1.0)


def test_reflect_mirrors() -> None:
    d, n = unit_vectors(1000, 1), unit_vectors(1000, 2)
    mirrored = reflect(d, n)
    np.testing.assert_allclose(np.linalg.norm(mirrored, axis=1), 1.0)
    np.testing.assert_allclose((mirrored * n).sum(1), -(d * n).sum(1), atol=1e-12)
    np.testing.assert_allclose(reflect(mirrored, n), d, atol=1e-12)


@pytest.mark.parametrize(("n_from", "n_to"), [(1.0, 1.5), (1.5, 1.0), (1.333, 1.5)])
def test_refract_obeys_snell_on_either_side(n_from: float, n_to: float) -> None:
    d, n = unit_vectors(4000, 3), unit_vectors(4000, 4)
    t, tir = refract(d, n, n_from, n_to)
    np.testing.assert_allclose(np.linalg.norm(t, axis=1), 1.0)
    ok = ~tir
    np.testing.assert_allclose(n_to * np.cross(t, n)[ok], n_from * np.cross(d, n)[ok], atol=1e-12)
    assert np.all(((t * n).sum(1) * (d * n).sum(1))[ok] > 0)  # it goes on to the other side
    sin_i = np.linalg.norm(np.cross(d, n), axis=1)
    np.testing.assert_array_equal(tir, n_from / n_to * sin_i >= 1.0)
    np.testing.assert_allclose(t[tir], reflect(d, n)[tir])
    assert tir.any() == (n_from > n_to)


def test_refract_is_reversible_and_takes_arrays_of_indices() -> None:
    d, n = unit_vectors(500, 5), unit_vectors(500, 6)
    ior = np.linspace(1.0, 2.0, 500)
    t, tir = refract(d, n, 1.0, ior)
    back, _ = refract(-t, n, ior, 1.0)
    assert not tir.any()
    np.testing.assert_allclose(back, -d, atol=1e-10)
