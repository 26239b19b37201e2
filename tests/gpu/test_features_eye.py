"""What the eye sees through water and glass and in a mirror: radiance against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from glcaustics.optics.fresnel import transmittance_dielectric
from glcaustics.scene.model import Camera, Instance, Material, Scene, Sky
from tests.gpu.feature_scenes import GLASS, MIRROR, WATER, box, lamp, plane, scene_of, sheet, shoot, sun, translation
from tests.gpu.physics_meshes import icosphere

pytestmark = pytest.mark.gpu
RHO = 0.5
GREY = Material("grey", base_color=(RHO, RHO, RHO))


def transmitted(theta_rad: float, ior: float) -> float:
    return float(transmittance_dielectric(math.cos(theta_rad), 1.0, ior))


def eye_at(theta_deg: float, distance_m: float = 3.0) -> Camera:
    theta = math.radians(theta_deg)
    eye = (0.0, distance_m * math.cos(theta), distance_m * math.sin(theta))
    return Camera.look_at(eye, (0.0, 0.0, 0.0), orthographic=True, ymag_m=1.0)


@pytest.mark.parametrize("absorbing", [False, True])
@pytest.mark.parametrize("theta", [0.0, pytest.param(40.0, marks=pytest.mark.smoke), 65.0])
def test_floor_under_flat_water(theta: float, absorbing: bool) -> None:
    """L = T(eye) rho E / (pi n^2) exp(-sigma d / cos t'), E = E_perp T(light) exp(-sigma d)."""
    depth = 0.4
    material = replace(WATER, attenuation_color=(0.1, 0.5, 0.9), attenuation_distance_m=1.0) if absorbing else WATER
    scene = scene_of(
        [plane("floor", 3.0, -depth, GREY), sheet("water", 2.5, 0.0, material)], [sun(0.0, 100.0)], eye_at(theta)
    )
    image = shoot(scene, (129, 129), quality="medium", specular_view=True, aovs=()).image.astype(np.float64)
    sin_t = math.sin(math.radians(theta)) / 1.333
    path = depth / math.sqrt(1 - sin_t**2)
    irradiance = 100.0 * transmitted(0.0, 1.333) * np.exp(-material.sigma_a * depth)
    radiance = transmitted(math.radians(theta), 1.333) * RHO * irradiance / (math.pi * 1.333**2)
    radiance *= np.exp(-material.sigma_a * path)
    print(theta, absorbing, image[64, 64] / radiance)
    np.testing.assert_allclose(image[56:73, 56:73].mean(axis=(0, 1)), radiance, rtol=0.01)


@pytest.mark.parametrize("theta", [0.0, 35.0])
def test_clear_slab_leaves_the_radiance_times_t_squared(theta: float) -> None:
    """A slab of glass before a uniformly lit wall: (n/n')^2 goes in and comes out again. Its own shadow is not lit: the
    lamp shines on the wall from the side, past the slab."""
    wall = plane("wall", 4.0, -3.0, GREY)
    slab = box("slab", (1.2, 0.1, 1.2), (0.0, 0.0, 0.0), GLASS)
    light = sun(60.0, 100.0)  # the slab's caustic falls at x ~ +5, past the wall's middle
    scene = scene_of([wall, slab], [light], eye_at(theta))
    frame = shoot(scene, (33, 33), specular_view=True, aovs=("direct_irradiance",))
    radiance = RHO * 100.0 * math.cos(math.radians(60.0)) / math.pi
    expected = radiance * transmitted(math.radians(theta), 1.5) ** 2
    print(theta, frame.image[16, 16] / expected)
    np.testing.assert_allclose(frame.image[13:20, 13:20, 1].mean(), expected, rtol=0.01)


def test_absorbing_slab_by_beer_lambert() -> None:
    material = replace(GLASS, attenuation_color=(0.2, 0.5, 0.9), attenuation_distance_m=0.2)
    scene = scene_of(
        [plane("wall", 4.0, -3.0, GREY), box("slab", (1.2, 0.1, 1.2), (0.0, 0.0, 0.0), material)],
        [sun(60.0, 100.0)],
        eye_at(0.0),
    )
    image = shoot(scene, (33, 33), specular_view=True, aovs=()).image
    expected = RHO * 50.0 / math.pi * transmitted(0.0, 1.5) ** 2 * np.exp(-material.sigma_a * 0.1)
    np.testing.assert_allclose(image[13:20, 13:20].mean(axis=(0, 1)), expected, rtol=0.01)


def mirror_room() -> Scene:
    """A mirror on the floor before a back wall whose left half is red and whose right half is green."""
    red = Material("red", base_color=(0.6, 0.05, 0.05))
    green = Material("green", base_color=(0.05, 0.6, 0.05))
    walls = [
        box("left", (2.0, 2.0, 0.1), (-1.0, 1.2, -2.0), red),
        box("right", (2.0, 2.0, 0.1), (1.0, 1.2, -2.0), green),
    ]
    camera = Camera.look_at((0.0, 1.0, 2.0), (0.0, 0.55, -1.0), yfov_rad=math.radians(60.0))
    return scene_of([plane("mirror", 1.0, 0.0, MIRROR), *walls], [lamp((0.0, 2.0, 1.0), 50.0)], camera)


def test_mirror_shows_the_wall_upside_down() -> None:
    """Each mirror pixel shows the wall point that the mirrored eye sees: same colour and radiance."""
    frame = shoot(mirror_room(), (160, 120), specular_view=True, quality="high", aovs=("solve_status", "depth_m"))
    image, status = frame.image.astype(np.float64), frame.aov["solve_status"]
    camera = mirror_room().camera.world_from_camera
    rows, columns = np.mgrid[0:120, 0:160]
    tangent = math.tan(math.radians(30.0))
    ray = (
        np.stack(
            (
                ((columns + 0.5) / 160 * 2 - 1) * tangent * 160 / 120,
                (1 - (rows + 0.5) / 120 * 2) * tangent,
                -np.ones_like(rows, float),
            ),
            2,
        )
        @ camera[:3, :3].T
    )
    eye = camera[:3, 3]
    t = -eye[1] / np.where(ray[..., 1] < 0, ray[..., 1], np.inf)
    floor = eye + t[..., None] * ray
    hits_mirror = (t > 0) & (np.abs(floor[..., 0]) < 0.97) & (np.abs(floor[..., 2]) < 0.97)
    mirrored = ray * (1.0, -1.0, 1.0)
    s = (-1.95 - floor[..., 2]) / mirrored[..., 2]
    wall = floor + s[..., None] * mirrored
    shows = hits_mirror & (s > 0) & (wall[..., 1] > 0.25) & (wall[..., 1] < 2.1)
    # what the eye sees directly at that wall point, where it is on the screen
    seen = (wall - eye) @ camera[:3, :3]
    u = (seen[..., 0] / -seen[..., 2] / (tangent * 160 / 120) * 0.5 + 0.5) * 160
    v = (0.5 - seen[..., 1] / -seen[..., 2] / tangent * 0.5) * 120
    shows &= (u > 2) & (u < 158) & (v > 2) & (v < 118) & (np.abs(wall[..., 0]) < 1.9) & (np.abs(wall[..., 0]) > 0.06)
    assert shows.sum() > 800
    direct = image[v[shows].astype(int), u[shows].astype(int)]
    error = np.abs(image[shows] - direct).max(axis=1) / direct.max(axis=1)
    print("mirror: share within 5 %:", (error < 0.05).mean(), "solved:", (status[shows] == 1).mean())
    assert (error < 0.05).mean() > 0.97
    left = shows & (wall[..., 0] < 0)
    assert (image[left][:, 0] > image[left][:, 1]).mean() > 0.97


def test_mirror_that_sees_nothing_shows_the_sky() -> None:
    sky = Sky(zenith=(1.0, 2.0, 3.0), horizon=(1.0, 2.0, 3.0), ground=(9.0, 9.0, 9.0))
    scene = scene_of([plane("mirror", 2.0, 0.0, MIRROR)], [sun()], eye_at(30.0), sky=sky)
    frame = shoot(scene, (17, 17), specular_view=True, aovs=("solve_status",))
    np.testing.assert_allclose(frame.image, np.broadcast_to((1.0, 2.0, 3.0), frame.image.shape), rtol=1e-3)
    assert (frame.aov["solve_status"] == 2).all()


def test_water_reflects_its_fresnel_share_of_the_sky() -> None:
    """Black floor: what is left is R(theta) L_sky."""
    sky = Sky(zenith=(5.0, 5.0, 5.0), horizon=(5.0, 5.0, 5.0))
    black = Material("black", base_color=(0.0, 0.0, 0.0))
    for theta in (0.0, 60.0, 80.0):
        scene = scene_of(
            [plane("floor", 3.0, -0.4, black), sheet("water", 2.5, 0.0)], [sun(0.0, 0.0)], eye_at(theta), sky=sky
        )
        image = shoot(scene, (17, 17), specular_view=True, aovs=()).image
        expected = 5.0 * (1.0 - transmitted(math.radians(theta), 1.333))
        np.testing.assert_allclose(image[8, 8], expected, rtol=0.01)


def test_under_water_the_floor_has_its_full_radiance_and_absorbs() -> None:
    """Eye and floor both under water: no interface between them. The water's absorption lies on the straight way."""
    depth = 1.0
    scene = scene_of(
        [plane("floor", 3.0, -depth, GREY), sheet("water", 2.5, 0.0)],
        [sun(0.0, 100.0)],
        Camera.look_at((0.0, -0.3, 0.0), (0.0, -1.0, 0.0), yfov_rad=0.6),
    )
    image = shoot(scene, (17, 17), specular_view=True, aovs=()).image
    expected = RHO * 100.0 * transmitted(0.0, 1.333) / math.pi
    np.testing.assert_allclose(image.mean(), expected, rtol=0.01)


def test_ball_of_index_one_is_invisible() -> None:
    """ior 1: nothing refracts or reflects; the picture is as without the ball."""
    air = replace(GLASS, ior=1.0)
    ball = Instance("ball", icosphere("ball", 0.3, 24), air, translation(0.0, 0.5, 0.0))
    camera = Camera.look_at((0.0, 1.5, 1.5), (0.0, 0.0, 0.0), yfov_rad=0.6)
    images = [
        shoot(
            scene_of([plane("floor", 2.0, 0.0, GREY), *more], [sun(30.0, 10.0)], camera),
            (96, 96),
            quality="high",
            specular_view=True,
            aovs=(),
        ).image.astype(np.float64)
        for more in ([], [ball])
    ]
    difference = np.abs(images[1] - images[0])[..., 1] / images[0][..., 1].mean()
    print("index 1: mean difference", difference.mean(), "99th percentile", np.percentile(difference, 99))
    assert difference.mean() < 0.01
    assert np.percentile(difference, 97) < 0.05
