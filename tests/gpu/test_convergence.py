"""The convergence instruments of eye rays and light rays, on scenes whose answer is known."""

from __future__ import annotations

import json

import numpy as np
import pytest

import glcaustics as glc
from glcaustics.bench.convergence import pooled, seeded_cameras
from glcaustics.bench.eye_rays import PUBLISHED, eye_convergence, eye_study, solids_truth
from glcaustics.bench.eye_truth import eye_truth
from glcaustics.bench.light_rays import LightConvergence, light_convergence, light_study, seeded_lights
from glcaustics.bench.light_solver import LightSolver
from glcaustics.errors import UsageError
from glcaustics.gpu import create_device
from glcaustics.scene.model import Camera, Instance, Scene
from tests.gpu.feature_scenes import BACKEND, WATER, box, plane, scene_of, sheet, sun, translation
from tests.gpu.physics_meshes import height_sheet

ABOVE = Camera.look_at((0.6, 2.2, 1.4), (0.0, -0.8, 0.0), yfov_rad=0.7)


def over_a_floor(water: Instance, *more: Instance) -> Scene:
    return scene_of([plane("floor", 4.0, -1.0), water, *more], [sun(30.0)], ABOVE)


def waves(amplitude_m: float) -> Instance:
    """y = a sin 5x over |x|, |z| < 1.5."""
    made = height_sheet(
        "water",
        1.5,
        96,
        8,
        lambda x: amplitude_m * np.sin(5.0 * x),
        lambda x: 5.0 * amplitude_m * np.cos(5.0 * x),
    )
    return Instance("water", made, WATER, translation(0.0, 0.0, 0.0))


def test_pooling_sums_things_and_weighs_shares() -> None:
    rows = [{"pixels": 10, "share": 0.5, "iterations": (0, 1), "within": (0.0, 1.0), "truth": "a"}]
    rows.append({"pixels": 30, "share": 0.9, "iterations": (0, 1), "within": (1.0, 1.0), "truth": "a"})
    found = pooled(rows, [1.0, 3.0])
    assert found["pixels"] == 40 and found["iterations"] == (0, 1) and found["truth"] == "a"
    assert found["share"] == pytest.approx(0.8) and found["within"] == pytest.approx((0.75, 1.0))


def test_eye_rays_on_a_plane_are_solved_by_one_step() -> None:
    [found] = eye_convergence(over_a_floor(sheet("water", 4.0, 0.0)), [ABOVE], (160, 90), (0, 1, 2, 3), backend=BACKEND)
    assert found.pixels == 160 * 90 and found.resolvable > 0.7
    assert found.within_1px[0] < 0.1, "the start is the pixel itself, which shows another point of the floor"
    assert min(found.within_1px[1:]) == 1.0
    assert found.reported[1] < 0.1 and min(found.reported[2:]) == 1.0, "the second look-up confirms the first"
    assert max(found.wrong) == 0.0 and found.cascade == 1.0 and found.hierarchical == 1.0


def test_eye_rays_behind_an_edge_are_not_solved_by_newton() -> None:
    """A fence in the water hides parts of the floor that rays reach: shares fall, and the instrument sees it."""
    posts = [box(f"post {k}", (0.03, 0.8, 0.03), (0.1 * k - 0.6, -0.6, 0.0)) for k in range(13)]
    [plain] = eye_convergence(over_a_floor(waves(0.05)), [ABOVE], (160, 90), (1, 2, 4), backend=BACKEND)
    [found] = eye_convergence(over_a_floor(waves(0.05), *posts), [ABOVE], (160, 90), (1, 2, 4), backend=BACKEND)
    assert plain.within_1px[2] > 0.999 > found.within_1px[2] > 0.9
    assert found.within_1px[0] < found.within_1px[1] < found.within_1px[2]


def test_eye_rays_agree_with_float64_ray_casting() -> None:
    """A floor and a stone under waves: Newton and the DDA meet what the triangles have there; the start does not."""
    scene = over_a_floor(waves(0.05), box("stone", (0.5, 0.3, 0.5), (0.2, -0.85, 0.1)))
    [found] = eye_truth(scene, [ABOVE], (160, 90), (0, 1, 4), BACKEND)
    assert 0.7 < found.resolvable < 0.999, "what the stone hides from the eye is not resolvable"
    assert found.within_1px[0] < 0.2 < found.within_1px[1] < found.within_1px[2]
    assert found.within_1px[2] > 0.98 and found.dda > 0.98


