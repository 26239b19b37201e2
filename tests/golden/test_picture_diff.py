"""The tolerance of the goldens passes rounding and fails a small but real change."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.golden import picture_diff


@pytest.fixture
def picture() -> picture_diff.Picture:
    rows, columns = np.mgrid[0:192, 0:256]
    return np.stack([rows, columns, (rows + columns) // 2], axis=-1).astype(np.uint8)


def test_rounding_and_a_few_edge_pixels_pass(picture: picture_diff.Picture) -> None:
    rng = np.random.default_rng(3)
    noisy = picture.astype(int) + (rng.random(picture.shape) < 0.3) * rng.choice([-1, 1], picture.shape)
    noisy[100, 40:60] = 255  # 20 of 49152 pixels
    assert picture_diff.difference(np.clip(noisy, 0, 255).astype(np.uint8), picture).within_tolerance


def test_one_percent_of_exposure_fails(picture: picture_diff.Picture) -> None:
    brighter = np.round(picture * 1.01).clip(0, 255).astype(np.uint8)
    assert not picture_diff.difference(brighter, picture).within_tolerance


def test_a_small_patch_fails(picture: picture_diff.Picture) -> None:
    patched = picture.copy()
    patched[80:90, 100:110] ^= 32  # 100 of 49152 pixels
    assert not picture_diff.difference(patched, picture).within_tolerance


def test_a_failure_keeps_both_pictures(picture: picture_diff.Picture, tmp_path: Path) -> None:
    changed = picture.copy()
    changed[0, 0, 0] += 2
    kept = picture_diff.keep_failure(tmp_path / "failed", "x", changed, picture)
    np.testing.assert_array_equal(picture_diff.load(kept[0]), changed)
    shown = picture_diff.load(kept[1])
    assert shown[0, 0, 0] == 2 * picture_diff.DIFF_GAIN and shown[1:].max() == 0
