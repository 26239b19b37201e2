"""Opaque things in closed solids, and solids in opaque walls: the eye's ray ends on what it meets first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glcaustics.passes.solid_contents import holds_opaque
from glcaustics.scene.model import Camera, Instance, Material, Mesh, Scene
from glcaustics.scene.transform import scaled
from tests.gpu.feature_scenes import GLASS, WATER, box, plane, scene_of, sheet, sun, translation
from tests.gpu.physics_meshes import grid_triangles, icosphere, make_mesh
from tests.gpu.test_specular_layers import (
    BLACK,
    GLOW,
    GREEN,
    N_GLASS,
    N_WATER,
    SEA,
    SIZE,
    BoolArray,
    FloatArray,
    Path,
    Y,
    Z,
    compare,
    look,
)

pytestmark = pytest.mark.gpu
WALL = Material("wall", base_color=(0.0, 0.0, 0.0), emissive=(0.0, 2.0, 1.0))
STONE = Material("stone", base_color=(0.0, 0.0, 0.0), emissive=(3.0, 1.0, 0.5))


def waves(x: FloatArray, z: FloatArray) -> FloatArray:
    return np.asarray(0.02 * np.sin(5.0 * x + 2.0 * z))


def water(half: float, bottom: float | None, cells: int = 96) -> Instance:
    """A waved sheet over |x|, |z| <= half; with a bottom: a closed body, its sides upright."""
    x, z = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(-half, half, cells + 1)]))
    slope = 0.02 * np.cos(5.0 * x + 2.0 * z)
    normals = np.stack((-5.0 * slope, np.ones_like(x), -2.0 * slope), 1)
    points, triangles = np.stack((x, waves(x, z), z), 1), grid_triangles(cells, cells)
    parts, all_normals, faces = [points], [normals / np.linalg.norm(normals, axis=1, keepdims=True)], [triangles]
    if bottom is not None:
        low = points * (1.0, 0.0, 1.0) + (0.0, bottom, 0.0)
        parts.append(low)
        all_normals.append(np.tile(-Y, (len(x), 1)))
        faces.append(len(x) + triangles[:, ::-1])
        row = np.arange(cells + 1)
        for edge, n in ((row, -Z), (row[::-1] + cells * (cells + 1), Z), (row[::-1] * (cells + 1), (-1.0, 0.0, 0.0)),
                        (row * (cells + 1) + cells, (1.0, 0.0, 0.0))):  # fmt: skip
            at = sum(map(len, parts))
            parts.append(np.concatenate((points[edge], low[edge])))
            all_normals.append(np.tile(n, (2 * (cells + 1), 1)))
            faces.append(at + grid_triangles(1, cells)[:, ::-1])
    mesh: Mesh = make_mesh(
        "water", np.concatenate(parts), np.concatenate(all_normals), np.concatenate(faces), bottom is not None
    )
    return Instance("water", mesh, SEA)


def basin(body: Instance, eye: tuple[float, float, float] = (0.3, 1.6, 1.1), **view: float) -> Scene:
    """Water in a basin of one metre on each side and one deep; a block on its floor."""
    walls = [box(f"wall{i}", (0.3 + 2.0 * abs(z), 1.6, 0.3 + 2.0 * abs(x)), (1.15 * x, -0.4, 1.15 * z), WALL)
             for i, (x, z) in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1)))]  # fmt: skip
    block = box("block", (0.4, 0.3, 0.3), (-0.3, -0.85, -0.2), STONE)
    camera = Camera.look_at(eye, (0.0, -0.6, -0.1), yfov_rad=0.7, **view)  # type: ignore[arg-type]
    return scene_of([plane("floor", 1.2, -1.0, GLOW), *walls, block, body], [sun(0.0, 1e-3)], camera, sky=BLACK)


@pytest.mark.parametrize(
    ("half", "bottom", "layers"), [(1.05, -1.1, 1), (1.05, -1.0, 1), (1.0, -1.0, 1), (1.05, -1.1, 2)]
)
def test_a_closed_body_of_water_shows_what_an_open_sheet_does(half: float, bottom: float, layers: int) -> None:
    closed, sheet_scene = basin(water(half, bottom)), basin(water(half, None))
    assert holds_opaque(closed.instances) and not holds_opaque(sheet_scene.instances)
    frame, truth = look(closed, depth_layers=layers), look(sheet_scene, depth_layers=layers)
    status, wanted = frame.aov["solve_status"], truth.aov["solve_status"]
    # At an edge either surface may be met within a pixel; at the border what is not seen is an estimate in both.
    near = [np.abs(frame.image - np.roll(truth.image, (y, x), (0, 1))) for y in (-1, 0, 1) for x in (-1, 0, 1)]
    off = np.min(near, axis=0).max(axis=2) / truth.image.mean()
    exact = np.abs(frame.image - truth.image).max(axis=2) / truth.image.mean()
    solved = np.isin(wanted, (1, 5, 8))
    solved[-5:] = False
    print(f"{half} {bottom} {layers}: solved {solved.mean():.4f}, {np.isin(status, (1, 5, 8))[solved].mean():.4f}, "
          f"apart by 1 %: {(exact > 0.01).mean():.5f}, solved ones {(exact > 0.01)[solved].mean():.5f}, "
          f"by more than a pixel {(off > 0.01)[solved].mean():.5f}, max {off[solved].max():.4f}")  # fmt: skip
    assert solved.mean() > 0.9 and np.isin(status, (1, 5, 8))[solved].mean() > 0.9995
    assert (off > 0.01)[solved].mean() < 2e-4 and (exact > 0.01)[solved].mean() < 0.003
    assert (exact > 0.01).mean() < 0.01


def plate_in_a_block(scale: float = 1.0) -> Scene:
    """Green glass with a glowing plate cast into it, before a wall that glows otherwise."""
    parts = [
        box("block", (3.0, 3.0, 1.2), (0.0, 0.0, 0.0), GREEN),
        box("plate", (0.9, 0.7, 0.2), (0.0, 0.0, -0.2), GLOW),
        box("wall", (40.0, 40.0, 0.2), (0.0, 0.0, -4.1), WALL),
    ]
    camera = Camera.look_at((0.9, 0.5, 3.0), (0.0, 0.0, -0.2), yfov_rad=0.35)
    scene = scene_of(parts, [sun(0.0, 1e-3)], camera, sky=BLACK)
    return scene if scale == 1.0 else scaled(scene, scale)


def on_plate(path: Path, slack: float) -> BoolArray:
    """Pixels whose rays meet the plate's front, all of the plate larger by slack, metres."""
    x, y = np.abs(path.p[..., 0]), np.abs(path.p[..., 1])
    return np.asarray(path.alive & (x < 0.45 + slack) & (y < 0.35 + slack))


