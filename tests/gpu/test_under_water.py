"""The eye inside water or glass: absorption on its way, Snell's window, total reflection around it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from glcaustics.optics.fresnel import transmittance_dielectric
from glcaustics.renderer import Frame
from glcaustics.scene.model import Camera, Instance, Material, Scene, Sky
from tests.gpu.feature_scenes import (
    GLASS,
    MIRROR,
    WATER,
    box,
    eye_rays,
    plane,
    scene_of,
    sheet,
    shoot,
    sun,
    translation,
)
from tests.gpu.physics_meshes import icosphere

pytestmark = pytest.mark.gpu
N = 1.333
SEA = replace(WATER, attenuation_color=(0.2, 0.6, 0.8), attenuation_distance_m=2.0)
GREY = Material("grey", base_color=(0.5, 0.5, 0.5))
SKY = Sky(zenith=(3.0, 4.0, 5.0), horizon=(3.0, 4.0, 5.0), ground=(0.0, 0.0, 0.0))
SIZE = (96, 64)


def look(scene: Scene, aovs: tuple[str, ...] = ("solve_status",), **more: object) -> Frame:
    return shoot(scene, SIZE, specular_view=True, aovs=aovs, **{"quality": "medium", **more})


def pool(
    eye: tuple[float, float, float], target: tuple[float, float, float], *more: Instance, fov: float = 1.2
) -> Scene:
    """Flat absorbing water over a grey floor 2 m down, vertical sun of 100 lux, a grey sky."""
    camera = Camera.look_at(eye, target, yfov_rad=fov)
    return scene_of(
        [plane("floor", 40.0, -2.0, GREY), sheet("sea", 40.0, 0.0, SEA), *more], [sun(0.0, 100.0)], camera, sky=SKY
    )


def floor_radiance() -> np.ndarray:
    """Of the floor, at the floor: rho / pi times the sun through 2 m of water and the whole sky's light."""
    sunlit = 100.0 * float(transmittance_dielectric(1.0, 1.0, N)) * np.exp(-SEA.sigma_a * 2.0)
    return np.asarray(0.5 / math.pi * (sunlit + math.pi * np.array(SKY.zenith)))


@pytest.mark.smoke
def test_a_floor_seen_directly_is_absorbed_and_its_caustics_are_not() -> None:
    """L = L_floor exp(-sigma d) with d from the eye to the floor; E_c is the floor's, as without the water's view."""
    scene = pool((0.0, -0.5, 0.0), (0.3, -2.0, 0.4))
    frame = look(scene, ("caustic_irradiance", "solve_status"))
    down = eye_rays(scene.camera, SIZE)
    distance = -1.5 / down[..., 1:2]
    expected = floor_radiance() * np.exp(-SEA.sigma_a * distance)
    assert (frame.aov["solve_status"] == 0).all()
    assert frame.stats["eye_medium"].startswith("the eye is in 'sea' (index 1.333, absorption 0.805, ")
    ratio = frame.image / expected
    np.testing.assert_allclose(ratio.mean(axis=(0, 1)), 1.0, rtol=0.002)
    assert np.abs(ratio - 1.0).max() < 0.02  # the caustic map's own grain
    past = shoot(scene, SIZE, specular_view=False, aovs=("caustic_irradiance",)).aov["caustic_irradiance"]
    np.testing.assert_array_equal(frame.aov["caustic_irradiance"], past)


def test_snells_window_and_the_mirror_around_it() -> None:
    """Level view half a metre down. Inside asin(1/n): n^2 T(theta) L_sky exp(-sigma d); outside: the floor's mirror
    image, absorbed on both its ways. The rim lies where it must within a pixel."""
    scene = pool((0.0, -0.5, 0.0), (0.0, -0.5, -1.0), fov=2.2)
    frame = look(scene)
    image, status, d = frame.image.astype(np.float64), frame.aov["solve_status"], eye_rays(scene.camera, SIZE)
    up = d[..., 1] > 0.02
    cos_i = np.where(up, d[..., 1], 1.0)
    sin_out = N * np.sqrt(1.0 - cos_i**2)
    inside, outside = up & (sin_out < 0.97), up & (sin_out > 1.03) & (2.5 / cos_i < 30.0)
    assert inside.sum() > 300 and outside.sum() > 500
    np.testing.assert_array_equal(np.unique(status[inside]), [2])
    np.testing.assert_array_equal(np.unique(status[outside]), [4])
    share = 1.0 - transmittance_dielectric(cos_i, N, 1.0)
    window = N**2 * (1.0 - share)[..., None] * np.array(SKY.zenith) * np.exp(-SEA.sigma_a * (0.5 / cos_i)[..., None])
    mirror = share[..., None] * floor_radiance() * np.exp(-SEA.sigma_a * (2.5 / cos_i)[..., None])
    # The weak reflection inside the window is left to the sky below 7 % (REFLECT_FROM, refraction.frag), here black.
    assert (np.abs(image - window)[inside] < mirror[inside] + 0.01 * window[inside]).all()
    error = np.abs(image[outside] / mirror[outside] - 1.0)
    print("mirror around the window: median error", np.median(error), "95th percentile", np.percentile(error, 95))
    assert np.median(error) < 0.01 and np.percentile(error, 95) < 0.03
    rim = np.array([np.flatnonzero(status[:, column] == 4)[:1] for column in range(30, 66)])
    truth = np.array([np.flatnonzero(up[:, column] & (sin_out[:, column] > 1.0))[:1] for column in range(30, 66)])
    assert np.abs(rim - truth).max() <= 1


