"""The camera's G-buffer and the AOVs: depth, normals, positions, albedo, motion; in every scene, to disk and back."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import glcaustics as glc
from glcaustics.caustics.registry import pick
from glcaustics.gpu import Device
from glcaustics.graph import FrameGraph
from glcaustics.passes import gbuffer
from glcaustics.passes.camera import CameraState
from glcaustics.passes.frame import FrameSetup, FrameState
from glcaustics.passes.geometry import GpuScene
from glcaustics.passes.runner import PlanRunner
from glcaustics.renderer import AOVS, resolve_options
from glcaustics.scene.model import Camera, Image, Instance, Material, Mesh, Scene, WaterBody
from tests.gpu.feature_scenes import (
    BACKEND,
    GLASS,
    WHITE,
    box,
    from_above,
    plane,
    scene_of,
    sheet,
    shoot,
    sun,
    translation,
)
from tests.gpu.physics_meshes import icosphere

pytestmark = pytest.mark.gpu
EYE = Camera.look_at((0.5, 1.5, 2.0), (0.0, 0.2, 0.0), yfov_rad=math.radians(50.0))
SIZE = (96, 64)


def pixel_rays(camera: Camera, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (H, W, 3), the directions with unit length along the view axis."""
    width, height = size
    x = ((np.arange(width) + 0.5) / width * 2 - 1) * width / height
    y = 1 - (np.arange(height) + 0.5) / height * 2
    xx, yy = np.meshgrid(x, y)
    m = camera.world_from_camera
    if camera.orthographic:
        origin = np.stack((xx * camera.ymag_m, yy * camera.ymag_m, np.zeros_like(xx)), 2) @ m[:3, :3].T + m[:3, 3]
        return origin, np.broadcast_to(-m[:3, 2], origin.shape)
    tangent = math.tan(0.5 * camera.yfov_rad)
    direction = np.stack((xx * tangent, yy * tangent, -np.ones_like(xx)), 2) @ m[:3, :3].T
    return np.broadcast_to(m[:3, 3], direction.shape), direction


@pytest.mark.smoke
@pytest.mark.parametrize("orthographic", [False, True])
def test_depth_position_and_normal_of_a_plane(orthographic: bool) -> None:
    camera = replace(EYE, orthographic=orthographic, ymag_m=0.8)
    frame = shoot(
        scene_of([plane("floor", 30.0, 0.1)], [sun()], camera), SIZE, aovs=("depth_m", "position_ws", "normal_ws")
    )
    origin, direction = pixel_rays(camera, SIZE)
    t = (0.1 - origin[..., 1]) / direction[..., 1]
    truth = origin + t[..., None] * direction
    seen = (t > 0) & (np.abs(truth[..., 0]) < 29.9) & (np.abs(truth[..., 2]) < 29.9)
    assert seen.mean() > 0.6
    np.testing.assert_allclose(frame.aov["depth_m"][seen], t[seen], rtol=1e-4)
    np.testing.assert_allclose(frame.aov["position_ws"][seen], truth[seen], atol=2e-3)
    np.testing.assert_allclose(frame.aov["normal_ws"][seen], np.tile((0.0, 1.0, 0.0), (seen.sum(), 1)), atol=1e-3)
    beyond = t <= 0
    assert not frame.aov["depth_m"][beyond].any() and not frame.aov["position_ws"][beyond].any()


def test_normals_of_a_ball_face_the_eye() -> None:
    ball = Instance("ball", icosphere("ball", 0.6, 32), WHITE, translation(0.1, 0.3, -0.2))
    frame = shoot(scene_of([ball], [sun()], EYE), SIZE, aovs=("normal_ws", "position_ws", "depth_m"))
    seen = frame.aov["depth_m"] > 0
    expected = (frame.aov["position_ws"][seen] - (0.1, 0.3, -0.2)) / 0.6
    assert seen.sum() > 300
    np.testing.assert_allclose(frame.aov["normal_ws"][seen], expected, atol=0.02)


def test_specular_surface_stands_first_in_depth_and_normal() -> None:
    """Water over a floor: first surface = the water; with specular_view=False the floor behind it."""
    scene = scene_of([plane("floor", 5.0, -1.0), sheet("water", 5.0, 0.0)], [sun()], from_above(1.0, 0.0, 4.0))
    aovs = ("depth_m", "normal_ws", "position_ws")
    with_water = shoot(scene, (16, 16), specular_view=True, aovs=aovs, quality="draft")
    without = shoot(scene, (16, 16), specular_view=False, aovs=aovs, quality="draft")
    np.testing.assert_allclose(with_water.aov["depth_m"], 4.0, rtol=1e-5)
    np.testing.assert_allclose(without.aov["depth_m"], 5.0, rtol=1e-5)
    np.testing.assert_allclose(with_water.aov["position_ws"][..., 1], 0.0, atol=1e-5)


