"""Scenes whose caustic has a closed form, built in code, each with its truth on a 128 x 128 grid.

Every view is orthographic and looks straight down, so that image row i, column j is the square
z in [-h, h] row i from -h up, x in [-h, h] column j from -h up, and pixels are equal areas of the receiver.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from glcaustics.optics.closed_form import (
    GlassSphere,
    MirrorCylinder,
    SineWater,
    flat_directional_irradiance,
    flat_directional_shift_m,
    flat_point_entry_radius_m,
    flat_point_flux,
    flat_point_irradiance,
)
from glcaustics.optics.pixels import interval_coverage, pixel_edges
from glcaustics.scene.model import Camera, Instance, Light, LightKind, Material, Mesh, Scene
from tests.gpu.physics_meshes import cylinder_wall, grid_triangles, height_sheet, icosphere, make_mesh

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
BINS = 128
WATER_IOR = 1.333
CLEAR_WATER = Material("water", base_color=(1.0, 1.0, 1.0), roughness=0.0, transmission=1.0, ior=WATER_IOR)
MIRROR_MATERIAL = Material("mirror", base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=0.0)
FLOOR_MATERIAL = Material("floor", base_color=(0.5, 0.5, 0.5))


@dataclass(frozen=True, eq=False)
class PhysicsCase:
    """A scene and its truth.

    `reference`: (128, 128, 3) irradiance, box filtered, W/m^2. `region`: (128, 128) bins that errors are taken over.
    `flux_region`: bins whose flux is summed for the energy; `flux_w`: the flux that must land there, summed over the
    view's bins of the truth or, where the view catches everything, from the entered flux.
    """

    scene: Scene
    half_extent_m: float
    reference: FloatArray
    region: BoolArray
    flux_region: BoolArray
    flux_w: FloatArray
    tolerance: float = 0.05
    extra: dict[str, FloatArray] = field(default_factory=dict)

    @property
    def bin_area_m2(self) -> float:
        return (2.0 * self.half_extent_m / BINS) ** 2


def _floor(half_m: float, y_m: float) -> Instance:
    x, z = np.meshgrid([-half_m, half_m], [-half_m, half_m])
    positions = np.stack((x.ravel(), np.full(4, y_m), z.ravel()), 1)
    return Instance(
        "floor", make_mesh("floor", positions, np.tile([0, 1, 0], (4, 1)), grid_triangles(1, 1), False), FLOOR_MATERIAL
    )


def _scene(name: str, caster: Mesh, material: Material, light: Light, floor_y_m: float, half_extent_m: float) -> Scene:
    """The floor is a fifth larger than the view; the camera stands three view heights above it."""
    camera = Camera.look_at(
        (0.0, floor_y_m + 3.0 * half_extent_m, 0.0), (0.0, floor_y_m, 0.0), orthographic=True, ymag_m=half_extent_m
    )
    instances = (_floor(1.2 * half_extent_m, floor_y_m), Instance(caster.name, caster, material))
    return Scene(name, instances, (light,), camera)


def _slanted(theta_rad: float) -> Light:
    return Light(LightKind.DIRECTIONAL, direction_ws=(math.sin(theta_rad), -math.cos(theta_rad), 0.0))


# Regions


def eroded(mask: BoolArray, bins: int = 1) -> BoolArray:
    """The mask without the bins that have an unset bin (or the image's edge) within `bins` steps."""
    padded = np.pad(mask, bins)
    size = range(2 * bins + 1)
    rows, columns = mask.shape
    return np.asarray(np.all([padded[i : i + rows, j : j + columns] for i in size for j in size], axis=0))


def rgb(image: FloatArray) -> FloatArray:
    return np.repeat(image[..., None], 3, axis=-1)


def bin_centres(half_extent_m: float) -> tuple[FloatArray, FloatArray]:
    """x and z of the bins' centres, each (128, 128)."""
    edges = pixel_edges(half_extent_m, BINS)
    centre = 0.5 * (edges[1:] + edges[:-1])
    x, z = np.meshgrid(centre, centre)
    return x, z


# Cases


def flat_water_directional(theta_deg: float) -> PhysicsCase:
    """Flat water over |x|, |z| <= 1, floor 1 m below, directional light; the lit square moves sideways, whole."""
    theta, half, depth = math.radians(theta_deg), 2.0, 1.0
    sheet = height_sheet("water", 1.0, 64, 64, np.zeros_like, np.zeros_like)
    irradiance = float(flat_directional_irradiance(theta, ior=WATER_IOR))
    shift = float(flat_directional_shift_m(theta, depth, ior=WATER_IOR))
    edges = pixel_edges(half, BINS)
    lit = np.outer(interval_coverage(edges, -1.0, 1.0), interval_coverage(edges, shift - 1.0, shift + 1.0))
    scene = _scene(f"flat-{theta_deg:g}", sheet, CLEAR_WATER, _slanted(theta), -depth, half)
    everything = np.ones((BINS, BINS), bool)
    flux = np.full(3, 4.0 * irradiance)
    return PhysicsCase(scene, half, rgb(irradiance * lit), eroded(lit == 1.0), everything, flux, 0.005)


def flat_water_point() -> PhysicsCase:
    """The same water under a point light of 10 W/sr, 1.5 m above its middle."""
    half, depth, height, intensity = 1.6, 1.0, 1.5, 10.0
    sheet = height_sheet("water", 1.0, 64, 64, np.zeros_like, np.zeros_like)
    light = Light(LightKind.POINT, intensity=intensity, position_ws=(0.0, height, 0.0))
    fine = pixel_edges(half, BINS * 4)
    x, z = np.meshgrid(0.5 * (fine[1:] + fine[:-1]), 0.5 * (fine[1:] + fine[:-1]))
    r = np.hypot(x, z)
    entry = flat_point_entry_radius_m(r, height_m=height, depth_m=depth, ior=WATER_IOR) / r
    lit = (np.abs(x * entry) <= 1.0) & (np.abs(z * entry) <= 1.0)
    value = lit * flat_point_irradiance(r, height_m=height, depth_m=depth, ior=WATER_IOR, intensity=intensity)
    blocks = (BINS, 4, BINS, 4)
    reference, covered = value.reshape(blocks).mean(axis=(1, 3)), lit.reshape(blocks).all(axis=(1, 3))
    flux = np.full(3, flat_point_flux(1.0, 1.0, height_m=height, ior=WATER_IOR, intensity=intensity))
    scene = _scene("flat-point", sheet, CLEAR_WATER, light, -depth, half)
    return PhysicsCase(scene, half, rgb(reference), eroded(covered), np.ones((BINS, BINS), bool), flux, 0.005)


def sine_water(curvature_m: float, theta_deg: float = 0.0) -> PhysicsCase:
    """y = a cos(kx), wavelength 0.5 m, a k^2 = `curvature_m` in 1/m, floor 1 m below; folds from about 4 on."""
    half, depth, k = 1.6, 1.0, 2.0 * math.pi / 0.5
    water = SineWater(curvature_m / k**2, k, depth, WATER_IOR, math.radians(theta_deg))
    sheet = height_sheet("water", 1.0, 768, 64, water.height_m, water.slope)
    edges = pixel_edges(half, BINS)
    reference = water.pixel_irradiance(edges, edges, (-1.0, 1.0))
    rows = interval_coverage(edges, -1.0, 1.0) == 1.0
    lit = (reference > 0.0) & rows[:, None]
    folded = np.outer(rows, np.minimum(water.preimage_count(edges[:-1]), water.preimage_count(edges[1:])) >= 3)
    scene = _scene(f"sine-{curvature_m:g}-{theta_deg:g}", sheet, CLEAR_WATER, _slanted(water.theta_rad), -depth, half)
    flux = np.full(3, 2.0 * water.flux_per_m())
    extra = {"folded": folded.astype(np.float64), "largest": rgb(_largest_branch(water, edges, rows))}
    return PhysicsCase(scene, half, rgb(reference), eroded(lit), np.ones((BINS, BINS), bool), flux, extra=extra)


def _largest_branch(water: SineWater, edges: FloatArray, rows: BoolArray) -> FloatArray:
    """Irradiance (Z, X) of the strongest preimage alone: what a map shows that overwrites instead of adding."""
    u = np.linspace(*water.x_range_m, 1 << 17)
    fan = water.fan()
    landing = np.asarray(fan.landing_m(u))
    flux = fan.beam_flux(u)
    sheet = np.concatenate(([0], np.cumsum(np.diff(np.sign(np.diff(landing))) != 0)))
    column = np.digitize(0.5 * (landing[1:] + landing[:-1]), edges) - 1
    branches = np.zeros((int(sheet.max()) + 1, edges.size - 1))
    np.add.at(branches, (sheet, np.clip(column, 0, edges.size - 2)), flux)
    return np.outer(rows, branches.max(axis=0) / np.diff(edges))


def glass_sphere(centre_height_m: float, sigma_a: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> PhysicsCase:
    """Sphere of radius 1, ior 1.5, its centre at `centre_height_m`, light straight down (paraxial focus: 1.5 m below).

    Errors and energy are taken over the bins that lie within r <= 1: there only light lands that passed both
    interfaces. What the outside throws back lands at r >= 1, and is not in this truth. Where the axis is a caustic
    (nearer than the paraxial focus) the RMSE leaves out r < 0.1: a few bins there, up to 200 times as bright as the
    mean, would own it. They count in the energy and in the encircled flux.
    """
    half = 1.5
    sphere = icosphere("sphere", 1.0, 80)
    lifted = make_mesh(
        "sphere", sphere.positions_m + np.array([0, centre_height_m, 0]), sphere.normals, sphere.triangles, True
    )
    clear = max(sigma_a) == 0.0
    glass = Material(
        "glass",
        base_color=(1.0, 1.0, 1.0),
        roughness=0.0,
        transmission=1.0,
        ior=1.5,
        attenuation_color=(1.0, 1.0, 1.0) if clear else tuple(np.exp(-np.asarray(sigma_a)).tolist()),
        attenuation_distance_m=math.inf if clear else 1.0,
    )
    edges = pixel_edges(half, BINS)
    images = {
        s: GlassSphere(1.0, centre_height_m, sigma_a_per_m=s).pixel_irradiance(edges, edges, 8) for s in set(sigma_a)
    }
    reference = np.stack([images[s] for s in sigma_a], axis=-1)
    x, z = bin_centres(half)
    within = np.hypot(np.abs(x) + half / BINS, np.abs(z) + half / BINS) <= 1.0
    scene = _scene(f"sphere-{centre_height_m:g}", lifted, glass, _slanted(0.0), 0.0, half)
    flux = reference[within].sum(axis=0) * (2.0 * half / BINS) ** 2
    region = within & (np.hypot(x, z) > 0.1) if centre_height_m < 1.5 else within
    return PhysicsCase(scene, half, reference, region, within, flux)


def mirror_nephroid() -> PhysicsCase:
    """Mirror of radius 1 over 120 degrees of arc, light at 45 degrees, s_max = 0.9: no ray meets the wall twice."""
    half = 1.2
    mirror = MirrorCylinder(1.0, math.radians(45.0), 0.9)
    wall = cylinder_wall("wall", 1.0, mirror.height_m, mirror.azimuth_max_rad, 1024, 48)
    edges = pixel_edges(half, BINS)
    reference = mirror.pixel_irradiance(edges, edges)
    light = Light(
        LightKind.DIRECTIONAL, direction_ws=(math.cos(mirror.elevation_rad), -math.sin(mirror.elevation_rad), 0.0)
    )
    scene = _scene("nephroid", wall, MIRROR_MATERIAL, light, 0.0, half)
    flux = np.full(3, mirror.flux())
    return PhysicsCase(scene, half, rgb(reference), eroded(reference > 0.0), np.ones((BINS, BINS), bool), flux)


CASES: dict[str, Callable[[], PhysicsCase]] = {
    "flat-0": lambda: flat_water_directional(0.0),
    "flat-30": lambda: flat_water_directional(30.0),
    "flat-60": lambda: flat_water_directional(60.0),
    "flat-point": flat_water_point,
    "sine": lambda: sine_water(2.0),
    "sine-slanted": lambda: sine_water(2.0, 30.0),
    "sine-folds": lambda: sine_water(10.0),
    "sine-folds-slanted": lambda: sine_water(10.0, 30.0),
    "sphere": lambda: glass_sphere(2.0),
    "sphere-absorbing": lambda: glass_sphere(2.0, (0.1, 0.4, 1.2)),
    "sphere-cusp": lambda: glass_sphere(1.2),
    "nephroid": mirror_nephroid,
}
