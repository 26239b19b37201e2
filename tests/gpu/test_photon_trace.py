"""Photon tracing and its denoiser: energy against the number of photons, chance against split, what the light does not
see, the mean that the filter keeps, the noise that it takes, NaN in its history, and light that moves.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import glcaustics as glc
from glcaustics.bench.photons import same_hits
from glcaustics.bench.scene_export import beam_scene
from glcaustics.caustics import photon_trace
from glcaustics.caustics.branches import read_rgba32f
from glcaustics.caustics.method import IRRADIANCE
from glcaustics.caustics.photon_stats import landing_of
from glcaustics.denoise import svgf
from glcaustics.optics.fresnel import fresnel_dielectric
from glcaustics.optics.receivers import PlaneGrid
from glcaustics.optics.reference import BeamSettings, reference_map
from glcaustics.scene.model import Camera, Light, LightKind, Scene
from glcaustics.scene.water import Wave, WaveSurface, make_water
from tests.gpu.feature_scenes import BACKEND, WATER, box, from_above, lamp, plane, scene_of, sheet, sun
from tests.gpu.physics_scenes import CASES, PhysicsCase

pytestmark = pytest.mark.gpu
FloatArray = npt.NDArray[np.float64]
case_of = cache(lambda name: CASES[name]())


def open_renderer(scene: Scene, size: int = 128, seed: int = 0, stats: bool = True, **options: Any) -> glc.Renderer:
    return glc.Renderer(
        scene,
        size=(size, size),
        method="photon_trace",
        quality="low",
        backend=BACKEND,
        aovs=("caustic_irradiance",),
        specular_view=False,
        seed=seed,
        stats=stats,
        options=options,
    )


def green(frame: glc.renderer.Frame) -> FloatArray:
    return frame.aov["caustic_irradiance"][..., 1].astype(np.float64)


def landed_flux(case: PhysicsCase, image: FloatArray) -> float:
    """Flux over the whole view, W."""
    return float(image.mean() * (2.0 * case.half_extent_m) ** 2)


# -- photons ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("photons", [1_000, 10_000, 100_000, 1_000_000])
def test_any_number_of_photons_carries_the_same_flux(photons: int) -> None:
    """Relative noise of the total is far below that of independent photons, which would be 1 / sqrt(photons)."""
    case = case_of("sine-folds")
    with open_renderer(case.scene, photons=photons, denoise=False) as renderer:
        frame = renderer.render()
    ratio = landed_flux(case, green(frame)) / case.flux_w[1]
    print(f"{photons} photons: flux {ratio:.5f} of the truth")
    assert ratio == pytest.approx(1.0, abs=0.002 + 1.0 / np.sqrt(photons))
    assert frame.stats["solves"][0]["rays"] == pytest.approx(photons, rel=0.1)


def test_every_frame_draws_other_photons_and_every_seed_too() -> None:
    case = case_of("sine-folds")
    images = []
    for seed in (0, 0, 1):
        with open_renderer(case.scene, photons=10_000, denoise=False, seed=seed) as renderer:
            images.append([green(renderer.render()) for _ in range(2)])
    assert np.array_equal(images[0], images[1])
    assert not np.array_equal(images[0][0], images[0][1])
    assert not np.array_equal(images[0][0], images[2][0])


def test_chance_has_the_mean_of_split() -> None:
    """Fresnel's choice by chance: the same expectation from half of the work; mean over 8 frames, 4 x 4 blocks."""
    case = case_of("sphere")
    means = {}
    for fresnel in ("split", "chance"):
        with open_renderer(case.scene, photons=200_000, denoise=False, fresnel=fresnel) as renderer:
            frames = [renderer.render() for _ in range(8)]
        means[fresnel] = np.mean([green(f) for f in frames], axis=0)
        rays = [s["rays"] for s in frames[0].stats["solves"]]
        print(fresnel, "rays", rays, "mean", means[fresnel].mean())
        assert (len(set(rays)) == 1) == (fresnel == "split")
    assert means["chance"].mean() == pytest.approx(means["split"].mean(), rel=0.005)
    blocks = [m.reshape(4, 32, 4, 32).mean(axis=(1, 3)) for m in means.values()]
    np.testing.assert_allclose(blocks[1], blocks[0], atol=0.03 * blocks[0].mean())


