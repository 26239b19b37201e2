"""Anti-aliasing over time: a still view converges, a moving edge leaves no ghost, NaN does not last, off is off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

import glcaustics as glc
from glcaustics.errors import UsageError
from glcaustics.passes.taa import RADIANCE
from glcaustics.renderer import plan_frame
from glcaustics.scene.model import Camera, Scene
from glcaustics.scene.water import Wave, WaveSurface, make_water
from tests.gpu.feature_scenes import BACKEND, WATER, box, from_above, plane, scene_of, sun

pytestmark = pytest.mark.gpu
SIZE = (96, 72)
Image = npt.NDArray[np.float32]


def edges() -> Scene:
    """Slanted white boxes over a dark floor under a slanted sun: edges of surfaces and of shadows, at every angle."""
    camera = Camera.look_at((0.3, 2.4, 2.9), (0.0, 0.3, 0.0), yfov_rad=0.8)
    scene = scene_of(
        [
            plane("floor", 6.0, 0.0),
            box("near", (0.5, 0.6, 0.4), (0.4, 0.3, 0.5)),
            box("far", (0.2, 1.2, 0.2), (-0.6, 0.6, -0.4)),
        ],
        [sun(35.0)],
        camera,
    )
    dark = replace(scene.instances[0], material=replace(scene.instances[0].material, base_color=(0.03, 0.03, 0.03)))
    # Underexposed: the pass averages what is shown, 1 / (1 + luminance x exposure), the truth of these tests radiance.
    return replace(scene, instances=(dark, *scene.instances[1:]), exposure=0.1)


def panning(scene: Scene, px_per_frame: float, fps: float = 30.0) -> Scene:
    """The camera turns about the vertical by so many pixels of the picture's middle in a frame."""
    start = np.asarray(scene.camera.world_from_camera)
    per_s = px_per_frame * fps * 2.0 * np.tan(0.4) / SIZE[1]

    def camera_at(time_s: float) -> Camera:
        c, s = np.cos(per_s * time_s), np.sin(per_s * time_s)
        turn = np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]])
        moved = start.copy()
        moved[:3, :3] = (turn @ start)[:3, :3]
        return replace(scene.camera, world_from_camera=moved)

    return replace(scene, camera_at=camera_at)


def open_renderer(scene: Scene, taa: bool = False) -> glc.Renderer:
    return glc.Renderer(scene, SIZE, "none", "low", BACKEND, stats=False, taa=taa)


def rmse(a: Image, b: Image) -> float:
    """Root of the mean squared difference, over the mean of the second."""
    return float(np.sqrt(np.mean((a.astype(np.float64) - b) ** 2)) / b.mean())


def test_a_still_view_converges_to_the_supersampled_picture() -> None:
    """As the mean over 16 shifted pictures: an order closer to 64 of them than a single picture is."""
    with open_renderer(edges()) as renderer:
        single, truth = renderer.render().image, renderer.render(samples=64).image
    with open_renderer(edges(), taa=True) as renderer:
        frames = [renderer.render().image for _ in range(32)]
    errors = [rmse(frame, truth) for frame in (single, frames[0], frames[3], frames[15], frames[31])]
    flicker = rmse(frames[31], frames[30])
    print("single, frames 1, 4, 16, 32:", np.round(errors, 4), "from frame to frame:", round(flicker, 4))
    assert errors[3] < 0.35 * errors[0]
    assert errors[4] < 0.3 * errors[0]
    assert flicker < 0.12 * errors[0]


@pytest.mark.parametrize(("speed_px", "most"), [(0.7, 0.025), (5.3, 0.006)])
def test_a_moving_edge_leaves_no_ghost(speed_px: float, most: float) -> None:
    """Panning: closer to the supersampled truth than the single picture, and no pixel that a blend with an old
    picture would have darkened or lightened beyond what its surroundings hold.
    """
    scene = panning(edges(), speed_px)
    times = [k / 30.0 for k in range(12)]
    with open_renderer(scene) as renderer:
        singles = [renderer.render(t).image for t in times[-3:]]
        truths = [renderer.render(t, samples=32).image for t in times[-3:]]
    with open_renderer(scene, taa=True) as renderer:
        frames = [renderer.render(t).image for t in times][-3:]
    error = [np.mean([rmse(a, b) for a, b in zip(x, truths, strict=True)]) for x in (singles, frames)]
    ghost = np.mean([beyond_surroundings(a, b) for a, b in zip(frames, truths, strict=True)])
    print(f"{speed_px} px a frame: single {error[0]:.4f}, taa {error[1]:.4f}; beyond the surroundings {ghost:.5f}")
    assert error[1] < 0.9 * error[0]
    assert ghost < most  # without clipping 0.029 and 0.009


