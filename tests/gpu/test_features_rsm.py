"""Reflective shadow maps, asked for through a graph of their own."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from glcaustics.caustics.registry import pick
from glcaustics.gpu import Device
from glcaustics.graph import FrameGraph
from glcaustics.passes import rsm
from glcaustics.passes.camera import CameraState
from glcaustics.passes.frame import FrameSetup, FrameState
from glcaustics.passes.geometry import GpuScene
from glcaustics.passes.runner import PlanRunner
from glcaustics.renderer import resolve_options
from glcaustics.scene.model import Image, Instance, Light, LightKind, Material, Scene
from tests.gpu.feature_scenes import GLASS, WHITE, box, from_above, lamp, plane, scene_of, sheet, sun, translation
from tests.gpu.physics_meshes import icosphere

pytestmark = pytest.mark.gpu
LAYERS = ("depth_m", "normal_ws", "flux", "material")


@contextmanager
def rsm_of(device: Device, scene: Scene, *, with_specular: bool) -> Iterator[dict[str, np.ndarray]]:
    """The four attachments of light 0, each (H, W, channels) float32."""
    options = resolve_options(pick("caustic_map"), "draft", {})
    setup = FrameSetup.analyse(scene, (32, 32), options, transmissive_shadows=True)
    graph = FrameGraph()
    rsm.declare(graph, setup, setup.lights[0], with_specular=with_specular)
    layer = "rsm_specular" if with_specular else "rsm"
    names = {n: f"{layer}.{n}@0" for n in LAYERS}
    gpu = GpuScene(device)
    runner = PlanRunner(device, graph.compile(outputs=tuple(names.values())), setup)
    try:
        gpu.update(scene.instances_at(0.0))
        camera = CameraState.make(scene.camera, (32, 32), setup.scene_bounds_ws)
        runner.run(FrameState(0.0, camera, camera, gpu, 1.0))
        yield {n: np.atleast_3d(runner.read(resource)).astype(np.float64) for n, resource in names.items()}
    finally:
        runner.release()
        gpu.release()


def test_directional_flux_is_the_lit_cross_section(device: Device) -> None:
    """Sum over the texels = E_perp x the cross-section of the floor x its base colour."""
    light = sun(40.0, 3.0)
    floor = plane("floor", 1.5)
    with rsm_of(device, scene_of([floor], [light], from_above(2.0)), with_specular=False) as maps:
        area = 9.0 * math.cos(math.radians(40.0))
        assert maps["flux"][..., 1].sum() == pytest.approx(3.0 * area * 0.8, rel=0.01)
        there = maps["normal_ws"][..., 3] > 0
        np.testing.assert_allclose(
            maps["normal_ws"][there][:, :3], np.tile((0.0, 1.0, 0.0), (there.sum(), 1)), atol=1e-5
        )
        np.testing.assert_allclose(maps["material"][there][:, 0], 1.0)
        np.testing.assert_allclose(maps["material"][there][:, 1], 0.0)
        depth = maps["depth_m"][there]
        assert np.ptp(depth) == pytest.approx(
            3.0 * math.sin(math.radians(40.0)), rel=0.02
        )  # the slanted floor's extent
        assert depth.min() >= 0.0


def test_point_light_flux_is_intensity_times_solid_angle(device: Device) -> None:
    """Solid angle of a rectangle 2a x 2b at distance h: 4 atan(a b / (h sqrt(a^2 + b^2 + h^2)))."""
    h, a = 1.2, 1.5
    with rsm_of(
        device, scene_of([plane("floor", a)], [lamp((0.0, h, 0.0), 7.0)], from_above(2.0)), with_specular=False
    ) as m:
        solid_angle = 4.0 * math.atan(a * a / (h * math.sqrt(2 * a * a + h * h)))
        assert m["flux"][..., 1].sum() == pytest.approx(7.0 * solid_angle * 0.8, rel=0.01)
        there = m["flux"][..., 3] > 0
        depth = m["depth_m"][there]
        assert depth.min() == pytest.approx(h, rel=2e-3)
        assert depth.max() == pytest.approx(math.sqrt(2 * a * a + h * h), rel=0.02)


def test_cube_of_a_lamp_in_a_room_holds_its_whole_flux(device: Device) -> None:
    """A closed box round the lamp: the six faces sum to 4 pi I."""
    room = Instance("room", box("room", (3.0, 2.0, 4.0), (0, 0, 0)).mesh, WHITE, translation(0.2, 0.1, 0.3))
    with rsm_of(device, scene_of([room], [lamp((0.0, 0.0, 0.0), 2.0)], from_above(2.0)), with_specular=False) as maps:
        assert maps["flux"][..., 1].sum() == pytest.approx(4.0 * math.pi * 2.0 * 0.8, rel=0.005)
        assert (maps["flux"][..., 3] > 0).all()


def test_spot_flux_follows_its_cone(device: Device) -> None:
    inner, outer = 0.2, 0.5
    light = Light(
        LightKind.SPOT, intensity=5.0, position_ws=(0.0, 2.0, 0.0), inner_cone_rad=inner, outer_cone_rad=outer
    )
    with rsm_of(device, scene_of([plane("floor", 3.0)], [light], from_above(2.0)), with_specular=False) as maps:
        cosine = np.linspace(math.cos(outer), 1.0, 20001)
        fall = np.clip((cosine - math.cos(outer)) / (math.cos(inner) - math.cos(outer)), 0, 1) ** 2
        flux = 5.0 * 2 * math.pi * np.trapezoid(fall, cosine)
        assert maps["flux"][..., 1].sum() == pytest.approx(flux * 0.8, rel=0.01)


def test_specular_layer_stands_before_the_opaque_one(device: Device) -> None:
    """A glass ball over the floor: the plain RSM looks past it, the specular one shows it."""
    ball = Instance("ball", icosphere("ball", 0.5, 16), GLASS, translation(0.0, 1.0, 0.0))
    scene = scene_of([plane("floor", 1.5), sheet("water", 0.2, 0.3), ball], [sun(0.0, 2.0)], from_above(2.0))
    with rsm_of(device, scene, with_specular=False) as plain, rsm_of(device, scene, with_specular=True) as specular:
        assert plain["flux"][..., 1].sum() == pytest.approx(2.0 * 9.0 * 0.8, rel=0.01)
        assert set(np.unique(plain["material"][..., 1])) == {0.0}
        kinds = specular["material"][..., 1]
        glass = kinds == 2.0
        assert glass.sum() > 0 and set(np.unique(kinds)) <= {0.0, 2.0, 3.0}
        assert specular["flux"][glass][:, 1].sum() == pytest.approx(2.0 * math.pi * 0.25, rel=0.03)
        normal = specular["normal_ws"][glass][:, :3]
        np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-3)
        assert (normal[:, 1] > 0.0).all()  # towards the light
        assert (specular["depth_m"][glass] < specular["depth_m"][kinds == 0.0].max()).all()


def test_textures_colour_the_flux(device: Device) -> None:
    """A base colour image, half red and half white, srgb: linear mean (1, .5, .5)."""
    pixels = np.zeros((8, 8, 3), np.uint8)
    pixels[..., 0] = 255
    pixels[:, 4:, 1:] = 255
    floor = plane(
        "floor", 0.5, 0.0, Material("tiles", base_color=(1.0, 1.0, 1.0), base_color_image=Image("i", pixels, True))
    )
    with rsm_of(device, scene_of([floor], [sun(0.0, 1.0)], from_above(2.0)), with_specular=False) as maps:
        np.testing.assert_allclose(maps["flux"][..., :3].sum(axis=(0, 1)), (1.0, 0.5, 0.5), rtol=0.03)