def test_photons_start_where_they_show() -> None:
    """A view of a ninth of the pattern: strata that follow the last frames take at least half of the variance off at
    the same number of photons; the mean is that of even strata and so is the flux that starts.
    """
    case = case_of("sine-folds")
    target = (0.4 * case.half_extent_m, -1.0, 0.3 * case.half_extent_m)
    eye = (target[0], 5.0, target[2])
    camera = Camera.look_at(eye, target, orthographic=True, ymag_m=case.half_extent_m / 3.0)
    seen = replace(case.scene, camera=camera)
    with open_renderer(seen, size=64, photons=1 << 20, denoise=False, stats=False) as renderer:
        truth = np.mean([green(renderer.render()) for _ in range(6)], axis=0)
    noise, mean, flux, landed = {}, {}, {}, {}
    for adaptive in (False, True):
        with open_renderer(seen, size=64, photons=30_000, denoise=False, adaptive=adaptive, seed=3) as renderer:
            frames = [renderer.render() for _ in range(24)]
        images = np.array([green(f) for f in frames[8:]])
        noise[adaptive] = float(((images - truth) ** 2).mean())
        mean[adaptive] = float(images.mean() / truth.mean())
        flux[adaptive] = np.mean([f.stats["solves"][0]["flux"] for f in frames[8:]]) / case.flux_w[1]
        landed[adaptive] = frames[-1].stats["solves"][0]["converged"]
    print("variance", noise[True] / noise[False], "mean", mean, "flux", flux, "landed", landed)
    assert landed[True] > 3 * landed[False]
    assert noise[True] < 0.5 * noise[False]
    assert mean[True] == pytest.approx(1.0, abs=0.01) and mean[False] == pytest.approx(1.0, abs=0.01)
    assert flux[True] == pytest.approx(flux[False], rel=0.005)


def lossy_scene() -> Scene:
    """Light that lands, leaves, is hidden from the eye and falls outside of the picture, refracted and reflected."""
    water = sheet("water", 1.0, 0.0)
    others = [
        plane("floor", 1.2, -1.0),
        box("slab", (1.2, 0.1, 2.4), (1.6, 1.45, 0.0)),
        box("post", (0.1, 0.8, 0.1), (0, -0.6, 0)),
    ]
    camera = Camera.look_at((0.6, 0.9, 1.8), (0.2, -0.9, 0.0), yfov_rad=0.6)
    return scene_of([water, *others], [sun(45.0)], camera)


def test_every_photon_and_all_flux_is_counted_by_cause() -> None:
    """Both branches together are what falls on the water, E_perp cos(45 deg) x 4 m^2; in each, the causes add up."""
    with open_renderer(lossy_scene(), photons=200_000, caster_size=1024, denoise=False) as renderer:
        solves = [renderer.render() for _ in range(3)][-1].stats["solves"]
    causes: dict[str, float] = {}
    for s in solves:
        assert s["rays"] == sum(s[k] for k in ("converged", "bracketed", "unseen", "left_the_scene", "failed"))
        parts = [s["flux_landed"], *s["flux_unseen_by_cause"].values(), s["flux_left_the_scene"], s["flux_lost"]]
        assert sum(parts) == pytest.approx(s["flux"], rel=1e-9)
        assert s["flux_lost"] == pytest.approx(sum(s["flux_lost_by_cause"].values()), rel=1e-9)
        assert s["flux_landed"] == pytest.approx(sum(s["flux_landed_by_view"].values()), rel=1e-9)
        for name in ("flux_unseen_by_cause", "flux_landed_by_view", "flux_lost_by_cause"):
            causes |= s[name]
        causes["left"] = causes.get("left", 0.0) + s["flux_left_the_scene"]
    emitted = sum(s["flux"] for s in solves)
    print({k: round(v, 4) for k, v in causes.items()}, "emitted", emitted)
    assert emitted == pytest.approx(4.0 * np.cos(np.radians(45.0)), rel=0.002)
    expected = {"by_light_view", "by_eye_view", "outside_of_the_picture", "hidden_from_the_eye", "left"}
    assert all(causes.get(name, 0.0) > 0.0 for name in expected)