def test_albedo_is_linear() -> None:
    """A mid-grey sRGB texel is 0.2158 linear; a linear image is taken as it is; the factor multiplies."""
    pixels = np.full((4, 4, 3), 128, np.uint8)
    for srgb, value in ((True, 0.21586), (False, 128 / 255)):
        material = Material("t", base_color=(1.0, 0.5, 0.25), base_color_image=Image("grey", pixels, srgb))
        frame = shoot(
            scene_of([plane("floor", 2.0, 0.0, material)], [sun()], from_above(1.0)),
            (8, 8),
            method="none",
            aovs=("albedo",),
        )
        np.testing.assert_allclose(frame.aov["albedo"][4, 4], np.array([1.0, 0.5, 0.25]) * value, rtol=5e-3)


# -- motion -----------------------------------------------------------------------------------------------------------


def motion_of(
    device: Device, scene: Scene, before: Camera, transforms: dict[str, np.ndarray], size: tuple[int, int] = SIZE
) -> tuple[np.ndarray, np.ndarray]:
    """Motion (H, W, 2), uv, row 0 on top, and depth (H, W) of the opaque layer."""
    setup = FrameSetup.analyse(scene, size, resolve_options(pick("none"), "draft", {}), transmissive_shadows=False)
    graph = FrameGraph()
    gbuffer.declare_opaque(graph, setup)
    runner = PlanRunner(device, graph.compile(outputs=("gbuffer.motion", "gbuffer.depth_m")), setup)
    gpu = GpuScene(device)
    try:
        gpu.update(scene.instances_at(0.0))
        states = [CameraState.make(c, size, setup.scene_bounds_ws) for c in (scene.camera, before)]
        runner.run(FrameState(0.0, states[0], states[1], gpu, 1.0, transforms))
        motion, depth = runner.read("gbuffer.motion"), runner.read("gbuffer.depth_m")
        return motion[::-1].astype(np.float64), depth[::-1].astype(np.float64)
    finally:
        runner.release()
        gpu.release()


def uv_of(points: np.ndarray, camera: Camera, size: tuple[int, int]) -> np.ndarray:
    """(..., 2): u to the right, v upwards, of world points."""
    view = (points - camera.world_from_camera[:3, 3]) @ camera.world_from_camera[:3, :3]
    tangent = math.tan(0.5 * camera.yfov_rad)
    x = view[..., 0] / -view[..., 2] / (tangent * size[0] / size[1])
    return np.stack((x * 0.5 + 0.5, view[..., 1] / -view[..., 2] / tangent * 0.5 + 0.5), -1)


def test_motion_of_a_moving_camera(device: Device) -> None:
    before = Camera.look_at((0.45, 1.55, 2.1), (0.05, 0.15, 0.0), yfov_rad=math.radians(50.0))
    motion, depth = motion_of(device, scene_of([plane("floor", 30.0)], [], EYE), before, {})
    origin, direction = pixel_rays(EYE, SIZE)
    seen = (depth > 0) & (depth < 10.0)
    points = (origin + depth[..., None] * direction)[seen]
    expected = uv_of(points, EYE, SIZE) - uv_of(points, before, SIZE)
    assert np.abs(expected).max() > 0.02
    np.testing.assert_allclose(motion[seen], expected, atol=2e-4)


def test_motion_of_a_moving_object(device: Device) -> None:
    old, now = translation(-0.1, 0.3, 0.05), translation(0.1, 0.35, 0.0)
    mover = Instance("mover", box("mover", (0.6, 0.6, 0.6), (0, 0, 0)).mesh, WHITE, now)
    motion, depth = motion_of(device, scene_of([mover, plane("floor", 3.0)], [], EYE), EYE, {"mover": old})
    origin, direction = pixel_rays(EYE, SIZE)
    points = origin + depth[..., None] * direction
    on_mover = (depth > 0) & (points[..., 1] > 0.06) & (points[..., 1] < 0.64)
    moved = points[on_mover]
    expected = uv_of(moved, EYE, SIZE) - uv_of(moved - (0.2, 0.05, -0.05), EYE, SIZE)
    assert on_mover.sum() > 300
    np.testing.assert_allclose(motion[on_mover], expected, atol=3e-4)
    still = (depth > 0) & (np.abs(points[..., 1]) < 1e-3)
    assert np.abs(motion[still]).max() < 1e-5


