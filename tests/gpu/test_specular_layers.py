"""A specular surface behind another one, against Snell's law and Fresnel's formulas in float64."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from glcaustics.errors import UsageError
from glcaustics.optics.fresnel import transmittance_dielectric
from glcaustics.renderer import Frame, plan_frame
from glcaustics.scene.model import Camera, Instance, Material, Scene, Sky
from glcaustics.scene.transform import scaled
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
from tests.gpu.physics_meshes import height_sheet, icosphere

pytestmark = pytest.mark.gpu
FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
SIZE = (160, 120)
N_WATER, N_GLASS = 1.333, 1.5
BLACK = Sky(zenith=(0.0,) * 3, horizon=(0.0,) * 3, ground=(0.0,) * 3)
GLOW = Material("glow", base_color=(0.0, 0.0, 0.0), emissive=(5.0, 5.0, 5.0))
SEA = replace(WATER, attenuation_color=(0.3, 0.6, 0.8), attenuation_distance_m=2.0)
GREEN = replace(GLASS, attenuation_color=(0.4, 0.8, 0.5), attenuation_distance_m=1.0)
X, Y, Z = np.eye(3)


def look(scene: Scene, **options: object) -> Frame:
    aovs = ("solve_status", "solve_hit", "depth_m")
    return shoot(scene, SIZE, method="none", specular_view=True, aovs=aovs, options=options)


def project(camera: Camera, p: FloatArray) -> FloatArray:
    """Pixels (..., 2) of points, origin at the bottom left."""
    q = (p - camera.position_ws) @ camera.world_from_camera[:3, :3]
    ndc = q[..., :2] / np.maximum(-q[..., 2:], 1e-9) / math.tan(0.5 * camera.yfov_rad)
    return np.asarray((ndc / (SIZE[0] / SIZE[1], 1.0) * 0.5 + 0.5) * SIZE)


class Path:
    """Rays that are followed through surfaces one after the other; `share` is what they carry to the eye."""

    def __init__(self, camera: Camera) -> None:
        self.d = eye_rays(camera, SIZE)
        self.p = np.broadcast_to(camera.position_ws, self.d.shape)
        self.share: FloatArray = np.ones(self.d.shape)
        self.alive: BoolArray = np.ones(self.d.shape[:2], bool)

    def walk(self, t: FloatArray, sigma_a: FloatArray | None = None) -> None:
        self.alive &= t > 0.0
        t = np.where(self.alive, t, 0.0)
        self.p = self.p + t[..., None] * self.d
        if sigma_a is not None:
            self.share = self.share * np.exp(-sigma_a * t[..., None])

    def to_plane(self, n: FloatArray, offset: float, sigma_a: FloatArray | None = None) -> None:
        slope = self.d @ n
        self.walk((offset - self.p @ n) / np.where(np.abs(slope) < 1e-9, 1e-9, slope), sigma_a)

    def to_sphere(
        self, centre: FloatArray, radius: float, sigma_a: FloatArray | None = None, far: bool = False
    ) -> None:
        o = self.p - centre
        b = (o * self.d).sum(axis=2)
        q = b * b - (o * o).sum(axis=2) + radius**2
        self.alive &= q > 0.0
        self.walk(-b + (1.0 if far else -1.0) * np.sqrt(np.maximum(q, 0.0)), sigma_a)

    def refract(self, n: FloatArray, before: float, after: float) -> None:
        n = np.broadcast_to(n, self.d.shape)
        n = n * -np.sign((n * self.d).sum(axis=2, keepdims=True))
        cos_i = -(n * self.d).sum(axis=2, keepdims=True)
        eta = after / before
        k = 1.0 - (1.0 - cos_i**2) / eta**2
        self.alive &= k[..., 0] > 0.0
        self.share = self.share * transmittance_dielectric(np.clip(cos_i, 0.0, 1.0), before, after)
        self.d = self.d / eta + (cos_i / eta - np.sqrt(np.maximum(k, 0.0))) * n

    def reflect(self, n: FloatArray) -> None:
        self.d = self.d - 2.0 * (self.d @ n)[..., None] * n


def through(path: Path, n: FloatArray, front: float, back: float) -> None:
    """A pane of green glass in air."""
    path.to_plane(n, front)
    path.refract(n, 1.0, N_GLASS)
    path.to_plane(n, back, GREEN.sigma_a)
    path.refract(n, N_GLASS, 1.0)


def compare(frame: Frame, camera: Camera, path: Path, where: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Over the pixels `where`: how far off the solved hits are, pixels; and radiance over that of the glowing floor."""
    px = project(camera, path.p)
    inside = where & path.alive & ((px > 2.0) & (px < np.array(SIZE) - 2.0)).all(axis=2)
    assert inside.sum() > 300
    off = np.abs(frame.aov["solve_hit"][..., :2] * SIZE - px).max(axis=2)[inside]
    ratio = frame.image[inside] / (5.0 * path.share[inside])
    print("off, px:", np.percentile(off, (50, 95, 100)), "radiance:", np.percentile(ratio, (1, 50, 99)))
    return off, ratio