def test_cutoffs_lose_what_they_say() -> None:
    """At 45 degrees water reflects 2.8 %: a cut-off of 4 % (the paper's) drops all of it, and it is counted."""
    options: dict[str, Any] = {"photons": 20_000, "denoise": False}
    with open_renderer(lossy_scene(), luminance_cutoff=0.04, **options) as renderer:
        through, reflected = renderer.render().stats["solves"]
    assert reflected["flux_lost_by_cause"] == {"below_the_luminance_cutoff": pytest.approx(reflected["flux"])}
    assert through["flux_lost_by_cause"].get("below_the_luminance_cutoff", 0.0) == 0.0
    scene = lossy_scene()
    rough = replace(scene.instances[0], material=replace(scene.instances[0].material, roughness=0.4))
    with open_renderer(
        replace(scene, instances=(rough, *scene.instances[1:])), roughness_cutoff=0.3, **options
    ) as renderer:
        solves = renderer.render().stats["solves"]
    assert all(s["flux_lost_by_cause"] == {"rougher_than_the_cutoff": pytest.approx(s["flux"])} for s in solves)


def landings_of(scene: str, **options: Any) -> list[FloatArray]:
    """Where the photons of each kind of path land: (H, W, 4), pixel, 1 / m^2, status."""
    options = {"photons": 30_000, "denoise": False, "adaptive": False, "view_steps": 2048} | options
    with open_renderer(glc.load_scene(scene), size=320, **options) as renderer:
        renderer.render()
        runner = renderer._runner
        assert runner is not None
        traced = renderer._method._traced  # type: ignore[union-attr]
        return [read_rgba32f(runner, landing_of(b)).astype(np.float64) for _, b in traced]


@pytest.mark.parametrize("scene", ["flooded-cornell", "flooded-colonnade"])
def test_hierarchical_march_finds_what_the_pixel_exact_one_finds(scene: str) -> None:
    """In both views: the same pixel within 1 for at least 99.5 % of the photons that land by the pixel-exact march."""
    found, exact = (landings_of(scene, march=march) for march in ("hierarchical", "dda"))
    same = same_hits(found, exact)
    landed = [sum(int((x[..., 3] > 0).sum()) for x in march) for march in (found, exact)]
    print(f"{scene}: {landed} photons, {same}")
    assert same["share"] >= 0.995 and same["marched"] >= 0.99
    assert landed[1] <= landed[0] <= 1.03 * landed[1]  # what the pixel-exact march steps over is found, and little else


def test_a_stage_of_its_own_for_what_is_marched_changes_no_photon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Refracted photons that the first estimate does not settle are traced by a second draw: the same ends."""
    staged = landings_of("flooded-cornell")
    monkeypatch.setattr(photon_trace, "in_stages", lambda setup, branch: False)
    for ours, whole in zip(staged, landings_of("flooded-cornell"), strict=True):
        assert np.array_equal(ours, whole)
    assert any((np.rint(x[..., 3]) == 2).any() for x in staged)


def hidden_ceiling() -> tuple[Scene, float, float]:
    """Flat water, the sun at 45 degrees, and a slab that hangs where the water throws the light to: its underside is
    seen by no light, only by the eye. Scene, and the slab's height and half width.
    """
    scene = scene_of(
        [
            plane("floor", 4.0, -1.0),
            sheet("water", 1.0, 0.0),
            box("slab", (2.4, 0.1, 2.4), (1.6, 1.45, 0.0)),
        ],
        [sun(45.0)],
        from_above(3.0, -1.0),
    )
    return scene, 1.4, 1.2


def test_reflective_caustics_where_the_light_does_not_see() -> None:
    """The underside of a slab, which only the eye's view holds: E = E_perp cos(45 deg) R on all that it shows."""
    scene, height, _ = hidden_ceiling()
    below = Camera.look_at((1.6, 0.2, 0.0), (1.6, height, 0.0), (0.0, 0.0, 1.0), yfov_rad=0.8)
    seen = replace(scene, camera=below)
    with open_renderer(seen, photons=400_000, denoise=False) as renderer:
        frame = renderer.render()
    image = green(frame)
    expected = np.cos(np.radians(45.0)) * float(fresnel_dielectric(np.cos(np.radians(45.0)), 1.0, 1.333))
    reflected = next(s for s in frame.stats["solves"] if "reflect" in s["solve"])
    print("mean", image.mean(), "closed form", expected, reflected["flux_landed_by_view"])
    assert reflected["flux_landed_by_view"].get("by_eye_view", 0.0) > 0.9 * reflected["flux_landed"]
    assert image.mean() == pytest.approx(expected, rel=0.02)
    with glc.Renderer(
        seen, (128, 128), "caustic_map", backend=BACKEND, aovs=("caustic_irradiance",), specular_view=False
    ) as other:
        assert green(other.render()).mean() < 0.1 * expected