def test_a_way_through_glass_agrees_with_float64_ray_casting() -> None:
    """In and out of a ball: the start is the exit's own pixel, one step on a floor is exact."""
    scene = glc.load_scene("glass-sphere")
    cameras = seeded_cameras(scene, 2)
    for found in solids_truth(scene, cameras, (192, 108), (0, 1, 4), backend=BACKEND):
        assert found.pixels > 500 and found.resolvable > 0.5
        assert found.within_1px[0] < 0.3 and min(found.within_1px[1:]) > 0.9 and found.dda > 0.9


def test_cameras_show_what_refracts() -> None:
    """Water from all around, glass from its front: each seeded view of the statue has it in the picture."""
    scene = glc.load_scene("glass-statue")
    with glc.Renderer(scene, (64, 36), "none", backend=BACKEND, aovs=("solve_status",)) as renderer:
        for camera in seeded_cameras(scene, 6):
            renderer.tune(camera=camera)
            assert (renderer.render().aov["solve_status"] > 0.0).mean() > 0.05


def light_rays(scene: Scene, iterations: tuple[int, ...] = (0, 1, 2, 4)) -> LightConvergence:
    device = create_device(BACKEND)
    try:
        solver = LightSolver(device, scene, scene.lights[0], 0.0, "displaced_mesh", "draft")
        found = light_convergence(solver, solver.branches[0], iterations)
        solver.release()
        return found
    finally:
        device.close()


def test_light_rays_through_flat_water_need_no_step() -> None:
    """The receivers' view looks along the refracted light, so the start is where it lands."""
    found = light_rays(over_a_floor(sheet("water", 1.5, 0.0)))
    assert found.truth == "float64 ray casting" and found.resolvable > 0.98
    assert min(found.within_1texel) > 0.999 and max(found.wrong) == 0.0 and found.marched > 0.999


def test_light_rays_through_waves_converge() -> None:
    found = light_rays(over_a_floor(waves(0.05), box("stone", (0.5, 0.3, 0.5), (0.2, -0.85, 0.1))))
    assert found.within_1texel[0] < 0.6, "the start is where flat water would send the light"
    assert min(found.within_1texel[1:]) > 0.99, "floor and stone are planes: one step on them is exact"
    assert max(found.wrong) < 0.005 and found.marched > 0.99


def test_studies_are_ready_for_json() -> None:
    eye = eye_study(["peer-pool"], 2, (128, 72), (0, 1, 3), backend=BACKEND)
    light = light_study(["peer-pool"], 2, (0, 1, 3), quality="draft", backend=BACKEND)
    assert json.loads(json.dumps(eye))["scenes"][0]["scene"] == "peer-pool" and eye["published"] == PUBLISHED
    assert json.loads(json.dumps(light))["scenes"][0]["branch"] == "interface"
    assert eye["scenes"][0]["by_ray_casting"]["pooled"]["within_1px"][2] > 0.98
    for study, name in ((eye, "within_1px"), (light, "within_1texel")):
        [row] = study["scenes"]
        assert len(row["views"]) == 2
        shares = row["pooled"][name]
        assert shares[0] < shares[1] <= shares[2] and shares[2] > 0.98
        low, high = (f(view[name][1] for view in row["views"]) for f in (min, max))
        assert low <= shares[1] <= high


def test_seeded_lights_are_the_same_again_and_some_graze() -> None:
    scene = glc.load_scene("pool")
    first, again = seeded_lights(scene, 4), seeded_lights(scene, 4)
    assert first == again and first[0] == (scene.lights[0], 0.0)
    assert all(np.linalg.norm(light.direction_ws) == pytest.approx(1.0) for light, _ in first[1:])
    assert np.degrees(np.arcsin(-first[2][0].direction_ws[1])) < 26.0


def test_what_cannot_be_tuned_or_measured_says_so() -> None:
    with glc.Renderer(over_a_floor(waves(0.05)), (32, 32), "none", backend=BACKEND) as renderer:
        with pytest.raises(UsageError, match="caster_size cannot be tuned"):
            renderer.tune(caster_size=8)
        with pytest.raises(UsageError, match="cannot be tuned to -1"):
            renderer.tune(refraction_iterations=-1)
    with pytest.raises(UsageError, match="no refraction"):
        eye_convergence(scene_of([plane("floor", 1.0)], [sun()], ABOVE), [ABOVE], (32, 32), (1,), backend=BACKEND)
    with pytest.raises(UsageError, match="no light solve"):
        light_study(["pool"], 1, method="photon_trace", backend=BACKEND)
