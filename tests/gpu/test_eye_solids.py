"""Eye rays through closed solids against float64: a ball, a tilted slab, and a cube with total reflection inside."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from glcaustics.renderer import Frame
from glcaustics.scene.model import Camera, Instance, Material, Scene
from tests.gpu.feature_scenes import GLASS, box, scene_of, shoot, sun, translation
from tests.gpu.physics_meshes import icosphere

pytestmark = pytest.mark.gpu
FloatArray = npt.NDArray[np.float64]
N = 1.5
SIZE = (192, 144)
WALL_Z = -3.0
GLOW = Material("glow", base_color=(0.0, 0.0, 0.0), emissive=(5.0, 5.0, 5.0))


def turn_x(degrees: float) -> FloatArray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]], np.float64)


def before_a_wall(solid: Instance, fov: float = 0.55) -> Scene:
    camera = Camera.look_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), yfov_rad=fov)
    wall = box("wall", (40.0, 40.0, 0.2), (0.0, 0.0, WALL_Z - 0.1), GLOW)
    return scene_of([wall, solid], [sun(0.0, 1.0)], camera)


def look(scene: Scene) -> Frame:
    aovs = ("solve_status", "solve_hit", "depth_m")
    return shoot(scene, SIZE, method="none", quality="high", specular_view=True, aovs=aovs)


def rays(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Eye (3,) and unit directions (H, W, 3) of the pixels' centres."""
    x = ((np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1) * SIZE[0] / SIZE[1]
    y = 1 - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2
    xx, yy = np.meshgrid(x, y)
    d = np.stack((xx, yy, -np.full_like(xx, 1.0 / math.tan(0.5 * scene.camera.yfov_rad))), 2)
    return scene.camera.position_ws, d / np.linalg.norm(d, axis=2, keepdims=True)


def refract(d: FloatArray, n: FloatArray, eta: float) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Snell's law for unit d against unit n, eta = n_to / n_from; where it reflects totally, the mirrored ray."""
    cos_i = -(d * n).sum(axis=-1, keepdims=True)
    k = 1.0 - (1.0 - cos_i**2) / eta**2
    bent = d / eta + (cos_i / eta - np.sqrt(np.maximum(k, 0.0))) * n
    return np.where(k > 0.0, bent, d + 2.0 * cos_i * n), (k > 0.0)[..., 0]


def wall_px(scene: Scene, p: FloatArray, d: FloatArray) -> FloatArray:
    """Pixel coordinates (..., 2), origin at the bottom left, of where rays meet the wall; nan where they do not."""
    t = np.where(d[..., 2] < -1e-3, (WALL_Z - p[..., 2]) / np.minimum(d[..., 2], -1e-3), np.nan)[..., None]
    q = p + t * d - scene.camera.position_ws
    px = q[..., :2] / -q[..., 2:] / math.tan(0.5 * scene.camera.yfov_rad)
    return (px / (SIZE[0] / SIZE[1], 1.0) * 0.5 + 0.5) * SIZE


def off_px(frame: Frame, truth: FloatArray, where: npt.NDArray[np.bool_]) -> FloatArray:
    """Distance of the solved hits from the truth, pixels, max norm, of the masked pixels."""
    return np.abs(frame.aov["solve_hit"][..., :2] * SIZE - truth).max(axis=2)[where]


def on_screen(px: FloatArray) -> npt.NDArray[np.bool_]:
    with np.errstate(invalid="ignore"):
        return np.asarray(((px > 1.0) & (px < np.array(SIZE) - 1.0)).all(axis=-1))


@pytest.mark.smoke
def test_glass_ball() -> None:
    """Two refractions, both against the exact sphere; the picture behind it is upside down."""
    radius = 0.6
    scene = before_a_wall(Instance("ball", icosphere("ball", radius, 48), GLASS))
    frame, (eye, d) = look(scene), rays(scene)
    b = (d * eye).sum(axis=2)
    hits = b**2 - eye @ eye + radius**2
    p = eye + (-b - np.sqrt(np.maximum(hits, 0.0)))[..., None] * d
    inside, _ = refract(d, p / radius, N)
    p = p - 2.0 * (p * inside).sum(axis=2, keepdims=True) * inside
    out, _ = refract(inside, -p / radius, 1.0 / N)
    truth = wall_px(scene, p, out)
    # The outermost rim, where a pixel is much of the ball's slope, stands apart.
    core = (hits > 0.15 * radius**2) & on_screen(truth)
    off, status = off_px(frame, truth, core), frame.aov["solve_status"][core]
    print(f"ball: {core.sum()} px, solved {np.isin(status, (1, 5)).mean():.4f}, median {np.median(off):.3f} px, "
          f"95 % {np.percentile(off, 95):.3f} px")  # fmt: skip
    assert core.sum() > 3000 and np.isin(status, (1, 5)).mean() > 0.98
    assert np.median(off) < 0.3 and np.percentile(off, 95) < 1.0
    above = core & (np.arange(SIZE[1]) < SIZE[1] // 2 - 20)[:, None]
    assert (frame.aov["solve_hit"][above][:, 1] < 0.5).mean() > 0.99


@pytest.mark.parametrize("tilt", [20.0, 50.0])
def test_tilted_slab(tilt: float) -> None:
    """The ray goes on parallel to itself, shifted by what the slab's thickness makes of it."""
    turn = turn_x(90.0 - tilt)
    matrix = translation(0.0, 0.0, 0.0)
    matrix[:3, :3] = turn
    slab = Instance("slab", box("slab", (6.0, 0.3, 6.0), (0.0, 0.0, 0.0)).mesh, GLASS, matrix)
    scene = before_a_wall(slab)
    frame, (eye, d) = look(scene), rays(scene)
    n = turn @ (0.0, 1.0, 0.0)
    t = (0.15 - eye @ n) / (d @ n)
    inside, _ = refract(d, np.broadcast_to(n, d.shape), N)
    p = eye + t[..., None] * d
    p = p + (0.3 / -(inside @ n))[..., None] * inside
    truth = wall_px(scene, p, d)
    # The exit must be on the picture too: its back face is looked up there.
    core = on_screen(truth) & on_screen(wall_px(scene, p, p - eye)) & (np.abs(p) < 2.5).all(axis=2)
    off, status = off_px(frame, truth, core), frame.aov["solve_status"][core]
    print(f"slab {tilt}: solved {np.isin(status, (1, 5)).mean():.4f}, max {off.max():.4f} px")
    assert core.sum() > 10000 and np.isin(status, (1, 5)).all() and off.max() < 0.05


def box_exit(p: FloatArray, d: FloatArray, half: float) -> tuple[FloatArray, FloatArray]:
    """Where rays inside an axis-aligned cube leave it, and the face's inward normal."""
    t = (np.sign(d) * half - p) / np.where(np.abs(d) > 1e-12, d, 1e-12)
    axis = np.argmin(t, axis=-1)
    n = -np.take_along_axis(np.sign(d), axis[..., None], -1) * np.eye(3)[axis]
    return p + np.take_along_axis(t, axis[..., None], -1) * d, n


def test_total_reflection_inside_is_followed_once_and_then_said() -> None:
    """A cube seen over its edge. Paths that leave at the first face are solved where they meet the wall; so are those
    that leave at the second one (15 % may carry status 4 instead); what is held twice carries 4."""
    half = 0.5
    turn = turn_x(0.0) @ np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    matrix = translation(0.0, 0.0, 0.0)
    matrix[:3, :3] = turn
    scene = before_a_wall(Instance("cube", box("cube", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)).mesh, GLASS, matrix))
    frame, (eye, d) = look(scene), rays(scene)
    o, v = eye @ turn, d @ turn  # in the cube's own axes
    near, far = np.sort(np.stack(((-half - o) / v, (half - o) / v)), axis=0)
    enters = near.max(axis=-1)
    hits = enters < far.min(axis=-1)
    axis = np.argmax(near, axis=-1)
    n = -np.take_along_axis(np.sign(v), axis[..., None], -1) * np.eye(3)[axis]
    p = o + enters[..., None] * v
    inside, _ = refract(v, n, N)
    first, n1 = box_exit(p, inside, half)
    after, leaves_1 = refract(inside, n1, 1.0 / N)
    second, n2 = box_exit(first, after, half)
    out, leaves_2 = refract(after, n2, 1.0 / N)
    margin = np.abs(np.abs(first) - half).min(axis=-1) < 1e-9
    # Not within a pixel or two of an edge: there either face may be met.
    clear = hits & margin & (np.sort(half - np.abs(p), axis=-1)[..., 1] > 0.03)
    clear &= (np.sort(half - np.abs(first), axis=-1)[..., 1] > 0.03) & (
        np.sort(half - np.abs(second), axis=-1)[..., 1] > 0.03
    )
    status = frame.aov["solve_status"]
    at_once, later, held = clear & leaves_1, clear & ~leaves_1 & leaves_2, clear & ~leaves_1 & ~leaves_2
    assert min(at_once.sum(), later.sum(), held.sum()) > 300
    truth = wall_px(scene, first @ turn.T, after @ turn.T)
    assert (status[at_once] == 1).all() and off_px(frame, truth, at_once & on_screen(truth)).max() < 0.1
    truth = wall_px(scene, second @ turn.T, out @ turn.T)
    shown = later & on_screen(truth)
    followed = later & (status == 1)
    leaves = later & (status != 4)
    print(
        f"reflected once: {later.sum()} px, {leaves.sum()} leave, {shown.sum()} on the screen, {followed.sum()} solved"
    )
    assert leaves.sum() > 0.85 * later.sum() and followed.sum() > 0.99 * shown.sum()
    assert not (followed & ~shown).any() and off_px(frame, truth, followed).max() < 0.1
    assert np.isin(status[leaves & ~followed], (2, 6)).all() and (status[held] == 4).all()
