"""The second depth layer: what it holds, what eye rays find in it, against scenes without what hides it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

import glcaustics as glc
from glcaustics.errors import UsageError
from glcaustics.gpu import Device
from glcaustics.graph import FrameGraph
from glcaustics.passes import gbuffer
from glcaustics.passes.camera import CameraState
from glcaustics.passes.frame import FrameSetup, FrameState
from glcaustics.passes.geometry import GpuScene, boxes_of
from glcaustics.passes.runner import PlanRunner
from glcaustics.renderer import Frame, plan_frame, resolve_options
from glcaustics.scene.model import Camera, Image, Instance, Material, Scene
from glcaustics.scene.transform import scaled
from tests.gpu.feature_scenes import (
    BACKEND,
    GLASS,
    MIRROR,
    WHITE,
    box,
    from_above,
    plane,
    scene_of,
    sheet,
    sun,
    translation,
)
from tests.gpu.physics_meshes import grid_triangles, make_mesh

pytestmark = pytest.mark.gpu
HIDDEN, SECOND = 7, 8
SIZE = (160, 120)
FloatArray = npt.NDArray[np.float64]


def layers(device: Device, scene: Scene, size: tuple[int, int], *resources: str) -> list[FloatArray]:
    """G-buffer resources of both layers, row 0 on top."""
    options = resolve_options(None, "low", {"depth_layers": 2})
    setup = FrameSetup.analyse(scene, size, options, transmissive_shadows=False)
    graph = FrameGraph()
    gbuffer.declare_opaque(graph, setup)
    gbuffer.declare_second(graph, setup)
    runner = PlanRunner(device, graph.compile(outputs=resources), setup)
    gpu = GpuScene(device)
    gpu.update(scene.instances_at(0.0))
    camera = CameraState.make(scene.camera, size, setup.scene_bounds_ws, boxes_ws=boxes_of(scene.instances))
    runner.run(FrameState(0.0, camera, camera, gpu, 1.0))
    found = [np.atleast_3d(runner.read(resource))[::-1].astype(np.float64) for resource in resources]
    runner.release()
    gpu.release()
    return found


def test_second_layer_is_the_next_front_face(device: Device) -> None:
    """A box over a floor, seen from above: behind its top comes the floor, not the box's own underside; behind an open
    sheet comes whatever is next; behind the floor nothing, and its plane goes on."""
    red = Material("red", base_color=(1.0, 0.0, 0.0))
    scene = scene_of(
        [plane("floor", 3.0, 0.0, WHITE), box("box", (0.5, 0.5, 0.5), (-0.5, 0.5, 0.0)), plane("leaf", 0.2, 0.7, red)],
        [sun()],
        from_above(1.0, 0.0, 4.0),
    )
    leaf = replace(scene.instances[2], world_from_object=translation(-0.5, 0.5, 0.0))  # over the box
    scene = replace(
        scene,
        instances=(
            *scene.instances[:2],
            leaf,
            replace(leaf, name="free", world_from_object=translation(0.5, 0.0, 0.0)),
        ),
    )
    first, second, plane1, plane2, albedo = layers(
        device,
        scene,
        (64, 64),
        "gbuffer.depth_m",
        "gbuffer2.depth_m",
        "gbuffer.plane",
        "gbuffer2.plane",
        "gbuffer2.albedo",
    )
    x, z = np.meshgrid((np.arange(64) + 0.5) / 32 - 1, (np.arange(64) + 0.5) / 32 - 1)
    in_leaf = lambda cx: (np.abs(x - cx) < 0.19) & (np.abs(z) < 0.19)  # noqa: E731
    in_box = (np.abs(x + 0.5) < 0.24) & (np.abs(z) < 0.24)
    free = (np.abs(x + 0.5) > 0.26) & (np.abs(x - 0.5) > 0.21)
    np.testing.assert_allclose(first[in_leaf(-0.5)], 2.8, rtol=1e-5)
    np.testing.assert_allclose(second[in_leaf(-0.5)], 3.25, rtol=1e-5)  # the box's top
    ring = in_box & ~((np.abs(x + 0.5) < 0.21) & (np.abs(z) < 0.21))
    np.testing.assert_allclose(first[ring], 3.25, rtol=1e-5)
    np.testing.assert_allclose(second[ring], 4.0, rtol=1e-5)
    np.testing.assert_allclose(second[in_leaf(0.5)], 4.0, rtol=1e-5)
    np.testing.assert_allclose(albedo[in_leaf(0.5)][:, :3], 0.8, atol=1e-3)
    assert not second[free].any()
    np.testing.assert_array_equal(plane2[free], plane1[free])
    np.testing.assert_allclose(plane2[ring][:, 3], 4.0, rtol=1e-5)


def test_nothing_is_peeled_off_itself(device: Device) -> None:
    """One surface alone, steep and smooth, closed or open: no second layer, whatever the slope. Seen from inside a
    closed room its back faces count."""
    slanted = replace(plane("slope", 2.0), world_from_object=translation(0.0, 0.0, 0.0) @ rotation_x(84.0))
    ball = scene_of([box("cube", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))], [sun()], from_above(1.0, 0.0, 4.0))
    eye = Camera.look_at((0.7, 0.9, 2.0), (0.0, 0.0, 0.0), yfov_rad=1.0)
    for scene in (replace(ball, instances=(slanted,), camera=eye), ball, replace(ball, camera=eye)):
        depth, second = layers(device, scene, SIZE, "gbuffer.depth_m", "gbuffer2.depth_m")
        assert (depth > 0).sum() > 1000 and not second.any()
    room = scene_of(
        [box("room", (6.0, 6.0, 6.0), (0.0, 0.0, 0.0)), box("post", (0.4, 2.0, 0.4), (0.0, 0.0, -1.0))], [sun()], eye
    )
    room = replace(room, camera=Camera.look_at((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), yfov_rad=0.6))
    depth, second = layers(device, room, SIZE, "gbuffer.depth_m", "gbuffer2.depth_m")
    post = depth[..., 0] < 4.9
    assert post.sum() > 500
    np.testing.assert_allclose(second[post], 5.0, rtol=1e-4)


def rotation_x(degrees: float) -> FloatArray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])


# -- eye rays --------------------------------------------------------------------------------------------------------


def checks(name: str, cells: int = 32) -> Material:
    """A board of soft-edged colours, so that a look-up a pixel off shows."""
    random = np.random.default_rng(4)
    pixels = random.integers(40, 255, (cells, cells, 3)).astype(np.uint8)
    return Material(name, base_color=(1.0, 1.0, 1.0), base_color_image=Image(name, pixels, False))


def board(name: str, half_m: float, y_m: float) -> Instance:
    """A square floor with one texture over it."""
    x, z = np.meshgrid([-half_m, half_m], [-half_m, half_m])
    positions = np.stack((x.ravel(), np.full(4, y_m), z.ravel()), 1)
    mesh = make_mesh(name, positions, np.tile([0.0, 1.0, 0.0], (4, 1)), grid_triangles(1, 1), False)
    return Instance(name, replace(mesh, uv=((mesh.positions_m[:, [0, 2]] / half_m + 1.0) / 2.0)), checks(name))


def over_the_block(*, block: bool) -> Scene:
    """Water over a patterned floor with a sunken block across the view: some rays that pass over its top end on the
    floor that it hides. The sun stands overhead, so the block's shadow is its own footprint."""
    camera = Camera.look_at((0.0, 1.2, 2.2), (0.0, -0.5, -0.1), yfov_rad=0.7)
    sunken = [box("block", (1.6, 0.45, 0.25), (0.0, -0.775, 0.0), Material("block", base_color=(0.1, 0.2, 0.6)))]
    instances = [board("floor", 3.0, -1.0), sheet("water", 2.9, 0.0), *(sunken if block else [])]
    return scene_of(instances, [sun(0.0, 100.0)], camera)