def block_path(scene: Scene) -> Path:
    path = Path(scene.camera)
    path.to_plane(Z, 0.6)
    path.refract(Z, 1.0, N_GLASS)
    path.to_plane(Z, -0.1, GREEN.sigma_a)
    path.share = path.share / N_GLASS**2
    return path


@pytest.mark.smoke
@pytest.mark.parametrize("refraction", ["cascade", "newton", "hierarchical", "dda"])
def test_a_plate_cast_into_a_block(refraction: str) -> None:
    """Snell once, Fresnel once, the glass's absorption to the plate, and 1 / n^2; what shows of it is no larger."""
    scene = plate_in_a_block()
    frame, path = look(scene, refraction=refraction), block_path(scene)
    core = on_plate(path, -0.01)
    off, ratio = compare(frame, scene.camera, path, core)
    assert off.max() < 0.02
    np.testing.assert_allclose(ratio, 1.0, rtol=2e-3)
    assert np.isin(frame.aov["solve_status"][core], (1, 5)).all()
    red = frame.image[..., 0] > 0.1 * frame.image[core][:, 0].mean()  # the wall has none
    beside = path.alive & (np.abs(path.p[..., :2]) < 1.2).all(axis=2) & ~on_plate(path, 0.25)
    print(f"{refraction}: plate {core.sum()} px, red beside it {red[beside].mean():.5f}")
    assert not red[beside].any()


def test_scale_does_not_matter() -> None:
    small, mid, large = (look(plate_in_a_block(scale)).image for scale in (1e-3, 1.0, 1e3))
    for image in (small, large):
        np.testing.assert_allclose(image, mid, rtol=1e-3, atol=1e-5)