def slab_under_water(scale: float = 1.0) -> Scene:
    """Absorbing water, in it a slab of green glass, under it a glowing floor; a black sky."""
    parts = [
        plane("floor", 8.0, -1.6, GLOW),
        sheet("sea", 8.0, 0.0, SEA),
        box("slab", (12.0, 0.4, 12.0), (0, -0.8, 0), GREEN),
    ]
    camera = Camera.look_at((0.0, 2.0, 2.5), (0.0, -1.0, 0.0), yfov_rad=0.8)
    scene = scene_of(parts, [sun(0.0, 1e-3)], camera, sky=BLACK)
    return scene if scale == 1.0 else scaled(scene, scale)


@pytest.mark.smoke
def test_a_slab_of_glass_under_water() -> None:
    """Snell three times, Fresnel three times, both media's absorption, and 1 / n^2 of the water."""
    scene = slab_under_water()
    frame, path = look(scene), Path(scene.camera)
    path.to_plane(Y, 0.0)
    path.refract(Y, 1.0, N_WATER)
    path.to_plane(Y, -0.6, SEA.sigma_a)
    path.refract(Y, N_WATER, N_GLASS)
    path.to_plane(Y, -1.0, GREEN.sigma_a)
    path.refract(Y, N_GLASS, N_WATER)
    path.to_plane(Y, -1.6, SEA.sigma_a)
    path.share = path.share / N_WATER**2
    off, ratio = compare(frame, scene.camera, path, np.ones(path.alive.shape, bool))
    assert off.max() < 0.02
    np.testing.assert_allclose(ratio, 1.0, rtol=2e-3)


def test_two_panes_one_behind_the_other() -> None:
    panes = [box(f"pane{i}", (3.0, 3.0, 0.3), (0.0, 0.0, z), GREEN) for i, z in enumerate((0.5, -0.7))]
    camera = Camera.look_at((1.5, 0.8, 3.0), (0.0, 0.0, -0.5), yfov_rad=0.5)
    wall = box("wall", (40.0, 40.0, 0.2), (0.0, 0.0, -3.1), GLOW)
    scene = scene_of([wall, *panes], [sun(0.0, 1e-3)], camera, sky=BLACK)
    frame, path = look(scene), Path(camera)
    for z in (0.5, -0.7):
        path.to_plane(Z, z + 0.15)
        path.refract(Z, 1.0, N_GLASS)
        path.alive &= (np.abs(path.p[..., :2]) < 1.45).all(axis=2)
        path.to_plane(Z, z - 0.15, GREEN.sigma_a)
        path.refract(Z, N_GLASS, 1.0)
        path.alive &= (np.abs(path.p[..., :2]) < 1.45).all(axis=2)
    path.to_plane(Z, -3.0)
    off, ratio = compare(frame, camera, path, path.alive.copy())
    assert off.max() < 0.02
    np.testing.assert_allclose(ratio, 1.0, rtol=2e-3)
    one = look(scene, specular_layers=1)
    assert np.median(one.image[path.alive] / frame.image[path.alive]) > 1.2