@pytest.mark.parametrize("light", [sun(45.0), lamp((-0.9, 0.9, 0.0))], ids=["sun", "lamp"])
def test_no_photon_flies_through_a_thin_strip_that_only_the_light_sees(light: Light) -> None:
    """A strip of 2 mm by 4 cm, out of the picture, stands in the reflected light: its shadow on the slab is dark. To
    the lamp the scene is a cube.
    """
    scene, height, _ = hidden_ceiling()
    strip = box("strip", (0.002, 0.04, 3.0), (0.3, 0.1, 0.0))
    below = Camera.look_at((1.6, 0.2, 0.0), (1.6, height, 0.0), (0.0, 0.0, 1.0), yfov_rad=0.8)
    images = []
    for instances in (scene.instances, (*scene.instances, strip)):
        seen = replace(scene, instances=instances, camera=below, lights=(light,))
        with open_renderer(seen, photons=400_000, denoise=False, map_size=1024) as renderer:
            images.append(green(renderer.render())[32:96].mean(axis=0))
    run = 1.0 if light.kind is LightKind.DIRECTIONAL else 1.2  # metres along x for one of height, at the strip
    off_px = (0.3 + run * (height - 0.1) - 1.6) / ((height - 0.2) * np.tan(0.4)) * 64.0
    middle = round(64.0 + float(np.asarray(below.world_from_camera)[0, 0]) * off_px)
    lit, shadow = (float(image[middle - 1 : middle + 1].mean()) for image in images)
    print(f"irradiance {lit:.5f}, in the strip's shadow {shadow:.5f}")
    assert lit > 0.0
    assert shadow < 0.05 * lit


def test_the_ceiling_of_flooded_cornell_against_beams() -> None:
    """The lamp sees no part of it. Float64 beams over the analytic water; 32 x 32 bins."""
    bins, up = 32, (0.0, 0.0, -1.0)
    scene = glc.load_scene("flooded-cornell")
    camera = Camera.look_at((0.0, 1.2, 0.0), (0.0, 2.0, 0.0), up, yfov_rad=2.0 * np.arctan(1.0 / 0.8))
    right, above = np.asarray(camera.world_from_camera)[:3, :2].T
    corner = np.array([0.0, 2.0, 0.0]) - right + above
    grid = PlaneGrid(tuple(corner), tuple(2.0 * right), tuple(-2.0 * above), (0.0, -1.0, 0.0), bins, bins)
    settings = BeamSettings(cells=160, max_events=1)
    reference = reference_map(beam_scene(scene), grid, settings, check_step=False).mean[..., 1]
    with open_renderer(replace(scene, camera=camera), size=256, photons=1 << 19, caster_size=1024) as renderer:
        frames = [green(renderer.render()) for _ in range(6)]
    image = frames[-1].reshape(bins, 8, bins, 8).mean(axis=(1, 3))
    error = float(np.sqrt(np.mean((image - reference) ** 2)) / reference.mean())
    print(f"ceiling: mean {image.mean() / reference.mean():.4f} of the beams', relative RMSE {error:.4f}")
    assert image.mean() == pytest.approx(reference.mean(), rel=0.02)
    assert error < 0.1


# -- denoiser ---------------------------------------------------------------------------------------------------------


def test_the_filter_keeps_the_mean_and_takes_the_noise() -> None:
    """16 frames of a static view: the mean within 1 %, at least 80 % of the noise's spread over seeds gone."""
    case = case_of("sine-folds")
    noisy, filtered = [], []
    for seed in range(4):
        with open_renderer(case.scene, photons=30_000, denoise=False, seed=seed, stats=False) as renderer:
            noisy.append(green(renderer.render()))
        with open_renderer(case.scene, photons=30_000, seed=seed, stats=False) as renderer:
            first = green(renderer.render())
            filtered.append([green(renderer.render()) for _ in range(15)][-1])
        assert landed_flux(case, first) == pytest.approx(case.flux_w[1], rel=0.01)
    spread = [np.sqrt((np.std(x, axis=0, ddof=1) ** 2).mean()) for x in (noisy, filtered)]
    kept = landed_flux(case, np.mean(filtered, axis=0)) / case.flux_w[1]
    print(f"noise {spread[0]:.4f} -> {spread[1]:.4f} ({spread[1] / spread[0]:.3f}); mean {kept:.5f}")
    assert kept == pytest.approx(1.0, abs=0.01)
    assert spread[1] < 0.2 * spread[0]