def test_an_orthographic_eye() -> None:
    """All rays are parallel, so is what shows: the plate's picture is shifted as a whole."""
    eye = np.array([1.2, 0.6, 3.0])
    camera = Camera.look_at(eye, (0.0, 0.0, 0.0), orthographic=True, ymag_m=0.7)
    scene = replace(plate_in_a_block(), camera=camera)
    frame = look(scene)
    right, up, back = camera.world_from_camera[:3, :3].T
    x = ((np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1) * SIZE[0] / SIZE[1] * 0.7
    y = (1 - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2) * 0.7
    path = Path(scene.camera)
    path.p = eye + x[None, :, None] * right + y[:, None, None] * up
    path.d = np.broadcast_to(-back, path.p.shape)
    path.to_plane(Z, 0.6)
    path.refract(Z, 1.0, N_GLASS)
    path.to_plane(Z, -0.1, GREEN.sigma_a)
    core = on_plate(path, -0.01)
    assert core.sum() > 1000
    ratio = frame.image[core] / (5.0 * path.share[core] / N_GLASS**2)
    np.testing.assert_allclose(ratio, 1.0, rtol=2e-3)
    hit = frame.aov["solve_hit"][core][:, :2] * 2.0 - 1.0
    meant = np.stack(((path.p - eye) @ right / (0.7 * SIZE[0] / SIZE[1]), (path.p - eye) @ up / 0.7), -1)[core]
    assert np.abs((hit - meant) * SIZE / 2).max() < 0.02


def cube_in_a_ball() -> tuple[Scene, FloatArray]:
    turn = np.eye(4)
    turn[:3, :3] = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]) @ np.array(
        [[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]]
    )
    ball = Instance("ball", icosphere("ball", 1.0, 48), GREEN)
    cube = Instance("cube", box("cube", (0.5, 0.5, 0.5), (0.0, 0.0, 0.0)).mesh, GLOW, turn)
    wall = box("wall", (40.0, 40.0, 0.2), (0.0, 0.0, -4.1), WALL)
    camera = Camera.look_at((0.3, 0.4, 4.0), (0.0, 0.0, 0.0), yfov_rad=0.5)
    return scene_of([ball, cube, wall], [sun(0.0, 1e-3)], camera, sky=BLACK), turn[:3, :3]


@pytest.mark.parametrize("layers", [1, 2])
def test_a_cube_in_a_ball(layers: int) -> None:
    """Against ray casting: what shows the cube, and its radiance through the ball's glass."""
    scene, turn = cube_in_a_ball()
    frame, path = look(scene, depth_layers=layers), Path(scene.camera)
    path.to_sphere(np.zeros(3), 1.0)
    core = path.alive & (-(path.p * path.d).sum(axis=2) > 0.35)
    path.refract(path.p, 1.0, N_GLASS)
    o, v = path.p @ turn, path.d @ turn
    near, far = np.sort(np.stack(((-0.25 - o) / v, (0.25 - o) / v)), axis=0)
    enters, room = near.max(axis=-1), far.min(axis=-1) - near.max(axis=-1)
    path.walk(np.where(room > 0.0, enters, 1e-9), GREEN.sigma_a)
    path.share = path.share / N_GLASS**2
    hits, misses = core & (room > 0.05), core & (room < -0.05)
    red = frame.image[..., 0] > 0.3 * (5.0 * path.share)[..., 0]
    ratio = frame.image[hits] / (5.0 * path.share[hits])
    print(f"ball: shows {red[hits].mean():.4f} of {hits.sum()} px, wrongly {red[misses].mean():.5f} of {misses.sum()}, "
          f"radiance {np.percentile(ratio, (1, 5, 50, 95, 99))}")  # fmt: skip
    assert hits.sum() > 800 and misses.sum() > 2000
    assert red[hits].mean() > 0.995 and red[misses].mean() < 0.005
    np.testing.assert_allclose(np.percentile(ratio, (5, 50, 95)), 1.0, rtol=0.02)


