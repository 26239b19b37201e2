"""Reference beams against every closed form, energy, and rays that share no code with them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from glcaustics.bench.scene_export import beam_scene, renderer_events
from glcaustics.errors import UsageError
from glcaustics.metrics import relative_rmse
from glcaustics.optics.area_raster import AreaRaster
from glcaustics.optics.beam_scene import BeamLight, BeamMesh, BeamScene, BeamWater, SurfaceKind, SurfaceOptics
from glcaustics.optics.beams import beam_irradiance, peer_pool_field
from glcaustics.optics.closed_form import flat_directional_irradiance
from glcaustics.optics.eye_paths import eye_hits
from glcaustics.optics.light_mesh import light_patches
from glcaustics.optics.pixels import pixel_edges
from glcaustics.optics.receivers import PlaneGrid, PlaneReceiver
from glcaustics.optics.reference import BeamSettings, reference_map, reference_points, trace_beams
from glcaustics.scene.load import load_scene
from tests.gpu.physics_scenes import BINS, CASES

WATER = SurfaceOptics(SurfaceKind.DIELECTRIC, (1.333,) * 3)


def floor_mesh(y_m: float, half_m: float) -> BeamMesh:
    corners = np.array([[x, y_m, z] for z in (-half_m, half_m) for x in (-half_m, half_m)])
    triangles = np.array([[0, 2, 1], [1, 2, 3]])
    return BeamMesh(corners, np.tile([0.0, 1.0, 0.0], (4, 1)), triangles, SurfaceOptics(SurfaceKind.DIFFUSE))


def pool(strength: float, light: BeamLight) -> BeamScene:
    water = BeamWater(peer_pool_field(strength), (0, 0, 0), (2, 2), 0.1, WATER)
    return BeamScene((floor_mesh(-1.0, 2.0),), (light,), (water,))


SLANTED = BeamLight((1.0, 1.0, 1.0), (0.2, -1.0, 0.1))


# Exact area coverage


def test_raster_gives_the_exact_overlap() -> None:
    raster = AreaRaster(4, 3, 1)
    raster.add_triangles(np.array([[[0.5, 0.5], [2.5, 0.5], [0.5, 2.5]]]), np.array([[2.0]]))  # density 1
    expected = [[0.25, 0.5, 0.125, 0], [0.5, 0.5, 0, 0], [0.125, 0, 0, 0]]
    np.testing.assert_allclose(raster.flux()[..., 0], expected, atol=1e-14)


def test_raster_crops_and_ignores_winding() -> None:
    triangles = np.random.default_rng(2).uniform(-3, 12, (300, 3, 2))
    flux = np.ones((300, 2)) * [1, 3]
    small, large, turned = AreaRaster(9, 7, 2), AreaRaster(40, 40, 2), AreaRaster(9, 7, 2)
    small.add_triangles(triangles, flux)
    large.add_triangles(triangles + 10, flux)
    turned.add_triangles(triangles[:, ::-1], flux)
    np.testing.assert_allclose(small.flux(), large.flux()[10:17, 10:19], atol=1e-11)
    np.testing.assert_allclose(small.flux(), turned.flux(), atol=1e-11)
    np.testing.assert_allclose(large.flux().sum(axis=(0, 1)), [300, 900], rtol=1e-12)


def test_raster_keeps_the_flux_of_collapsed_triangles() -> None:
    raster = AreaRaster(8, 8, 1)
    line = np.array([[[1.2, 1.2], [2.2, 2.2], [3.2, 3.2]], [[5.5, 5.5]] * 3])
    raster.add_triangles(line, np.array([[3.0], [1.0]]))
    assert raster.flux().sum() == pytest.approx(4.0)
    assert raster.flux()[5, 5, 0] == pytest.approx(1.0)


# Light mesh


def test_light_mesh_carries_the_exact_flux() -> None:
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    bounds = np.stack([cube.min(axis=0), cube.max(axis=0)])
    inside = BeamLight((1, 1, 1), position_ws=(0.1, 0.2, 0.0))
    patches = light_patches(inside, cube, bounds, 5)
    total = 0.0
    for patch in patches:
        u = np.linspace(-1, 1, 9)
        uv = np.stack(np.meshgrid(u, u), axis=-1)
        lower = np.stack([uv[:-1, :-1], uv[:-1, 1:], uv[1:, :-1]], axis=2).reshape(-1, 3, 2)
        upper = np.stack([uv[1:, 1:], uv[1:, :-1], uv[:-1, 1:]], axis=2).reshape(-1, 3, 2)
        total += patch.flux(lower).sum() + patch.flux(upper).sum()
    assert len(patches) == 6
    assert total == pytest.approx(4 * math.pi, rel=1e-12)
    far = light_patches(BeamLight((1, 1, 1), position_ws=(0, 9, 0)), cube, bounds, 5)
    assert len(far) == 1


# Closed forms


FAST_CELLS = {"flat-30": 64, "flat-point": 160, "sine-slanted": 320, "sine-folds": 320, "sphere": 288, "nephroid": 192}


@pytest.mark.parametrize("name", FAST_CELLS)
def test_beams_meet_the_closed_forms(name: str) -> None:
    check_closed_form(name, FAST_CELLS[name])


@pytest.mark.long
@pytest.mark.parametrize("name", CASES)
def test_fine_beams_meet_the_closed_forms(name: str) -> None:
    check_closed_form(name, 1024 if "folds" in name else 640)


def check_closed_form(name: str, cells: int) -> None:
    """Relative RMSE under 0.5 % and flux under 0.05 %, folds and the cusp of the sphere included."""
    case = CASES[name]()
    floor_y = float(case.scene.instances[0].positions_ws()[0, 1])
    receiver = PlaneReceiver(PlaneGrid.floor(case.half_extent_m, floor_y, BINS))
    settings = BeamSettings(cells=cells, max_events=renderer_events(case.scene), reflect=False)
    balance = trace_beams(beam_scene(case.scene), receiver, settings)
    image, truth = receiver.irradiance(), case.reference
    error = np.sqrt(np.mean((image - truth)[case.region] ** 2)) / truth[case.region].mean()
    assert error < 0.005
    flux = image[case.flux_region].sum(axis=0) * case.bin_area_m2
    np.testing.assert_allclose(flux, case.flux_w, rtol=5e-4)
    assert (balance.landed <= balance.emitted).all() and (balance.caught <= balance.landed * (1 + 1e-12)).all()


def test_peer_pool_agrees_with_random_beams() -> None:
    """Twice 2.4 M jittered rays by another code, whose noise two halves take off."""
    edges = pixel_edges(1.0, 32)
    slow = [
        beam_irradiance(
            peer_pool_field(1.0),
            light_direction_ws=(0.2, -1.0, 0.1),
            depth_m=1.0,
            x_range_m=(-1, 1),
            z_range_m=(-1, 1),
            x_edges_m=edges,
            z_edges_m=edges,
            beams_per_side=1536,
            seed=seed,
        ).irradiance
        for seed in (1, 2)
    ]
    fast = reference_map(pool(1.0, SLANTED), PlaneGrid.floor(1.0, -1.0, 32), BeamSettings(cells=448, max_events=1))
    assert relative_rmse(slow[0], fast.mean[..., 0], other_half=slow[1]) < 1.5e-3
    assert fast.mean.mean() == pytest.approx(slow[0].mean(), rel=2e-4)
    assert fast.step is not None and fast.step < 5e-3


@pytest.mark.long
def test_peer_pool_reaches_its_promise() -> None:
    """Relative error 0.002 at 512^2, by independent halves and by N/4 against N."""
    result = reference_map(pool(1.0, SLANTED), PlaneGrid.floor(1.0, -1.0, 512), BeamSettings(cells=1536, max_events=1))
    print(result.report())
    assert result.noise < 0.001
    assert result.step is not None and result.step < 0.003


def test_error_falls_with_more_beams() -> None:
    grid = PlaneGrid.floor(1.0, -1.0, 64)
    noises = [
        reference_map(pool(1.0, SLANTED), grid, BeamSettings(cells=c, max_events=1), check_step=False).noise
        for c in (40, 80, 160)
    ]
    assert noises[0] > 2 * noises[1] > 4 * noises[2]


# Paths


def glass_slab(thickness_m: float, optics: SurfaceOptics) -> BeamMesh:
    p = np.array([[x, y, z] for y in (0.0, thickness_m) for z in (-1, 1) for x in (-1, 1)], float)
    quads = [((0, 1, 3, 2), (0, -1, 0)), ((4, 6, 7, 5), (0, 1, 0)), ((0, 2, 6, 4), (-1, 0, 0))]
    quads += [((1, 5, 7, 3), (1, 0, 0))]
    quads += [((0, 4, 5, 1), (0, 0, -1)), ((2, 3, 7, 6), (0, 0, 1))]
    corners = np.concatenate([p[list(q)] for q, _ in quads])
    normals = np.concatenate([np.tile(np.asarray(n, float), (4, 1)) for _, n in quads])
    triangles = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(6)])
    return BeamMesh(corners, normals, triangles, optics)


@pytest.mark.parametrize(("events", "factor"), [(1, 0.0), (2, 1.0), (4, 2.0), (6, 3.0)])
def test_slab_bounces_inside_as_often_as_asked(events: int, factor: float) -> None:
    """Light straight down: T^2 e^-sd, then with each two events more, R^2 e^-2sd of it again."""
    optics = SurfaceOptics(SurfaceKind.DIELECTRIC, (2.0, 2.0, 2.0), (0.0, 1.0, 3.0))
    scene = BeamScene((floor_mesh(-0.5, 2.0), glass_slab(0.2, optics)), (BeamLight((1.0, 2.0, 1.0)),))
    settings = BeamSettings(cells=24, max_events=events)
    result = reference_map(scene, PlaneGrid.floor(0.5, -0.5, 8), settings, check_step=False)
    reflected, absorbed = 1.0 / 9.0, np.exp(-np.array([0.0, 1.0, 3.0]) * 0.2)
    first = (1 - reflected) ** 2 * absorbed * [1, 2, 1]
    again = (reflected * absorbed) ** 2
    expected = first * sum(again**k for k in range(int(factor)))
    np.testing.assert_allclose(result.mean, np.broadcast_to(expected, (8, 8, 3)), rtol=1e-6, atol=1e-12)


def test_total_internal_reflection_is_followed() -> None:
    """A 45 degree prism turns light by 90 degrees on to a wall: in, total reflection, out: three events."""
    p = np.array([[0, 0, -1], [0, 0, 1], [1, 0, -1], [1, 0, 1], [0, 1, -1], [0, 1, 1]], float)
    faces = [((0, 2, 3, 1), (0, -1, 0)), ((0, 1, 5, 4), (-1, 0, 0)), ((2, 4, 5, 3), (1, 1, 0))]
    faces += [((0, 4, 2), (0, 0, -1)), ((1, 3, 5), (0, 0, 1))]
    corners = np.concatenate([p[list(f)] for f, _ in faces])
    normals = np.concatenate([np.tile(np.asarray(n, float) / np.linalg.norm(n), (len(f), 1)) for f, n in faces])
    triangles, start = [], 0
    for f, _ in faces:
        triangles += [[start, start + k, start + k + 1] for k in range(1, len(f) - 1)]
        start += len(f)
    glass = BeamMesh(corners, normals, np.array(triangles), SurfaceOptics(SurfaceKind.DIELECTRIC))
    wall = np.array([[-0.5, y, z] for y in (-1, 2) for z in (-2, 2)], float)
    triangles_2 = np.array([[0, 2, 1], [1, 2, 3]])
    receiver = BeamMesh(wall, np.tile([1.0, 0, 0], (4, 1)), triangles_2, SurfaceOptics(SurfaceKind.DIFFUSE))
    light = BeamLight((1.0, 1.0, 1.0), (0.0, 1.0, 0.0))  # from below through the lower face
    grid = PlaneGrid((-0.5, 0.2, -0.5), (0, 0, 1.0), (0, 0.6, 0), (1, 0, 0), 8, 8)
    scene = BeamScene((receiver, glass), (light,))
    images = [reference_map(scene, grid, BeamSettings(cells=24, max_events=n), check_step=False).mean for n in (2, 3)]
    assert images[0].max() == 0.0
    np.testing.assert_allclose(images[1], 0.96**2, rtol=1e-6)


def test_dispersion_sends_the_channels_apart() -> None:
    optics = SurfaceOptics(SurfaceKind.DIELECTRIC, (1.2, 1.4, 1.6))
    water = BeamWater(peer_pool_field(0.0), (0, 0, 0), (1, 1), 0.1, optics)
    light = BeamLight((1, 1, 1), (1.0, -1.0, 0.0))
    scene = BeamScene((floor_mesh(-1.0, 2.0),), (light,), (water,))
    grid = PlaneGrid.floor(2.0, -1.0, 64)
    image = reference_map(scene, grid, BeamSettings(cells=64, max_events=1), check_step=False).mean
    x = grid.points_ws()[..., 0]
    for channel, ior in enumerate((1.2, 1.4, 1.6)):
        centre = (image[..., channel] * x).sum() / image[..., channel].sum()
        assert centre == pytest.approx(math.tan(math.asin(math.sin(math.pi / 4) / ior)), abs=1e-3)
        assert image[32, 32 + round(centre * 16), channel] == pytest.approx(
            float(flat_directional_irradiance(math.pi / 4, ior=ior)), rel=1e-6
        )


def test_spot_cone_and_occluders_count() -> None:
    spot = BeamLight((8.0, 8.0, 8.0), (0, -1, 0), (0, 2, 0), 0.1, 0.3)
    scene = pool(0.0, spot)
    grid = PlaneGrid.floor(2.0, -1.0, 64)
    lit = reference_map(scene, grid, BeamSettings(cells=96, max_events=1, reflect=False), check_step=False)
    r = np.hypot(grid.points_ws()[..., 0], grid.points_ws()[..., 2])
    assert lit.mean[r > 2 * math.tan(0.3) + math.tan(0.3 / 1.3) + 0.1].max() < 1e-12
    assert lit.mean[32, 32, 0] == pytest.approx(8 * 0.9796 / (2 + 1 / 1.333) ** 2, rel=5e-3)
    shade = floor_mesh(1.0, 0.5)
    shaded = BeamScene((*scene.meshes, shade), scene.lights, scene.waters)
    dark = reference_map(shaded, grid, BeamSettings(cells=48, max_events=1, reflect=False), check_step=False)
    assert dark.mean[r < 0.4].max() < 1e-12


# Points, camera, cache


def test_points_agree_with_the_map() -> None:
    scene, settings = pool(0.5, SLANTED), BeamSettings(cells=256, max_events=1)
    grid = PlaneGrid.floor(0.7, -1.0, 24)
    points = grid.points_ws().reshape(-1, 3)
    image = reference_map(scene, PlaneGrid.floor(0.7, -1.0, 24 * 9), settings, check_step=False).mean[4::9, 4::9]
    single = reference_points(scene, points, np.tile([0, 1.0, 0], (len(points), 1)), 0.02, settings, check_step=False)
    np.testing.assert_allclose(single.mean.reshape(24, 24, 3), image, rtol=0.05)  # a point sees one facet of the beams
    assert relative_rmse(image, single.mean.reshape(24, 24, 3)) < 0.01
    assert single.mean.mean() == pytest.approx(image.mean(), rel=1e-3)


def test_eye_rays_refract_to_the_floor() -> None:
    scene = beam_scene(load_scene("peer-pool"))
    flat = BeamScene(scene.meshes, scene.lights, (BeamWater(peer_pool_field(0.0), (0, 0, 0), (2, 2), 0.1, WATER),))
    origin = np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.5, 1.0, 0.0], [0.0, 1.0, 0.0]])
    direction = np.array([[0, -1.0, 0], [0.6, -0.8, 0], [0, -1.0, 0], [0, 1.0, 0]])
    hits = eye_hits(flat, origin, direction)
    assert hits.found.tolist() == [True, True, True, False]
    sine = 0.6 / 1.333
    np.testing.assert_allclose(hits.point_ws[1], [0.75 + sine / math.sqrt(1 - sine**2), -1, 0], atol=1e-9)
    assert hits.throughput[2].tolist() == [1, 1, 1]
    assert hits.throughput[0, 0] == pytest.approx(1 - (0.333 / 2.333) ** 2)


def test_a_scene_without_specular_surfaces_is_refused() -> None:
    with pytest.raises(UsageError, match="nothing in the scene is specular"):
        reference_map(BeamScene((floor_mesh(0, 1),), (SLANTED,)), PlaneGrid.floor(1, 0, 4), BeamSettings(cells=4))