def behind_the_pane(*, block: bool) -> Scene:
    """A post before a patterned wall, seen through a tilted slab of glass."""
    tilt = rotation_x(50.0)
    pane = Instance(
        "pane", box("pane", (4.0, 0.5, 4.0), (0.0, 0.0, 0.0), GLASS).mesh, GLASS, translation(0.0, 0.8, 0.6) @ tilt
    )
    upright = replace(board("wall", 5.0, 0.0), world_from_object=translation(0.0, 0.5, -5.0) @ rotation_x(90.0))
    post = [box("post", (2.0, 0.25, 0.25), (0.0, 0.45, -1.0), Material("post", base_color=(0.6, 0.1, 0.1)))]
    camera = Camera.look_at((0.0, 0.7, 3.0), (0.0, 0.5, -1.0), yfov_rad=0.6)
    light = replace(sun(), direction_ws=(0.0, -math.sqrt(0.5), -math.sqrt(0.5)), intensity=100.0)
    return scene_of([upright, pane, *(post if block else [])], [light], camera)


def render(
    scene: Scene, depth_layers: int, method: str = "none", aovs: tuple[str, ...] = (), **options: object
) -> Frame:
    chosen = {"depth_layers": depth_layers, **options}
    with glc.Renderer(
        scene, SIZE, method, "medium", BACKEND, aovs=("solve_status", "solve_hit", *aovs), options=chosen
    ) as made:
        return made.render()