def beyond_surroundings(picture: Image, truth: Image) -> float:
    """RMS, over the mean, of what lies outside of the truth's range over 5 x 5 pixels, where blur stays, not ghosts."""
    padded = np.pad(truth.astype(np.float64), ((2, 2), (2, 2), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (5, 5), axis=(0, 1))
    low, high = windows.min(axis=(3, 4)), windows.max(axis=(3, 4))
    return float(np.sqrt(np.mean((picture - np.clip(picture, low, high)) ** 2)) / truth.mean())


@pytest.mark.parametrize("poison", [np.nan, np.inf])
def test_a_poisoned_history_is_gone_within_one_frame(poison: float) -> None:
    with open_renderer(edges(), taa=True) as renderer:
        before = [renderer.render().image for _ in range(4)][-1]
        with renderer.device.guard_state():
            texture = renderer._runner.texture(RADIANCE)  # type: ignore[union-attr]
            values = np.frombuffer(texture.read(), np.float32).reshape(texture.height, texture.width, 4).copy()
            values[20:50, 30:60] = poison
            texture.write(values.tobytes())
        after = renderer.render().image
    assert np.isfinite(after).all()
    assert after.mean() == pytest.approx(before.mean(), rel=0.01)


def test_off_leaves_everything_as_it_was() -> None:
    """The same passes, the same picture to the bit, and a row in the plan that says why."""
    scene = edges()
    with open_renderer(scene) as renderer:
        first, plan = renderer.render(), renderer.plan
    with open_renderer(scene, taa=True) as renderer:
        shifted, with_taa = renderer.render(), renderer.plan
    with open_renderer(scene, taa=False) as renderer:
        second = renderer.render()
    assert np.array_equal(first.image, second.image) and np.array_equal(first.ldr, second.ldr)
    assert not np.array_equal(first.image, shifted.image)
    assert not plan.history_slots and "taa" not in [s.name for s in plan.steps]
    assert [s.name for s in with_taa.steps] == [*[s.name for s in plan.steps][:-1], "taa", "tonemap"]
    reasons = {item.name: item.because for item in plan_frame(scene, SIZE, "none").left_out}
    assert "--taa" in reasons["taa"] and RADIANCE in with_taa.history_slots


def test_positions_are_those_of_the_shifted_frame() -> None:
    """The floor's points lie on the floor whatever the shift."""
    with glc.Renderer(edges(), SIZE, "none", "low", BACKEND, aovs=("position_ws", "normal_ws"), taa=True) as renderer:
        for _ in range(3):
            frame = renderer.render()
    on_floor = (frame.aov["normal_ws"][..., 1] > 0.99) & (frame.aov["position_ws"][..., 1] < 0.1)
    assert on_floor.sum() > 500
    assert np.abs(frame.aov["position_ws"][..., 1][on_floor]).max() < 1e-4


def test_samples_and_taa_exclude_each_other() -> None:
    with open_renderer(edges(), taa=True) as renderer, pytest.raises(UsageError, match="use one of the two"):
        renderer.render(samples=4)


def test_light_that_moves_over_a_floor_is_not_washed_out() -> None:
    """Caustics that wander over a floor that stands still: the mean over frames must not smear them. Contrast is the
    standard deviation over the mean, in the middle of the floor.
    """
    k = 2.0 * np.pi / 0.5
    surface = WaveSurface([Wave(2.0 / k**2, k, 0.0, 0.0, k * 0.08, 0.0)])
    water = make_water("water", WATER, surface, size_m=(2.4, 2.4), resolution=(256, 16), center_m=(0.0, 0.0, 0.0))
    scene = scene_of([plane("floor", 3.0, -1.0)], [sun()], from_above(1.2, -1.0), waters=(water,))
    contrast = []
    for taa in (False, True):
        with glc.Renderer(
            scene, (64, 64), "caustic_map", "low", BACKEND, stats=False, specular_view=False, taa=taa
        ) as renderer:
            frames = [renderer.render(float(t)).image[16:48, 16:48, 1] for t in range(10)]
        contrast.append(np.mean([f.std() / f.mean() for f in frames[-3:]]))
    print(f"contrast {contrast[0]:.3f}, with taa {contrast[1]:.3f}")
    assert contrast[1] > 0.8 * contrast[0]
