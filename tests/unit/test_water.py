"""Water surfaces: normals against finite differences, dispersion, Gerstner waves, height maps, the grid."""

from __future__ import annotations

import math

import numpy as np
import pytest

from glcaustics.errors import ResourceLimitError, SceneError
from glcaustics.scene.mesh_tools import face_normals
from glcaustics.scene.model import Material, OpticalKind, Scene
from glcaustics.scene.water import (
    STANDARD_GRAVITY,
    HeightMapSurface,
    WaterGrid,
    Wave,
    WaveSurface,
    dispersion_omega,
    make_water,
    surface_of,
)

SINES = [Wave.from_wavelength(0.03, 0.7, 20.0, 0.3), Wave.from_wavelength(0.02, 0.45, 100.0, 1.7, depth_m=0.2)]
GERSTNER = [
    Wave.from_wavelength(0.03, 0.9, 20.0, 0.3, steepness=0.9),
    Wave.from_wavelength(0.02, 0.6, 110.0, 1.7, steepness=0.6),
    Wave.from_wavelength(0.01, 0.4, -60.0, 2.9),
]


def points_in(size: float = 1.5, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    x, z = np.random.default_rng(7).uniform(-size, size, (2, count))
    return x, z


def finite_difference_normal(surface: WaveSurface, x: np.ndarray, z: np.ndarray, t: float) -> np.ndarray:
    h = 1e-5
    along_x = (surface.points(x + h, z, t)[0] - surface.points(x - h, z, t)[0]) / (2 * h)
    along_z = (surface.points(x, z + h, t)[0] - surface.points(x, z - h, t)[0]) / (2 * h)
    normal = np.cross(along_z, along_x)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


@pytest.mark.parametrize("waves", [SINES, GERSTNER], ids=["sines", "gerstner"])
@pytest.mark.parametrize("t", [0.0, 1.37])
def test_normals_are_the_derivative_of_the_positions(waves: list[Wave], t: float) -> None:
    surface = WaveSurface(waves)
    x, z = points_in()
    normal = surface.points(x, z, t)[1]
    assert np.abs(normal - finite_difference_normal(surface, x, z, t)).max() < 1e-8
    assert np.abs(np.linalg.norm(normal, axis=-1) - 1.0).max() < 1e-14
    assert normal[:, 1].min() > 0.0


def test_a_single_sine_is_what_the_convention_says() -> None:
    wave = Wave(amplitude_m=0.05, kx=3.0, kz=-4.0, phase=0.6, omega=2.0)
    x, z = points_in()
    theta = 3.0 * x - 4.0 * z - 2.0 * 0.8 + 0.6
    surface = WaveSurface([wave])
    assert wave.k == pytest.approx(5.0)
    np.testing.assert_allclose(surface.height(x, z, 0.8), 0.05 * np.sin(theta), rtol=0, atol=1e-15)
    slope_x, slope_z = surface.gradient(x, z, 0.8)
    np.testing.assert_allclose(slope_x, 0.05 * 3.0 * np.cos(theta), rtol=0, atol=1e-14)
    np.testing.assert_allclose(slope_z, -0.05 * 4.0 * np.cos(theta), rtol=0, atol=1e-14)


@pytest.mark.parametrize("waves", [SINES, GERSTNER], ids=["sines", "gerstner"])
def test_height_and_gradient_agree_with_the_points(waves: list[Wave]) -> None:
    surface = WaveSurface(waves)
    position, normal = surface.points(*points_in(), 0.4)
    x, z = position[:, 0], position[:, 2]
    np.testing.assert_allclose(surface.height(x, z, 0.4), position[:, 1], rtol=0, atol=1e-11)
    slope_x, slope_z = surface.gradient(x, z, 0.4)
    np.testing.assert_allclose(slope_x, -normal[:, 0] / normal[:, 1], rtol=0, atol=1e-9)
    h = 1e-5
    numeric = (surface.height(x + h, z, 0.4) - surface.height(x - h, z, 0.4)) / (2 * h)
    np.testing.assert_allclose(slope_x, numeric, rtol=0, atol=1e-7)
    numeric = (surface.height(x, z + h, 0.4) - surface.height(x, z - h, 0.4)) / (2 * h)
    np.testing.assert_allclose(slope_z, numeric, rtol=0, atol=1e-7)


def test_gerstner_crests_are_sharper_than_troughs() -> None:
    surface = WaveSurface([Wave.from_wavelength(0.05, 1.0, 0.0, steepness=1.0)])
    x = np.linspace(-2.0, 2.0, 4001)
    heights = surface.height(x, np.zeros_like(x))
    assert heights.max() == pytest.approx(0.05, abs=1e-6) and heights.min() == pytest.approx(-0.05, abs=1e-6)
    assert np.mean(heights > 0.0) < 0.46  # a sine spends half of its length above the mean


def test_gerstner_waves_that_cross_themselves_are_refused() -> None:
    k = 2.0 * math.pi
    WaveSurface([Wave(0.999 / k, k, 0.0, steepness=1.0)])
    with pytest.raises(SceneError, match="cross themselves.*lower steepness"):
        WaveSurface([Wave(1.001 / k, k, 0.0, steepness=1.0)])


def test_gravity_waves_move_along_their_direction_at_their_phase_speed() -> None:
    k = 2.0 * math.pi / 0.7
    assert dispersion_omega(k) == pytest.approx(math.sqrt(STANDARD_GRAVITY * k), rel=1e-15)
    assert dispersion_omega(k, 0.05) == pytest.approx(math.sqrt(STANDARD_GRAVITY * k * math.tanh(0.05 * k)), rel=1e-15)
    wave = Wave.from_wavelength(0.03, 0.7, 20.0, 0.3)
    surface, t = WaveSurface([wave]), 0.21
    way = wave.omega / wave.k * t
    x, z = points_in()
    moved = surface.height(x + way * math.cos(math.radians(20)), z + way * math.sin(math.radians(20)), t)
    np.testing.assert_allclose(moved, surface.height(x, z, 0.0), rtol=0, atol=1e-14)


def test_height_map_is_exact_at_the_samples_and_for_bilinear_functions() -> None:
    rows, columns, size = 17, 33, (4.0, 2.0)
    x, z = np.meshgrid(np.linspace(-2, 2, columns), np.linspace(-1, 1, rows))
    heights = 0.3 * x - 0.2 * z + 0.1 * x * z
    surface = HeightMapSurface(heights, size)
    px, pz = np.random.default_rng(3).uniform(-1, 1, (2, 200)) * [[2.0], [1.0]]
    np.testing.assert_allclose(surface.height(px, pz), 0.3 * px - 0.2 * pz + 0.1 * px * pz, rtol=0, atol=1e-14)
    slope_x, slope_z = surface.gradient(px, pz)
    np.testing.assert_allclose(slope_x, 0.3 + 0.1 * pz, rtol=0, atol=1e-13)
    np.testing.assert_allclose(slope_z, -0.2 + 0.1 * px, rtol=0, atol=1e-13)


def test_height_map_slopes_are_central_differences() -> None:
    heights = np.random.default_rng(5).normal(size=(9, 12))
    surface = HeightMapSurface(heights, (11.0, 16.0))  # steps of 1 m and 2 m
    x, z = np.meshgrid(np.arange(12) - 5.5, 2.0 * np.arange(9) - 8.0)
    slope_x, slope_z = surface.gradient(x, z)
    np.testing.assert_allclose(surface.height(x, z), heights, rtol=0, atol=1e-14)
    np.testing.assert_allclose(slope_x[:, 1:-1], (heights[:, 2:] - heights[:, :-2]) / 2.0, rtol=0, atol=1e-13)
    np.testing.assert_allclose(slope_z[1:-1], (heights[2:] - heights[:-2]) / 4.0, rtol=0, atol=1e-13)


def test_height_map_converges_to_the_analytic_normals() -> None:
    wave = WaveSurface([Wave.from_wavelength(0.03, 0.7, 20.0, 0.3)])
    errors = []
    for n in (65, 129):
        x, z = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
        surface = HeightMapSurface(wave.height(x, z), (2.0, 2.0))
        errors.append(np.abs(surface.points(x, z)[1] - wave.points(x, z, 0.0)[1]).max())
    assert errors[1] < 0.3 * errors[0]  # second order
    with pytest.raises(SceneError, match="3 x 3"):
        HeightMapSurface(np.zeros((2, 9)), (1.0, 1.0))


def test_grid_is_rectangular_faces_up_and_covers_its_rectangle() -> None:
    grid = WaterGrid("sea", WaveSurface(SINES), (3.0, 1.0), (31, 12))
    mesh = grid(0.5)
    assert mesh.positions_m.shape == (31 * 12, 3) and mesh.triangles.shape == (2 * 30 * 11, 3)
    assert mesh.positions_m.dtype == mesh.normals.dtype == mesh.uv.dtype == np.float32
    assert mesh.triangles.dtype == np.uint32 and not mesh.watertight
    np.testing.assert_allclose(mesh.positions_m.min(0)[[0, 2]], [-1.5, -0.5])
    np.testing.assert_allclose(mesh.positions_m.max(0)[[0, 2]], [1.5, 0.5])
    faces = face_normals(mesh.positions_m, mesh.triangles)
    assert faces[:, 1].min() > 0.0 and mesh.normals[:, 1].min() > 0.0
    corners = mesh.positions_m.astype(np.float64)[mesh.triangles][:, :, [0, 2]]
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    assert area.sum() == pytest.approx(3.0, rel=1e-6)
    x, y, z = mesh.positions_m.astype(np.float64).T
    np.testing.assert_allclose(grid.surface.height(x, z, 0.5), y, rtol=0, atol=1e-6)


def test_moving_water_shares_its_topology_and_still_water_its_mesh() -> None:
    moving = WaterGrid("sea", WaveSurface(SINES), (1.0, 1.0), (9, 9))
    first, second = moving(0.0), moving(0.3)
    assert first.triangles is second.triangles and first.uv is second.uv
    assert np.abs(first.positions_m - second.positions_m).max() > 1e-3
    still = WaterGrid("pond", WaveSurface([]), (1.0, 1.0), (9, 9))
    assert still(0.0) is still(5.0)
    np.testing.assert_array_equal(still(0.0).normals, np.tile(np.float32([0, 1, 0]), (81, 1)))


def test_make_water_places_a_single_interface_in_the_world() -> None:
    material = Material("water", transmission=1.0, ior=1.333, roughness=0.0)
    body = make_water(
        "sea", material, WaveSurface(SINES), size_m=(2.0, 1.0), resolution=(8, 5), center_m=(3.0, -0.5, 1.0)
    )
    assert body.animated and surface_of(body).animated
    scene = Scene("s", (), (), camera=None, waters=(body,))  # type: ignore[arg-type]
    (instance,) = scene.instances_at(0.0)
    assert instance.optical_kind is OpticalKind.INTERFACE
    np.testing.assert_allclose(instance.positions_ws().min(0)[[0, 2]], [2.0, 0.5], atol=1e-6)
    assert abs(instance.positions_ws()[:, 1].mean() + 0.5) < 0.06


@pytest.mark.parametrize("resolution", [(1, 9), (9, 1), (5000, 2), (4000, 4000)])
def test_grids_out_of_range_are_refused(resolution: tuple[int, int]) -> None:
    with pytest.raises((SceneError, ResourceLimitError), match="water 'sea'"):
        WaterGrid("sea", WaveSurface([]), (1.0, 1.0), resolution)