def test_the_second_layer_shows_what_another_thing_in_the_block_hides() -> None:
    """Of a back plate, what the eye would not see past a front one without the glass: bent rays come past it."""
    parts = [
        box("block", (4.0, 4.0, 1.2), (0.0, 0.0, 0.0), GREEN),
        box("front", (0.4, 0.4, 0.02), (0.0, 0.0, 0.29), STONE),
        box("back", (2.6, 2.6, 0.1), (0.0, 0.0, -0.35), GLOW),
    ]
    camera = Camera.look_at((1.8, 0.8, 3.0), (0.0, 0.0, -0.1), yfov_rad=0.35)
    scene, path = scene_of(parts, [sun(0.0, 1e-3)], camera, sky=BLACK), Path(camera)
    path.to_plane(Z, 0.6)
    path.refract(Z, 1.0, N_GLASS)
    path.to_plane(Z, 0.3, GREEN.sigma_a)
    past = (np.abs(path.p[..., :2]) > 0.22).any(axis=2)
    path.to_plane(Z, -0.3, GREEN.sigma_a)
    path.share = path.share / N_GLASS**2
    straight = camera.position_ws + (path.p - camera.position_ws) * (2.7 / (3.0 - path.p[..., 2:]))
    hidden = past & (np.abs(straight[..., :2]) < 0.18).all(axis=2)
    one, two = look(scene), look(scene, depth_layers=2)
    off, ratio = compare(two, camera, path, hidden)
    assert off.max() < 0.02 and (two.aov["solve_status"][hidden] == 8).all()
    np.testing.assert_allclose(ratio, 1.0, rtol=2e-3)
    assert not np.isin(one.aov["solve_status"][hidden], (1, 5)).any()


def test_behind_another_surface() -> None:
    """The same block under absorbing water, the plate level in it."""
    parts = [
        plane("floor", 8.0, -1.6, WALL),
        sheet("sea", 8.0, 0.0, SEA),
        box("slab", (12.0, 0.6, 12.0), (0, -0.8, 0), GREEN),
        box("plate", (1.6, 0.1, 1.2), (0, -0.9, 0), GLOW),
    ]
    camera = Camera.look_at((0.0, 2.0, 2.5), (0.0, -1.0, 0.0), yfov_rad=0.6)
    frame, path = look(scene_of(parts, [sun(0.0, 1e-3)], camera, sky=BLACK)), Path(camera)
    path.to_plane(Y, 0.0)
    path.refract(Y, 1.0, N_WATER)
    path.to_plane(Y, -0.5, SEA.sigma_a)
    path.refract(Y, N_WATER, N_GLASS)
    path.to_plane(Y, -0.85, GREEN.sigma_a)
    path.share = path.share / N_GLASS**2
    core = (np.abs(path.p[..., 0]) < 0.76) & (np.abs(path.p[..., 2]) < 0.56)
    off, ratio = compare(frame, camera, path, core)
    assert off.max() < 0.02
    np.testing.assert_allclose(ratio, 1.0, rtol=2e-3)


def test_a_core_that_holds_a_plate_within_a_block() -> None:
    """A plate in a solid within a solid; one behind that in the outer one, and one before it."""
    dense = replace(GLASS, name="flint", ior=1.8, attenuation_color=(0.9, 0.5, 0.4), attenuation_distance_m=0.5)
    camera = Camera.look_at((0.9, 0.5, 3.0), (0.0, 0.0, -0.2), yfov_rad=0.3)
    for plate_z in (-0.1, -0.7, 0.7):
        parts = [
            box("case", (4.0, 4.0, 2.0), (0.0, 0.0, 0.0), GREEN),
            box("core", (3.0, 3.0, 0.8), (0.0, 0.0, 0.0), dense),
            box("plate", (0.9, 0.7, 0.1), (0.0, 0.0, plate_z - 0.05), GLOW),
            box("wall", (40.0, 40.0, 0.2), (0.0, 0.0, -4.1), WALL),
        ]
        frame, path = look(scene_of(parts, [sun(0.0, 1e-3)], camera, sky=BLACK)), Path(camera)
        path.to_plane(Z, 1.0)
        path.refract(Z, 1.0, N_GLASS)
        path.to_plane(Z, max(plate_z, 0.4), GREEN.sigma_a)
        if plate_z < 0.4:
            path.refract(Z, N_GLASS, 1.8)
            path.to_plane(Z, max(plate_z, -0.4), dense.sigma_a)
        if plate_z < -0.4:
            path.refract(Z, 1.8, N_GLASS)
            path.to_plane(Z, plate_z, GREEN.sigma_a)
        path.share = path.share / (1.8 if abs(plate_z) < 0.4 else N_GLASS) ** 2
        off, ratio = compare(frame, camera, path, on_plate(path, -0.02))
        assert off.max() < 0.02
        np.testing.assert_allclose(ratio, 1.0, rtol=2e-3)