def test_what_stands_outside_is_right_side_up_in_the_window() -> None:
    """A red wall above a green one, out of the water: each pixel of the window shows what its refracted ray meets."""
    red = Material("red", base_color=(0.0, 0.0, 0.0), emissive=(9.0, 1.0, 1.0))
    green = Material("green", base_color=(0.0, 0.0, 0.0), emissive=(1.0, 9.0, 1.0))
    high = box("high", (8.0, 1.0, 0.2), (0.0, 2.5, -3.0), red)
    low = box("low", (8.0, 1.0, 0.2), (0.0, 1.5, -3.0), green)
    scene = pool((0.0, -0.4, 0.0), (0.0, 0.6, -1.0), high, low, fov=1.3)
    frame = look(scene)
    d = eye_rays(scene.camera, SIZE)
    at = np.array([0.0, -0.4, 0.0]) + d * (0.4 / np.maximum(d[..., 1:2], 1e-3))
    side = N * d[..., [0, 2]]
    out_y = np.sqrt(np.maximum(1.0 - (side**2).sum(axis=2), 0.0))
    t = (-2.9 - at[..., 2]) / np.minimum(side[..., 1], -1e-6)
    height, x = t * out_y, at[..., 0] + t * side[..., 0]
    window = (d[..., 1] > 0.05) & (out_y > 0.02) & (side[..., 1] < -1e-3) & (np.abs(x) < 3.5)
    image = frame.image
    for low_m, high_m, wins, loses in ((2.1, 2.9, 0, 1), (1.1, 1.9, 1, 0)):
        shown = window & (height > low_m) & (height < high_m)
        assert shown.sum() > 60
        # The walls stand on the picture straight behind the water: the screen holds them.
        assert (image[shown][:, wins] > 3.0 * image[shown][:, loses]).mean() > 0.95


def test_a_mirror_under_water_is_absorbed_on_both_ways() -> None:
    """An upright mirror shows the floor as far away as the way over the mirror is."""
    mirror = box("mirror", (8.0, 4.0, 0.2), (0.0, -2.0, -2.1), MIRROR)
    scene = pool((0.0, -1.0, 0.0), (0.0, -1.7, -1.0), mirror, fov=1.5)
    frame, d = look(scene), eye_rays(scene.camera, SIZE)
    virtual = d * (1.0 / np.maximum(-d[..., 1:2], 1e-3))  # where the ray would meet the floor without the mirror
    shows = (virtual[..., 2] < -2.2) & (virtual[..., 2] > -3.5) & (np.abs(virtual[..., 0]) < 1.0)
    expected = floor_radiance() * np.exp(-SEA.sigma_a * np.linalg.norm(virtual, axis=2)[..., None])
    assert shows.sum() > 60
    np.testing.assert_allclose(np.median(frame.image[shows] / expected[shows], axis=0), 1.0, rtol=0.01)


def test_a_ball_of_water_under_water_cannot_be_seen() -> None:
    """Index and absorption are the medium's: what refracts is the ratio of the two indices."""
    ball = Instance("ball", icosphere("ball", 0.3, 24), replace(SEA, name="drop"), translation(0.0, -1.5, -1.0))
    scenes = [pool((0.0, -1.0, 0.0), (0.0, -1.5, -1.0), *more) for more in ([], [ball])]
    bare, frame = (look(scene, method="none") for scene in scenes)
    shown = (frame.aov["solve_status"] > 0) & (bare.aov["solve_status"] == 0)
    assert shown.sum() > 500
    difference = np.abs(frame.image.astype(np.float64) - bare.image)[shown] / bare.image.mean()
    print("ball of water in water: mean", difference.mean(), "largest", difference.max())
    assert np.percentile(difference, 99) < 1e-3 and difference.max() < 0.05


def test_inside_a_block_of_glass() -> None:
    """Out through the flat face of a closed solid: n^2 T L exp(-sigma d); beyond the critical angle it mirrors."""
    glass = replace(GLASS, attenuation_color=(0.3, 0.6, 0.9), attenuation_distance_m=1.0)
    glow = Material("glow", base_color=(0.0,) * 3, emissive=(5.0, 5.0, 5.0))
    scene = scene_of(
        [box("block", (4.0, 4.0, 2.0), (0.0, 0.0, 0.0), glass), box("wall", (60.0, 60.0, 0.2), (0.0, 0.0, -4.0), glow)],
        [sun(0.0, 1.0)],
        Camera.look_at((0.0, 0.0, 0.2), (0.0, 0.0, -1.0), yfov_rad=0.9),
    )
    frame, cos_i = look(scene), -eye_rays(scene.camera, SIZE)[..., 2]
    inside = 1.5 * np.sqrt(1.0 - cos_i**2) < 0.9
    expected = 1.5**2 * 5.0 * transmittance_dielectric(cos_i, 1.5, 1.0)[..., None]
    expected = expected * np.exp(-glass.sigma_a * (1.2 / cos_i)[..., None])
    assert inside.sum() > 2000
    np.testing.assert_allclose(frame.image[inside], expected[inside], rtol=0.03)
    assert (frame.aov["solve_status"][1.5 * np.sqrt(1.0 - cos_i**2) > 1.05] == 4).all()


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_under_water_at_any_scale(scale: float) -> None:
    """The same scene a thousand times smaller or larger, absorption along with it: the same picture."""
    from glcaustics.scene.transform import scaled

    small, base = scaled(pool((0.0, -0.5, 0.0), (0.5, -0.4, -1.0)), scale), pool((0.0, -0.5, 0.0), (0.5, -0.4, -1.0))
    a, b = look(small).image, look(base).image
    assert np.percentile(np.abs(a - b) / b.mean(), 99) < 2e-3