def ball_in_pool(*more: Instance) -> Scene:
    camera = Camera.look_at((0.0, 2.0, 3.0), (0.0, -0.5, 0.0), yfov_rad=0.45)
    parts = [plane("floor", 8.0, -1.6, GLOW), sheet("sea", 8.0, 0.0, SEA), *more]
    return scene_of(parts, [sun(0.0, 1e-3)], camera, sky=BLACK)


def test_a_glass_ball_sunk_in_a_pool() -> None:
    """Seen from above, by its index relative to the water's."""
    centre, radius = np.array([0.1, -0.8, 0.0]), 0.5
    ball = Instance("ball", icosphere("ball", radius, 48), GREEN, translation(*centre))
    scene = ball_in_pool(ball)
    frame, bare, path = look(scene), look(ball_in_pool()), Path(scene.camera)
    path.to_plane(Y, 0.0)
    path.refract(Y, 1.0, N_WATER)
    path.to_sphere(centre, radius, SEA.sigma_a)
    core = path.alive & (-((path.p - centre) * path.d).sum(axis=2) > 0.35 * radius)
    path.refract((path.p - centre) / radius, N_WATER, N_GLASS)
    path.to_sphere(centre, radius, GREEN.sigma_a, far=True)
    path.refract((path.p - centre) / radius, N_GLASS, N_WATER)
    path.to_plane(Y, -1.6, SEA.sigma_a)
    path.share = path.share / N_WATER**2
    off, ratio = compare(frame, scene.camera, path, core)
    assert np.percentile(off, 95) < 0.25 and np.median(off) < 0.05
    np.testing.assert_allclose(np.percentile(ratio, (2, 50, 98)), 1.0, rtol=0.01)
    assert np.abs(frame.image - bare.image)[core].mean() > 0.1 * bare.image[core].mean()
    seen = np.abs(frame.aov["solve_hit"] - bare.aov["solve_hit"])[..., :2].max(axis=2) * SIZE[1] > 0.5
    assert not (seen & ~path.alive).sum() > 0.02 * path.alive.sum()  # beside the ball nothing moved


def test_the_outline_of_a_sunken_ball_is_that_of_the_bent_rays() -> None:
    """What they see of it beyond the outline that the eye would see is met from behind."""
    centre, radius = np.array([0.1, -0.8, 0.0]), 0.5
    ball = Instance("ball", icosphere("ball", radius, 48), GREEN, translation(*centre))
    camera = Camera.look_at((0.0, 0.6, 3.4), (0.0, -0.5, 0.0), yfov_rad=0.45)
    frame, bare = (look(replace(ball_in_pool(*more), camera=camera)) for more in ([ball], []))
    path = Path(camera)
    path.to_plane(Y, 0.0)
    path.refract(Y, 1.0, N_WATER)
    path.to_sphere(centre, radius, SEA.sigma_a)
    limb = path.alive & (((path.p - centre) * (camera.position_ws - path.p)).sum(axis=2) < 0.0)
    drawn = np.abs(frame.image - bare.image).max(axis=2) > 1e-4
    print("limb:", limb.sum(), "drawn:", drawn[limb].mean(), "of all:", drawn[path.alive].mean())
    assert limb.sum() > 40 and drawn[limb].mean() > 0.75 and drawn[path.alive].mean() > 0.985
    assert (drawn & ~path.alive).sum() < 0.01 * path.alive.sum()


def test_a_floating_ball_ends_under_water() -> None:
    """Half in, half out: what enters above the water and leaves below it refracts by both indices."""
    radius = 0.5
    scene = ball_in_pool(Instance("ball", icosphere("ball", radius, 48), GREEN))
    frame, path = look(scene), Path(scene.camera)
    path.to_sphere(np.zeros(3), radius)
    above = path.alive & (path.p[..., 1] > 0.01) & (-(path.p * path.d).sum(axis=2) > 0.35 * radius)
    path.refract(path.p / radius, 1.0, N_GLASS)
    path.to_sphere(np.zeros(3), radius, GREEN.sigma_a, far=True)
    below = path.alive & (path.p[..., 1] < -0.02)
    path.refract(path.p / radius, N_GLASS, N_WATER)
    path.to_plane(Y, -1.6, SEA.sigma_a)
    path.share = path.share / N_WATER**2
    off, ratio = compare(frame, scene.camera, path, above & below)
    assert np.percentile(off, 95) < 0.5 and np.median(off) < 0.05
    np.testing.assert_allclose(np.percentile(ratio, (5, 50, 95)), 1.0, rtol=0.02)