@pytest.mark.parametrize("solver", [pytest.param("cascade", marks=pytest.mark.smoke), "newton", "dda", "hierarchical"])
def test_what_a_block_hides_is_solved_and_is_the_floor(solver: str) -> None:
    """Pixels of the second layer show what the scene without the block shows there; with one layer, its rim."""
    bare = render(over_the_block(block=False), 1, refraction=solver).image
    one, two = (render(over_the_block(block=True), n, refraction=solver) for n in (1, 2))
    status = two.aov["solve_status"]
    second = status == SECOND
    assert second.sum() > 150
    assert np.isin(one.aov["solve_status"][second], (3, 5, 6, HIDDEN)).all()
    assert (status == HIDDEN).sum() < 0.1 * (one.aov["solve_status"] == HIDDEN).sum() + 5
    scale = bare.mean()
    errors = [np.abs(frame.image - bare).mean(axis=2)[second] / scale for frame in (one, two)]
    print(solver, "share", second.mean(), "mean error with one layer", errors[0].mean(), "two", errors[1].mean())
    assert errors[1].mean() < 0.005 and np.median(errors[1]) < 1e-4 and errors[0].mean() > 0.1
    same = ~second & (status == one.aov["solve_status"])
    np.testing.assert_array_equal(one.image[same], two.image[same])


def test_behind_a_tilted_pane() -> None:
    bare = render(behind_the_pane(block=False), 1).image
    one, two = (render(behind_the_pane(block=True), n) for n in (1, 2))
    second = two.aov["solve_status"] == SECOND
    lit = second & (one.aov["solve_status"] == HIDDEN)
    assert lit.sum() > 60
    errors = [np.abs(frame.image - bare).mean(axis=2)[lit] / bare.mean() for frame in (one, two)]
    print("pane: share", second.mean(), "mean error with one layer", errors[0].mean(), "two", errors[1].mean())
    assert errors[1].mean() < 0.005 and np.median(errors[1]) < 1e-4 and errors[0].mean() > 0.1


def before_a_mirror(*, block: bool) -> Scene:
    """A mirror on the floor shows the part of a wall that a post hides from the eye."""
    upright = replace(board("wall", 3.0, 0.0), world_from_object=translation(0.0, 0.5, -2.5) @ rotation_x(90.0))
    post = [box("post", (1.6, 0.5, 0.2), (0.0, 0.9, -1.2), Material("post", base_color=(0.6, 0.1, 0.1)))]
    camera = Camera.look_at((0.0, 1.6, 2.4), (0.0, 0.5, -1.0), yfov_rad=0.9)
    light = replace(sun(), direction_ws=(0.0, -math.sqrt(0.5), -math.sqrt(0.5)), intensity=100.0)
    return scene_of([upright, plane("mirror", 2.0, 0.0, MIRROR), *(post if block else [])], [light], camera)