@pytest.mark.parametrize("poison", [np.nan, np.inf])
def test_a_poisoned_history_is_gone_within_one_frame(poison: float) -> None:
    case = case_of("sine-folds")
    with open_renderer(case.scene, photons=30_000) as renderer:
        before = [green(renderer.render()) for _ in range(4)][-1]
        with renderer.device.guard_state():
            texture = renderer._runner.texture(svgf.COLOR)  # type: ignore[union-attr]
            values = np.frombuffer(texture.read(), np.float32).reshape(texture.height, texture.width, 4).copy()
            values[20:90, 30:100] = poison
            texture.write(values.tobytes())
        after = green(renderer.render())
    assert np.isfinite(after).all()
    assert after.mean() == pytest.approx(before.mean(), rel=0.01)


def wavy() -> Scene:
    """A wave of half a metre that focuses to bright lines and runs by a quarter of its length in a second."""
    k = 2.0 * np.pi / 0.5
    surface = WaveSurface([Wave(2.0 / k**2, k, 0.0, 0.0, 0.5 * np.pi, 0.0)])
    water = make_water("water", WATER, surface, size_m=(2.0, 2.0), resolution=(384, 16), center_m=(0.0, 0.0, 0.0))
    return scene_of([plane("floor", 2.0, -1.0)], [sun()], from_above(1.6, -1.0), waters=(water,))


def test_a_moving_caustic_is_where_it_is() -> None:
    """After 16 static frames the water moves on by a quarter of a wave. Three frames later the picture is that of a
    filter which never saw the old place, and the bright lines stand within half a pixel of the truth.
    """
    scene, truth = wavy(), []
    for time in (0.0, 1.0):
        with open_renderer(scene, photons=400_000, denoise=False, stats=False) as renderer:
            truth.append(np.mean([green(renderer.render(time)) for _ in range(4)], axis=0))
    with open_renderer(scene, photons=100_000, stats=False) as renderer:
        settled = [green(renderer.render(0.0)) for _ in range(16)][-1]
        moved = [green(renderer.render(1.0)) for _ in range(3)][-1]
    with open_renderer(scene, photons=100_000, stats=False) as renderer:
        fresh = [green(renderer.render(1.0)) for _ in range(3)][-1]
    contrast = truth[1] - truth[0]
    images = (settled, fresh, moved)
    where = [float(((image - truth[0]) * contrast).sum() / (contrast**2).sum()) for image in images]
    print(f"0 = old place, 1 = new: before {where[0]:.3f}, three frames after {where[2]:.3f}, afresh {where[1]:.3f}")
    assert abs(where[0]) < 0.05
    assert where[2] > where[1] - 0.05
    shift = phase_shift_px(moved[32:96], truth[1][32:96])
    print("shift of the pattern, pixels:", shift)
    assert abs(shift) < 0.5
    assert moved.mean() == pytest.approx(truth[1].mean(), rel=0.01)


def phase_shift_px(image: FloatArray, reference: FloatArray) -> float:
    """By how much a pattern stands to the right of another: phase at the reference's strongest frequency."""
    spectra = [np.fft.rfft(x.mean(axis=0) - x.mean()) for x in (image, reference)]
    k = int(np.argmax(np.abs(spectra[1])[4:])) + 4
    return float(-np.angle(spectra[0][k] / spectra[1][k]) / (2.0 * np.pi * k) * image.shape[1])


def test_the_plan_has_the_filter_between_noise_and_frame() -> None:
    case = case_of("sine")
    with open_renderer(case.scene, photons=1_000) as renderer:
        names = [step.name for step in renderer.plan.steps]
        assert {"svgf.reproject", "svgf.accumulate", "svgf.atrous_0"} <= set(names)
        assert svgf.COLOR in renderer.plan.history_slots and IRRADIANCE in renderer.plan.slots
    with open_renderer(case.scene, photons=1_000, denoise=False) as renderer:
        assert not any(step.name.startswith("svgf") for step in renderer.plan.steps)
        assert not renderer.plan.history_slots