def test_a_block_cast_into_glass() -> None:
    """A solid within a solid: entered and left with the ratio of both indices, then out of the outer one."""
    dense = replace(GLASS, name="flint", ior=1.8, attenuation_color=(0.9, 0.5, 0.4), attenuation_distance_m=0.5)
    parts = [box("case", (3.0, 3.0, 0.6), (0.0, 0.0, 0.0), GREEN), box("core", (2.6, 2.6, 0.5), (0.0, 0.0, 0.0), dense)]
    camera = Camera.look_at((1.2, 0.6, 3.0), (0.0, 0.0, -0.2), yfov_rad=0.4)
    wall = box("wall", (40.0, 40.0, 0.2), (0.0, 0.0, -3.1), GLOW)
    scene = scene_of([wall, *parts], [sun(0.0, 1e-3)], camera, sky=BLACK)
    frame, path = look(scene), Path(camera)
    path.to_plane(Z, 0.3)
    path.refract(Z, 1.0, N_GLASS)
    path.to_plane(Z, 0.25, GREEN.sigma_a)
    path.refract(Z, N_GLASS, 1.8)
    core = path.alive & (np.abs(path.p[..., :2]) < 1.1).all(axis=2)
    path.to_plane(Z, -0.25, dense.sigma_a)
    path.refract(Z, 1.8, N_GLASS)
    path.to_plane(Z, -0.3, GREEN.sigma_a)
    path.refract(Z, N_GLASS, 1.0)
    path.to_plane(Z, -3.0)
    off, ratio = compare(frame, camera, path, core)
    assert off.max() < 0.02
    np.testing.assert_allclose(ratio, 1.0, rtol=2e-3)


def test_a_ball_in_a_block_of_water() -> None:
    """Out of the ball the ray is in the water still, and leaves that through the block's far side."""
    centre, radius = np.zeros(3), 0.4
    ball = Instance("ball", icosphere("ball", radius, 48), GREEN)
    tank = box("tank", (3.0, 2.4, 1.4), (0.0, 0.0, 0.0), SEA)
    camera = Camera.look_at((0.4, 0.3, 3.0), (0.0, 0.0, 0.0), yfov_rad=0.35)
    wall = box("wall", (40.0, 40.0, 0.2), (0.0, 0.0, -2.1), GLOW)
    scene = scene_of([wall, tank, ball], [sun(0.0, 1e-3)], camera, sky=BLACK)
    frame, path = look(scene), Path(camera)
    path.to_plane(Z, 0.7)
    path.refract(Z, 1.0, N_WATER)
    path.to_sphere(centre, radius, SEA.sigma_a)
    core = path.alive & (-(path.p * path.d).sum(axis=2) > 0.35 * radius)
    path.refract(path.p / radius, N_WATER, N_GLASS)
    path.to_sphere(centre, radius, GREEN.sigma_a, far=True)
    path.refract(path.p / radius, N_GLASS, N_WATER)
    path.to_plane(Z, -0.7, SEA.sigma_a)
    path.refract(Z, N_WATER, 1.0)
    path.to_plane(Z, -2.0)
    off, ratio = compare(frame, camera, path, core)
    assert np.percentile(off, 95) < 0.25 and np.median(off) < 0.05
    np.testing.assert_allclose(np.percentile(ratio, (2, 50, 98)), 1.0, rtol=0.01)