def test_motion_of_water_that_rises(device: Device) -> None:
    """The mesh itself changes: the specular layer's motion comes from where its vertices were in the last frame."""
    rest = sheet("water", 1.5, 0.0)

    def mesh_at(time_s: float) -> Mesh:
        return replace(rest.mesh, positions_m=rest.mesh.positions_m + np.array([0.0, 0.2 * time_s, 0.0], np.float32))

    water = WaterBody("water", rest.material, mesh_at)
    scene = scene_of([plane("floor", 3.0, -1.0)], [], EYE, waters=(water,))
    setup = FrameSetup.analyse(scene, SIZE, resolve_options(pick("none"), "draft", {}), transmissive_shadows=False)
    graph = FrameGraph()
    gbuffer.declare_opaque(graph, setup)
    gbuffer.declare_specular(graph, setup)
    runner = PlanRunner(device, graph.compile(outputs=("specular.motion", "specular.depth_m")), setup)
    gpu = GpuScene(device)
    gpu.keep_previous = True
    camera = CameraState.make(EYE, SIZE, setup.scene_bounds_ws)
    found = []
    try:
        for time_s in (0.0, 0.5, 0.5):
            if len(found) == 2:
                gpu.hold()
            else:
                gpu.update(scene.instances_at(time_s))
            runner.run(FrameState(time_s, camera, camera, gpu, 1.0))
            motion, depth = runner.read("specular.motion"), runner.read("specular.depth_m")
            found.append((motion[::-1].astype(np.float64), depth[::-1].astype(np.float64)))
    finally:
        runner.release()
        gpu.release()
    origin, direction = pixel_rays(EYE, SIZE)
    motion, depth = found[1]
    seen = depth > 0
    points = (origin + depth[..., None] * direction)[seen]
    np.testing.assert_allclose(points[:, 1], 0.1, atol=1e-3)
    expected = uv_of(points, EYE, SIZE) - uv_of(points - (0.0, 0.1, 0.0), EYE, SIZE)
    assert seen.sum() > 1000 and np.abs(expected).max() > 0.02
    np.testing.assert_allclose(motion[seen], expected, atol=3e-4)
    for still in (found[0][0], found[2][0]):  # the first frame has no past; the third shows what the second did
        assert np.abs(still).max() < 1e-6


def test_motion_of_what_was_behind_the_eye_is_finite(device: Device) -> None:
    turned = Camera.look_at((0.5, 1.5, 2.0), (1.0, 2.8, 4.0), yfov_rad=math.radians(50.0))
    motion, _ = motion_of(device, scene_of([plane("floor", 30.0)], [], EYE), turned, {})
    assert np.isfinite(motion).all() and np.abs(motion).max() <= 8.0


# -- AOVs -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("specular_view", [True, False])
@pytest.mark.parametrize("name", [row[0] for row in glc.builtin_scenes()])
def test_every_aov_of_every_built_in_scene(name: str, specular_view: bool) -> None:
    scene = glc.load_scene(name)
    with glc.Renderer(
        scene, (48, 36), quality="draft", backend=BACKEND, aovs=tuple(AOVS), specular_view=specular_view
    ) as renderer:
        frame = renderer.render(time=0.0)
    assert set(frame.aov) == set(AOVS)
    for aov, values in frame.aov.items():
        assert values.shape in ((36, 48), (36, 48, 3)) and values.dtype == np.float32, aov
        assert np.isfinite(values).all(), aov
    assert np.isfinite(frame.image).all() and frame.image.min() >= 0.0
    assert frame.aov["depth_m"].max() > 0.0 and frame.aov["caustic_irradiance"].min() >= 0.0
    assert (frame.aov["caustic_irradiance"].max() > 0.0) == (name != "dry-room")
    lengths = np.linalg.norm(frame.aov["normal_ws"], axis=2)
    np.testing.assert_allclose(lengths[frame.aov["depth_m"] > 0], 1.0, atol=5e-3)


def test_arrays_survive_the_way_to_disk(tmp_path: Path) -> None:
    OpenEXR = pytest.importorskip("OpenEXR")
    ball = Instance("ball", icosphere("ball", 0.4, 16), GLASS, translation(0.0, 0.6, 0.0))
    frame = shoot(
        scene_of([plane("floor", 2.0), ball], [sun(20.0, 1000.0)], EYE), SIZE, aovs=tuple(AOVS), quality="draft"
    )
    frame.save(tmp_path / "f.npz")
    with np.load(tmp_path / "f.npz") as stored:
        assert set(stored) == set(AOVS)
        for name in AOVS:
            assert np.array_equal(stored[name], frame.aov[name]), name
    frame.save(tmp_path / "f.exr")
    channels = OpenEXR.File(str(tmp_path / "f.exr"), separate_channels=True).channels()
    assert np.array_equal(channels["R"].pixels, frame.image[..., 0])
    assert np.array_equal(channels["caustic_irradiance.G"].pixels, frame.aov["caustic_irradiance"][..., 1])
    assert np.array_equal(channels["normal_ws.Y"].pixels, frame.aov["normal_ws"][..., 1])
    assert np.array_equal(channels["depth_m.V"].pixels, frame.aov["depth_m"])
