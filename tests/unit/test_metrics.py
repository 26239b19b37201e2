"""Metrics on images whose error is known by construction."""

from __future__ import annotations

import math

import numpy as np
import pytest

from glcaustics import metrics
from glcaustics.errors import UsageError

RANDOM = np.random.default_rng(3)
REFERENCE = 1.0 + RANDOM.random((48, 64, 3))


def test_relative_rmse_by_hand() -> None:
    test = REFERENCE + np.where(np.indices((48, 64))[1][..., None] % 2, 0.3, -0.3)
    assert metrics.relative_rmse(REFERENCE, test) == pytest.approx(0.3 / REFERENCE.mean())
    assert metrics.relative_rmse(REFERENCE, REFERENCE) == 0.0
    assert metrics.mean_absolute_error(REFERENCE, test) == pytest.approx(0.3 / REFERENCE.mean())


def test_halves_take_the_references_noise_off() -> None:
    a, b = (REFERENCE + RANDOM.normal(0, 0.2, REFERENCE.shape) for _ in range(2))
    test = REFERENCE + np.where(np.indices((48, 64))[0][..., None] % 2, 0.1, -0.1)
    true = 0.1 / REFERENCE.mean()
    assert metrics.relative_rmse(a, test) > 2 * true
    assert metrics.relative_rmse(a, test, other_half=b) == pytest.approx(true, rel=0.1)


def test_normalised_errors_see_the_pattern_alone() -> None:
    assert metrics.relative_rmse(REFERENCE, 3 * REFERENCE, normalise=True) == pytest.approx(0.0, abs=1e-7)
    assert metrics.mean_absolute_error(REFERENCE, 3 * REFERENCE, normalise=True) == pytest.approx(0.0, abs=1e-12)
    assert metrics.relative_rmse(REFERENCE, 3 * REFERENCE) > 2


def test_bias_and_mask() -> None:
    test, mask = REFERENCE.copy(), np.zeros((48, 64), bool)
    test[:10] *= 1.25
    mask[:10] = True
    assert metrics.bias_of_mean(REFERENCE, test, mask=mask) == pytest.approx(0.25)
    assert metrics.bias_of_mean(REFERENCE, test, mask=~mask) == 0.0
    assert metrics.relative_rmse(REFERENCE, test, mask=~mask) == 0.0


def test_psnr() -> None:
    assert metrics.psnr(REFERENCE, REFERENCE + 0.01, peak=1.0) == pytest.approx(40.0)
    assert metrics.psnr(REFERENCE, REFERENCE) == math.inf


def test_flux_balance() -> None:
    irradiance = np.full((4, 8, 3), 2.0) * [1, 2, 3]
    balance = metrics.flux_balance(irradiance, 0.5, (32.0, 64.0, 96.0 / 1.1))
    np.testing.assert_allclose(balance, [0, 0, 0.1], atol=1e-12)
    area = np.linspace(0, 1, 32).reshape(4, 8)
    assert metrics.flux_balance(np.ones((4, 8)), area, 16.0)[0] == pytest.approx(0.0)


def test_non_finite_share_counts_pixels() -> None:
    image = np.ones((10, 10, 3))
    image[2, 3] = np.nan
    image[4, 5, 1] = np.inf
    assert metrics.non_finite_share(image) == 0.02
    assert metrics.non_finite_share(image[..., 0]) == 0.01
    with pytest.raises(UsageError, match="test has 4 values that are not finite"):
        metrics.relative_rmse(np.ones((10, 10, 3)), image)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: metrics.psnr(np.ones((4, 4)), np.ones((4, 5))), "test is"),
        (lambda: metrics.bias_of_mean(np.zeros((4, 4)), np.ones((4, 4))), "mean is 0"),
        (lambda: metrics.relative_rmse(np.ones((4, 4)), np.ones((4, 4)), mask=np.zeros((4, 4))), "no pixel"),
        (lambda: metrics.relative_rmse(np.ones((4, 4)), np.ones((4, 4)), mask=np.ones((4, 3))), "mask is"),
        (lambda: metrics.psnr(np.ones(4), np.ones(4)), "shape"),
        (lambda: metrics.flux_balance(np.ones((2, 2)), 1.0, 0.0), "not positive"),
        (lambda: metrics.non_finite_share(np.ones((0, 2))), "empty"),
        (lambda: metrics.static_flicker(np.ones((1, 4, 4))), "sequence has shape"),
        (lambda: metrics.moving_flicker(np.ones((2, 4, 4)), np.ones((3, 4, 4))), "references"),
        (lambda: metrics.flip(np.ones((16, 16, 3)) * 2, np.ones((16, 16, 3)), hdr=False), "outside"),
        (lambda: metrics.flip(np.ones((16, 16, 3), np.uint8), np.ones((16, 16, 3)), hdr=True), "8-bit"),
    ],
)
def test_refusals_are_one_line(call, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(UsageError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_flicker_of_noise_and_of_motion() -> None:
    noise = RANDOM.normal(0, 0.05, (12, 48, 64))
    assert metrics.static_flicker(1 + noise) == pytest.approx(0.05 * math.sqrt(2), rel=0.05)
    assert metrics.static_flicker(np.ones((3, 4, 4, 3))) == 0.0
    x = np.arange(64) / 64
    truth = np.stack([np.tile(2 + np.sin(2 * np.pi * (x - 0.05 * t)), (48, 1)) for t in range(12)])
    assert metrics.static_flicker(truth) > 0.1
    assert metrics.moving_flicker(truth, truth) == 0.0
    assert metrics.moving_flicker(truth + 0.3, truth) == pytest.approx(0.0, abs=1e-12)  # steady error does not flicker
    assert metrics.moving_flicker(truth + noise, truth) == pytest.approx(0.05 * math.sqrt(2) / 2, rel=0.05)


@pytest.mark.parametrize("hdr", [False, True])
def test_flip_orders_images_as_the_eye_does(hdr: bool) -> None:
    clean = np.clip(REFERENCE - 1.0, 0.0, 1.0).astype(np.float32)
    slight, strong = np.clip(clean * 1.05, 0, 1), np.clip(clean * 1.5, 0, 1)
    exposures = (-1.0, 1.0)
    equal = metrics.flip(clean, clean, hdr=hdr, exposures=exposures)
    assert equal.mean == 0.0 and equal.error_map.shape == (48, 64)
    a = metrics.flip(clean, slight, hdr=hdr, exposures=exposures)
    b = metrics.flip(clean, strong, hdr=hdr, exposures=exposures)
    assert 0.0 < a.mean < b.mean < 1.0
    assert a.error_map.mean() == pytest.approx(a.mean, rel=1e-3)


def test_flip_reads_8_bit_as_encoded() -> None:
    encoded = RANDOM.integers(0, 256, (32, 32, 3), dtype=np.uint8)
    other = np.clip(encoded.astype(int) + 20, 0, 255).astype(np.uint8)
    as_float = metrics.flip(encoded / np.float32(255), other / np.float32(255), hdr=False).mean
    assert metrics.flip(encoded, other, hdr=False).mean == pytest.approx(as_float, rel=1e-6)