def test_reflected_rays_find_the_second_layer_too() -> None:
    bare = render(before_a_mirror(block=False), 1, reflection_steps=512).image
    one, two = (render(before_a_mirror(block=True), n, reflection_steps=512) for n in (1, 2))
    second = two.aov["solve_status"] == SECOND
    np.testing.assert_array_equal(second, one.aov["solve_status"] == HIDDEN)
    errors = [np.abs(frame.image - bare).mean(axis=2)[second] / bare.mean() for frame in (one, two)]
    print("mirror: share", second.mean(), "mean error with one layer", errors[0].mean(), "two", errors[1].mean())
    assert second.sum() > 500 and errors[1].mean() < 1e-4 and errors[0].mean() > 0.3


@pytest.mark.parametrize("method", ["caustic_map", "displaced_mesh"])
def test_second_layer_has_the_same_caustics(method: str) -> None:
    """Radiance and the caustic irradiance in view are those of the scene without the block."""
    aov = "caustic_irradiance"
    bare = render(over_the_block(block=False), 1, method, (aov,))
    two = render(over_the_block(block=True), 2, method, (aov,))
    second = two.aov["solve_status"] == SECOND
    assert second.sum() > 150
    for found, truth in ((two.image, bare.image), (two.aov[aov], bare.aov[aov])):
        error = np.abs(found - truth).mean(axis=2)[second] / truth.mean()
        print(method, "mean error", error.mean(), "median", np.median(error))
        assert error.mean() < 0.005 and np.median(error) < 1e-4


def test_photons_say_that_they_stay_on_the_first_layer() -> None:
    plan = plan_frame(over_the_block(block=True), SIZE, "photon_trace", options={"depth_layers": 2})
    assert {left.name: left.because for left in plan.left_out}["caustics2"].startswith("photon_trace brings caustics")


def test_built_only_where_asked() -> None:
    scene = over_the_block(block=True)
    extra = {"gbuffer2", "depth_chain2.4", "lighting2", "shade2", "displaced_mesh.gather2"}
    by_layers = [plan_frame(scene, SIZE, "displaced_mesh", options={"depth_layers": n}) for n in (1, 2)]
    names = [{step.name for step in plan.steps} for plan in by_layers]
    assert not extra & names[0] and extra <= names[1]
    reasons = {left.name: left.because for left in by_layers[0].left_out}
    assert "depth_layers=2" in reasons["gbuffer2"]
    unread = plan_frame(scene, SIZE, "displaced_mesh", options={"depth_layers": 2, "refraction": "sousa"})
    assert not extra & {step.name for step in unread.steps}
    with pytest.raises(UsageError, match="option depth_layers is 3"):
        plan_frame(scene, SIZE, options={"depth_layers": 3})


@pytest.mark.parametrize("change", ["orthographic", "small", "large"])
def test_second_layer_for_other_cameras_and_scales(change: str) -> None:
    """An orthographic camera; and the same scene a thousand times smaller or larger, pixel by pixel."""

    def scene(*, block: bool) -> Scene:
        made = over_the_block(block=block)
        if change == "orthographic":
            return replace(made, camera=replace(made.camera, orthographic=True, ymag_m=0.9))
        return scaled(made, 1e-3 if change == "small" else 1e3)

    bare, two = render(scene(block=False), 1).image, render(scene(block=True), 2)
    second = two.aov["solve_status"] == SECOND
    if change != "orthographic":
        there = render(over_the_block(block=True), 2).aov["solve_status"] == SECOND
        assert (second != there).sum() <= 0.02 * there.sum()
    error = np.abs(two.image - bare).mean(axis=2)[second] / bare.mean()
    assert second.sum() > 150 and error.mean() < 0.005 and np.median(error) < 1e-4