@pytest.mark.parametrize("before_the_pane", [False, True])
def test_a_mirror_behind_a_pane(before_the_pane: bool) -> None:
    """The floor, seen in the mirror through the pane: between the two, or through the pane once more."""
    eye_z, pane_z = (6.0, 0.0) if before_the_pane else (3.2, 1.5)
    camera = Camera.look_at((0.6, 0.7, eye_z), (0.0, -0.4, -1.0), yfov_rad=0.8)
    pane = box("pane", (4.0, 4.0, 0.3), (0.0, 0.0, pane_z), GREEN)
    mirror = box("mirror", (3.0, 3.0, 0.1), (0.0, 0.4, -1.05), MIRROR)
    scene = scene_of([plane("floor", 8.0, -1.0, GLOW), pane, mirror], [sun(0.0, 1e-3)], camera, sky=BLACK)
    frame, path = look(scene), Path(camera)
    through(path, Z, pane_z + 0.15, pane_z - 0.15)
    path.to_plane(Z, -1.0)
    shown = (np.abs(path.p[..., 0]) < 1.4) & (path.p[..., 1] > -0.9)
    path.reflect(Z)
    if before_the_pane:
        through(path, Z, pane_z - 0.15, pane_z + 0.15)
    path.to_plane(Y, -1.0)
    shown &= path.alive & (path.p[..., 2] > 0.5 if before_the_pane else path.p[..., 2] < 1.2)
    off, ratio = compare(frame, camera, path, shown)
    assert np.percentile(off, 99) < 0.1
    np.testing.assert_allclose(np.percentile(ratio, (1, 50, 99)), 1.0, rtol=5e-3)


def test_a_mirror_at_the_bottom_shows_the_sky() -> None:
    """Through the surface twice: T^2 L_sky exp(-2 sigma d), since n^2 on the way in undoes 1 / n^2 on the way out."""
    sky = Sky(zenith=(3.0, 4.0, 5.0), horizon=(3.0, 4.0, 5.0), ground=(0.0,) * 3)
    mirror = box("mirror", (5.0, 0.1, 5.0), (0.0, -1.05, 0.0), MIRROR)
    camera = Camera.look_at((0.0, 2.0, 1.5), (0.0, -1.0, 0.0), yfov_rad=0.5)
    parts = [plane("floor", 8.0, -1.6, GLOW), sheet("sea", 8.0, 0.0, SEA), mirror]
    scene = scene_of(parts, [sun(0.0, 1e-3)], camera, sky=sky)
    frame, path = look(scene), Path(camera)
    path.to_plane(Y, 0.0)
    path.refract(Y, 1.0, N_WATER)
    path.to_plane(Y, -1.0, SEA.sigma_a)
    shown = (np.abs(path.p[..., [0, 2]]) < 2.4).all(axis=2)
    path.reflect(Y)
    path.to_plane(Y, 0.0, SEA.sigma_a)
    path.refract(Y, N_WATER, 1.0)
    reflected = 1.0 - transmittance_dielectric(-eye_rays(camera, SIZE)[..., 1:2], 1.0, N_WATER)
    truth = (path.share + reflected) * np.array(sky.zenith)
    assert shown.mean() > 0.9
    np.testing.assert_allclose(frame.image[shown], truth[shown], rtol=5e-3)


def test_snells_window_through_glass() -> None:
    """The eye under water, a slab of glass above it, the surface behind that: n^2 T L_sky, absorbed."""
    sky = Sky(zenith=(3.0, 4.0, 5.0), horizon=(3.0, 4.0, 5.0), ground=(0.0,) * 3)
    slab = box("slab", (9.0, 0.2, 9.0), (0.0, -0.5, 0.0), GREEN)
    camera = Camera.look_at((0.0, -1.2, 0.0), (0.1, 0.0, 0.05), yfov_rad=0.9)
    parts = [plane("floor", 8.0, -2.0, GLOW), sheet("sea", 8.0, 0.0, SEA), slab]
    scene = scene_of(parts, [sun(0.0, 1e-3)], camera, sky=sky)
    frame, path = look(scene), Path(camera)
    path.to_plane(Y, -0.6, SEA.sigma_a)
    path.refract(Y, N_WATER, N_GLASS)
    path.to_plane(Y, -0.4, GREEN.sigma_a)
    path.refract(Y, N_GLASS, N_WATER)
    path.to_plane(Y, 0.0, SEA.sigma_a)
    path.refract(Y, N_WATER, 1.0)
    truth = N_WATER**2 * path.share * np.array(sky.zenith)
    assert path.alive.all() and frame.stats["eye_medium"].startswith("the eye is in 'sea'")
    np.testing.assert_allclose(np.median(frame.image / truth), 1.0, rtol=5e-3)