def test_the_eye_under_water() -> None:
    """The eye in a closed body of water looks into a block of glass in it."""
    parts = [
        box("tank", (12.0, 12.0, 12.0), (0.0, 0.0, 0.0), SEA),
        box("block", (3.0, 3.0, 1.2), (0.0, 0.0, 0.0), GREEN),
        box("plate", (0.9, 0.7, 0.2), (0.0, 0.0, -0.2), GLOW),
    ]
    camera = Camera.look_at((0.9, 0.5, 3.0), (0.0, 0.0, -0.2), yfov_rad=0.35)
    frame, path = look(scene_of(parts, [sun(0.0, 1e-3)], camera, sky=BLACK)), Path(camera)
    path.to_plane(Z, 0.6, SEA.sigma_a)
    path.refract(Z, N_WATER, N_GLASS)
    path.to_plane(Z, -0.1, GREEN.sigma_a)
    path.share = path.share * (N_WATER / N_GLASS) ** 2
    off, ratio = compare(frame, camera, path, on_plate(path, -0.02))
    assert off.max() < 0.02
    np.testing.assert_allclose(ratio, 1.0, rtol=2e-3)


def test_met_after_a_reflection_inside() -> None:
    """Down into a cube, by its far side back, and on to a plate at the bottom of it that is seen there from above."""
    parts = [
        box("cube", (2.0, 2.0, 2.0), (0.0, 0.0, 0.0), GREEN),
        box("plate", (1.9, 0.1, 1.9), (0.0, -0.9, 0.0), GLOW),
    ]
    camera = Camera.look_at((0.0, 4.0, 2.2), (0.0, 0.0, 0.0), yfov_rad=0.7)
    frame, path = look(scene_of(parts, [sun(0.0, 1e-3)], camera, sky=BLACK)), Path(camera)
    path.to_plane(Y, 1.0)
    core = path.alive & (np.abs(path.p[..., [0, 2]]) < 0.95).all(axis=2)
    path.refract(Y, 1.0, N_GLASS)
    path.to_plane(Z, -1.0, GREEN.sigma_a)
    core &= (np.abs(path.p[..., 0]) < 0.9) & (path.p[..., 1] > -0.8)
    path.reflect(Z)
    path.to_plane(Y, -0.85, GREEN.sigma_a)
    core &= (np.abs(path.p[..., 0]) < 0.9) & (np.abs(path.p[..., 2]) < 0.94)
    path.share = path.share / N_GLASS**2
    off, ratio = compare(frame, camera, path, core)
    assert np.percentile(off, 95) < 0.05
    np.testing.assert_allclose(np.percentile(ratio, (5, 50, 95)), 1.0, rtol=5e-3)


def test_what_stands_on_a_floor_is_dry_below() -> None:
    """Only where something reaches into a solid's box, or walls it in, is anything looked for inside."""
    floor, block = plane("floor", 4.0, 0.0, WALL), box("block", (1.0, 1.0, 1.0), (0.0, 0.5, 0.0), GLASS)
    assert not holds_opaque([floor, block])
    assert not holds_opaque([block, box("beside", (1.0, 1.0, 1.0), (1.5, 0.5, 0.0), WALL)])
    assert holds_opaque([floor, block, box("beside", (1.0, 1.0, 1.0), (1.0, 0.5, 0.0), WALL)])
    assert holds_opaque([block, box("in", (0.1, 0.1, 0.1), (0.0, 0.5, 0.0), WALL)])
    assert holds_opaque([block, box("across", (0.1, 9.0, 0.1), (0.0, 0.5, 0.0), WALL)])
    assert not holds_opaque([block, Instance("sea", floor.mesh, WATER, translation(0.0, 0.5, 0.0))])
