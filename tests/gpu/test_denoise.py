"""The denoiser where things move: the light, the camera, both; and along edges, where photons are few."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.ndimage import binary_dilation, binary_erosion

import glcaustics as glc
from glcaustics.bench.flicker import EXPONENTIAL, FILTER, PLAIN, pan_flicker
from glcaustics.bench.plan import FlickerPlan
from glcaustics.bench.targets import bench_scene
from glcaustics.scene.model import Camera, Scene
from glcaustics.scene.water import Wave, WaveSurface, make_water
from tests.gpu.feature_scenes import WATER, box, from_above, plane, scene_of, sheet, sun

pytestmark = pytest.mark.gpu
BACKEND = os.environ.get("GLC_TEST_BACKEND", "egl")
SIZE, HALF_M = 96, 1.6
PX_M = 2.0 * HALF_M / SIZE
FloatArray = npt.NDArray[np.float64]
WAVE_M = 0.5  # wavelength: 15 px


def wavy(light_px: float, pan_px: float) -> Scene:
    """Bright lines under a wave, seen from above. In a second the wave runs by `light_px`, the camera by `pan_px`."""
    k = 2.0 * np.pi / WAVE_M
    surface = WaveSurface([Wave(2.0 / k**2, k, 0.0, 0.0, k * light_px * PX_M, 0.0)])
    water = make_water("water", WATER, surface, size_m=(2.4, 2.4), resolution=(384, 16), center_m=(0.0, 0.0, 0.0))
    if light_px == 0.0:
        water = replace(water, animated=False)
    scene = scene_of([plane("floor", 3.0, -1.0)], [sun()], from_above(HALF_M, -1.0), waters=(water,))
    start = np.asarray(scene.camera.world_from_camera)

    def camera_at(time_s: float) -> Camera:
        moved = start.copy()
        moved[:3, 3] += start[:3, 0] * pan_px * PX_M * time_s
        return replace(scene.camera, world_from_camera=moved)

    return replace(scene, camera_at=camera_at) if pan_px else scene


def open_renderer(scene: Scene, photons: int, **options: bool | int | str) -> glc.Renderer:
    return glc.Renderer(
        scene,
        (SIZE, SIZE),
        "photon_trace",
        "low",
        BACKEND,
        aovs=("caustic_irradiance", "position_ws"),
        specular_view=False,
        stats=False,
        options={"photons": photons, **options},
    )


def render(scene: Scene, times: list[float], photons: int, **options: bool | int | str) -> list[FloatArray]:
    with open_renderer(scene, photons, **options) as renderer:
        return [renderer.render(t).aov["caustic_irradiance"][..., 1].astype(np.float64) for t in times]


def phase_px(image: FloatArray, reference: FloatArray) -> float:
    """By how much a pattern stands to the right of another: phase at the reference's strongest frequency."""
    rows = slice(SIZE // 4, 3 * SIZE // 4)
    spectra = [np.fft.rfft(x[rows].mean(axis=0) - x[rows].mean()) for x in (image, reference)]
    k = int(np.argmax(np.abs(spectra[1])[3:])) + 3
    return float(-np.angle(spectra[0][k] / spectra[1][k]) / (2.0 * np.pi * k) * SIZE)


@pytest.mark.parametrize(("light_px", "pan_px"), [(0.0, 1.3), (2.0, 0.0), (2.0, 1.3)], ids=["pan", "light", "both"])
def test_filtered_is_nearer_to_the_truth_than_one_frame(light_px: float, pan_px: float) -> None:
    """Also where the light moves, which reprojection cannot follow: there a history that is merely reprojected makes it
    worse (the exponential mean is the base line), and drags the pattern behind.
    """
    scene, times = wavy(light_px, pan_px), [float(k) for k in range(10)]
    truth = np.mean(render(scene, [times[-1]] * 2, 400_000, denoise=False), axis=0)
    noisy = render(scene, times, 15_000, denoise=False)[-1]
    filtered = render(scene, times, 15_000)[-1]
    plain = render(scene, times, 15_000, denoise_history="exponential")[-1]
    error = [float(np.sqrt(np.mean((x - truth) ** 2)) / truth.mean()) for x in (noisy, filtered, plain)]
    lag = [phase_px(x, truth) for x in (filtered, plain)]
    print(
        f"one frame {error[0]:.3f}, filtered {error[1]:.3f}, exponential {error[2]:.3f}; lag {lag[0]:.3f}, {lag[1]:.3f}"
    )
    assert error[1] < 0.7 * error[0]
    assert error[1] < error[2]
    assert abs(lag[0]) < 0.25  # of 2 px a frame
    assert filtered.mean() == pytest.approx(truth.mean(), rel=0.01)
    if light_px:
        assert abs(lag[1]) > 0.4


def test_a_focus_is_no_noise() -> None:
    """A ball's focus is tens of times as bright as what is around it, but no photon is. While the history is too short
    to know its own variance, that of the photons' number keeps the filter from spreading the focus.
    """
    ball = bench_scene("glass-sphere")

    def frames(count: int, photons: int, **options: bool) -> list[FloatArray]:
        return render(ball, [0.0] * count, photons, **options)

    truth = np.mean(frames(6, 1 << 19, denoise=False), axis=0)
    noisy, filtered = frames(1, 1 << 16, denoise=False)[0], frames(4, 1 << 16)
    error = [float(np.sqrt(np.mean((x - truth) ** 2)) / truth.mean()) for x in (noisy, filtered[0], filtered[3])]
    print("one frame, filtered, filtered after four:", np.round(error, 3))
    assert truth.max() > 30.0 * truth.mean()
    assert error[1] < error[0] and error[2] < 0.6 * error[0]
    assert filtered[0].mean() == pytest.approx(truth.mean(), rel=0.01)


def test_panning_flickers_at_most_half_as_much_as_with_an_exponential_mean() -> None:
    """Base lines: the plain mean of the same frames with alpha 0.2, looked up bilinearly, and the same filter with such
    a history (Schied et al. 2017).
    """
    plan = FlickerPlan((SIZE, SIZE), 15_000, frames=56, shown=16, pan_px=0.37, reference_views=0)
    found = pan_flicker(wavy(0.0, 0.0), plan, BACKEND)
    flicker = {row["name"]: row["flicker"] for row in found["rows"]}
    print(found["motion_px"], flicker)
    assert found["motion_px"] == pytest.approx(0.37, rel=1e-3)
    assert flicker[FILTER] < 0.5 * flicker[PLAIN]
    assert flicker[FILTER] < 0.5 * flicker[EXPONENTIAL]


def test_no_bright_rim_along_edges_and_no_light_lost() -> None:
    """A slab over a lit floor, seen slanted. Photons that its edge hides from the eye must not land beside it, and few
    photons must leave neither a rim nor a gap after the filter.
    """
    scene = scene_of(
        [plane("floor", 2.0, -1.0), sheet("water", 2.0, 0.0), box("slab", (0.8, 0.1, 0.8), (0.0, -0.5, 0.0))],
        [sun(25.0)],
        Camera.look_at((0.7, 1.4, 1.6), (0.0, -0.6, 0.0), yfov_rad=0.75),
    )
    with open_renderer(scene, 400_000, denoise=False) as renderer:
        frames = [renderer.render() for _ in range(2)]
    truth = np.mean([f.aov["caustic_irradiance"][..., 1] for f in frames], axis=0)
    height = frames[0].aov["position_ws"][..., 1]
    slab, floor = (height > -0.6) & (height < -0.4), height < -0.99
    top = (height > -0.46) & slab
    level = {
        "floor": np.median(truth[floor & (truth > 0)]),
        "slab": np.median(truth[binary_erosion(top, iterations=5)]),
    }
    beside = floor & binary_dilation(slab) & (truth > 0.3 * level["floor"])
    rim = {"floor": beside, "slab": top & ~binary_erosion(top)}
    brightness = {name: float(truth[rim[name]].mean() / level[name]) for name in rim}
    print("one frame of many photons, rim / level:", brightness)
    assert brightness["floor"] == pytest.approx(1.0, abs=0.1)
    assert brightness["slab"] == pytest.approx(1.0, abs=0.15)
    for photons in (1_000, 10_000):
        filtered = render(scene, [0.0] * 16, photons)[-1]
        along = {name: float(filtered[rim[name]].mean() / level[name]) for name in rim}
        print(photons, "photons: mean", filtered.mean() / truth.mean(), "rim / level:", along)
        assert filtered.mean() == pytest.approx(truth.mean(), rel=0.01)
        assert max(along.values()) < 1.15