def test_scale_does_not_matter() -> None:
    small, mid, large = (look(slab_under_water(scale)).image for scale in (1e-3, 1.0, 1e3))
    for image in (small, large):
        np.testing.assert_allclose(image, mid, rtol=1e-3)


def test_caustics_are_those_of_the_surface_behind_both() -> None:
    """AOV caustic_irradiance through waves and a slab: E_c of the floor where the ray ends there."""
    waves = height_sheet("sea", 4.0, 128, 4, lambda x: 0.06 * np.sin(3.0 * x), lambda x: 0.18 * np.cos(3.0 * x))
    sea = Instance("sea", waves, WATER)
    slab = box("slab", (9.0, 0.2, 9.0), (0.0, -0.6, 0.0), GLASS)
    camera = Camera.look_at((0.0, 2.0, 1.0), (0.0, -1.0, 0.0), yfov_rad=0.7)
    scene = scene_of([plane("floor", 4.0, -1.2), sea, slab], [sun(10.0, 100.0)], camera)
    frame = shoot(scene, SIZE, specular_view=True, aovs=("caustic_irradiance", "solve_hit", "solve_status"))
    floor = shoot(scene, SIZE, specular_view=False, aovs=("caustic_irradiance",)).aov["caustic_irradiance"][..., 1]
    px = frame.aov["solve_hit"][..., :2] * SIZE
    inside = np.isin(frame.aov["solve_status"], (1, 5)) & ((px > 2.0) & (px < np.array(SIZE) - 2.0)).all(axis=2)
    column, row = px[inside].T.astype(int)
    there, seen = floor[SIZE[1] - 1 - row, column], frame.aov["caustic_irradiance"][..., 1][inside]
    assert inside.mean() > 0.6 and there.std() > 0.1 * there.mean()
    assert np.median(np.abs(seen - there)) < 0.02 * there.mean()
    assert np.corrcoef(seen, there)[0, 1] > 0.98


def test_left_out_where_nothing_can_be_behind() -> None:
    """The plan's words; an object out of the picture changes no bit; a third layer is refused."""
    mirrors = [box(name, (1.0, 1.0, 0.1), (0.0, 0.5, z), MIRROR) for name, z in (("a", 0.0), ("b", -1.0))]
    plan = plan_frame(
        scene_of([plane("floor", 8.0), *mirrors], [sun()], Camera.look_at((0.0, 1.0, 3.0), (0.0, 0.0, 0.0)))
    )
    assert {left.name: left.because for left in plan.left_out}["gbuffer.specular2"] == "nothing is seen through mirrors"
    scene = ball_in_pool(box("aside", (1.0, 1.0, 1.0), (0.0, -0.8, 7.0), GLASS))
    why = {left.name: left.because for left in plan_frame(scene, options={"specular_layers": 1}).left_out}
    assert why["gbuffer.specular2"].startswith("one specular layer is asked for")
    np.testing.assert_array_equal(look(scene).image, look(scene, specular_layers=1).image)
    with pytest.raises(UsageError, match=r"option specular_layers is 3.*from 1 to 2"):
        plan_frame(scene, options={"specular_layers": 3})


def test_one_object_costs_nothing() -> None:
    """Neither passes nor a bit of the picture; the plan says why."""
    ball = Instance("ball", icosphere("ball", 0.5, 16), GREEN)
    camera = Camera.look_at((0.0, 1.0, 3.0), (0.0, 0.0, 0.0), yfov_rad=0.5)
    for specular in ([ball], [sheet("sea", 4.0, 0.0, SEA)], [box("mirror", (1.0, 1.0, 0.1), (0.0, 0.5, 0.0), MIRROR)]):
        scene = scene_of([plane("floor", 8.0, -1.0, GLOW), *specular], [sun(0.0, 1.0)], camera)
        one, two = look(scene, specular_layers=1), look(scene)
        np.testing.assert_array_equal(one.image, two.image)
        plan = plan_frame(scene, SIZE)
        why = {left.name: left.because for left in plan.left_out}
        assert why["gbuffer.specular2"] == "a single specular object has no other one behind it"
        assert not any("specular2" in step.name for step in plan.steps)
