"""Photons of lights with a size, and photons that rough surfaces scatter, against closed forms, Walter's formulas,
float64 sampling and reference beams. Errors are held against the noise of as many independent photons.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from glcaustics.bench.scene_export import beam_scene
from glcaustics.optics.fresnel import fresnel_dielectric
from glcaustics.optics.microfacet import ggx_visible_share, rough_reflection, visible_normals
from glcaustics.optics.pixels import bin_points, pixel_edges
from glcaustics.optics.receivers import PlaneGrid
from glcaustics.optics.reference import BeamSettings, reference_map
from glcaustics.optics.refract import refract
from glcaustics.renderer import Frame
from glcaustics.scene.model import Instance, Light, LightKind, Scene
from glcaustics.scene.transform import scaled
from tests.gpu.feature_scenes import GLASS, MIRROR, WATER, box, from_above, plane, scene_of, sheet, sun
from tests.gpu.photon_frames import photon_frames
from tests.gpu.physics_meshes import grid_triangles, make_mesh
from tests.unit.test_optics_spread import disc_through_flat_water, lobe_on_the_floor

pytestmark = pytest.mark.gpu
FloatArray = npt.NDArray[np.float64]


def photons(scene: Scene, bins: int, frames: int = 4, **options: Any) -> tuple[FloatArray, Frame]:
    """Of refracted light alone, unless the options say otherwise; see `photon_frames`."""
    return photon_frames(scene, bins, frames, **{"reflect": False, **options})


def check(image: FloatArray, truth: FloatArray, frame: Frame, truth_paths: float = math.inf) -> None:
    """Energy within 0.5 %; RMSE within 1.2 times that of independent photons of the same number and flux (4 frames, a
    view of 2.4 m), and of the truth's own paths if that was drawn too.
    """
    solve = frame.stats["solves"][0]
    landed = solve["flux_landed"] / (solve["converged"] + solve["bracketed"])  # mean flux of a photon that counts
    each = landed * (0.25 + solve["rays"] / truth_paths) / (2.4 / len(truth)) ** 2
    noise = math.sqrt(float((truth * each).mean()))
    error = math.sqrt(float(((image - truth) ** 2).mean()))
    print(
        f"sum {image.sum() / truth.sum():.5f}, RMSE {error / truth.mean():.4f}, independent {noise / truth.mean():.4f}"
    )
    assert image.sum() == pytest.approx(truth.sum(), rel=0.005)
    assert error < 1.2 * noise  # as against Mitsuba: at roughness 0.9 chance alone is 1.16


def under_water(light: Light, roughness: float = 0.0, half_m: float = 0.5) -> Scene:
    """Flat water over |x|, |z| <= half, the floor 1 m below."""
    water = replace(WATER, roughness=roughness)
    return scene_of([plane("floor", 3.0, -1.0), sheet("water", half_m, 0.0, water)], [light], from_above(1.2, -1.0))


@pytest.mark.parametrize(("theta_deg", "diameter_deg"), [(30.0, 0.0), (30.0, 12.0), (50.0, 60.0)])
def test_a_disc_in_the_sky_through_flat_water(theta_deg: float, diameter_deg: float) -> None:
    """The last one's weights go from 0.3 to 1.7."""
    light = replace(sun(theta_deg), angular_diameter_rad=math.radians(diameter_deg))
    image, frame = photons(under_water(light), 48)
    radius = math.radians(0.5 * diameter_deg)
    truth = disc_through_flat_water(math.radians(theta_deg), radius, pixel_edges(1.2, 48), 1.0)
    check(image, truth, frame)


def test_a_glowing_sphere_through_flat_water() -> None:
    """Against beams from pieces of the sphere's surface."""
    light = Light(LightKind.POINT, intensity=10.0, position_ws=(0.3, 1.2, 0.1), radius_m=0.25)
    scene = under_water(light)
    image, frame = photons(scene, 24)
    settings = BeamSettings(cells=16, max_events=1, reflect=False, split_levels=3)
    beams = reference_map(beam_scene(scene, spread=160), PlaneGrid.floor(1.2, -1.0, 24), settings, check_step=False)
    check(image, beams.mean[..., 1], frame)


def test_a_spot_with_a_radius_keeps_its_flux() -> None:
    """Its cone is that of its centre, so that nothing is lost at the rim."""
    spot = Light(LightKind.SPOT, intensity=10.0, position_ws=(0, 1.2, 0), inner_cone_rad=0.2, outer_cone_rad=0.6)
    sharp, soft = (photons(under_water(replace(spot, radius_m=r)), 24, frames=1, photons=60_000)[0] for r in (0.0, 0.3))
    assert soft.sum() == pytest.approx(sharp.sum(), rel=2e-3)
    assert (soft > 0.01 * soft.max()).sum() > (sharp > 0.01 * sharp.max()).sum()


def test_rough_water_spreads_light_as_walters_formula_says() -> None:
    slanted = math.degrees(math.atan(0.5))
    scene = under_water(sun(slanted), 0.5, 0.2)
    image, frame = photons(scene, 16)
    incoming = np.array([0.5, -1.0, 0.0]) / math.sqrt(1.25)
    truth = lobe_on_the_floor(incoming, 0.2, 1.0, 0.25, 1.2, 16)
    check(image, truth, frame)
    check(photons(scene, 16, fresnel="chance", reflect=True)[0], truth, frame)
    assert frame.stats["ignored"] == []


def test_a_rough_mirror_spreads_light_as_walters_formula_says() -> None:
    """An upright mirror of 0.4 m throws slanted light back on to the floor."""
    roughness = 0.3
    height, half, bins, extent = 1.0, 0.2, 24, 1.2
    corners = np.array([(0.8, height + y, z) for y in (-half, half) for z in (-half, half)])
    mesh = make_mesh("mirror", corners, np.tile([-1.0, 0.0, 0.0], (4, 1)), grid_triangles(1, 1)[:, ::-1], False)
    mirror = Instance("mirror", mesh, replace(MIRROR, roughness=roughness))
    light = sun(45.0)
    image, frame = photons(scene_of([plane("floor", 3.0), mirror], [light], from_above(extent)), bins)
    fine = 4 * bins
    x = ((np.arange(fine) + 0.5) / fine * 2.0 - 1.0) * extent
    floor = np.stack([*np.meshgrid(x, x)], -1)
    truth = np.zeros((fine, fine))
    at = ((np.arange(20) + 0.5) / 20 * 2.0 - 1.0) * half
    for y in at:
        for z in at:
            out = np.stack([floor[..., 0] - 0.8, np.full((fine, fine), -height - y), floor[..., 1] - z], -1)
            distance = np.linalg.norm(out, axis=-1)
            out /= distance[..., None]
            lobe = rough_reflection(np.asarray(light.direction_ws), out, np.array([-1.0, 0, 0]), roughness**2, None)
            truth += lobe * -out[..., 1] / distance**2 * (4.0 * half**2 * math.sin(math.radians(45.0)) / 400.0)
    truth = truth.reshape(bins, 4, bins, 4).mean(axis=(1, 3))
    check(image, truth, frame)


def slabs_by_sampling(
    half: tuple[float, float, float], roughness: float, edges: FloatArray, drops_m: tuple[float, ...]
) -> FloatArray:
    """Irradiance (Z, X) below rough glass slabs in unit light from above, by 1.6 million float64 paths through their
    upper and lower faces; what meets a side is left out. drops_m: below each slab, to what is next.
    """
    ways = [way for drop in drops_m for way in ((1.5, 2.0 * half[1]), (1.0 / 1.5, drop))]
    generator, n = np.random.default_rng(5), 400_000
    total = np.zeros((edges.size - 1,) * 2)
    down, up = np.tile([0.0, -1.0, 0.0], (n, 1)), np.tile([0.0, 1.0, 0.0], (n, 1))
    alpha, axis = np.full(n, roughness**2), np.array([0.0, 0.0, 1.0])
    for _ in range(4):
        x, z = (generator.uniform(-half[k], half[k], n) for k in (0, 2))
        ray, weight = down, np.full(n, 4.0 * half[0] * half[2] / (4 * n))
        for eta, height in ways:
            facet = visible_normals(up, ray, alpha, generator.random((n, 2)), axis)
            cosine = np.clip(-np.einsum("ij,ij->i", ray, facet), 0.0, 1.0)
            ray, tir = refract(ray, facet, 1.0, eta)
            falls = ~tir & (ray[:, 1] < 0.0)
            share = (1.0 - fresnel_dielectric(cosine, 1.0, eta)) * ggx_visible_share(
                np.clip(-ray[:, 1], 1e-9, 1.0), alpha
            )
            weight = np.where(falls, weight * share, 0.0)
            length = height / np.maximum(-ray[:, 1], 1e-9)
            x, z = x + length * ray[:, 0], z + length * ray[:, 2]
            if eta > 1.0:
                weight = np.where((np.abs(x) < half[0]) & (np.abs(z) < half[2]), weight, 0.0)
        total += bin_points(x, z, weight, edges, edges).reshape(total.shape)
    return total / np.outer(np.diff(edges), np.diff(edges))


@pytest.mark.parametrize(("roughness", "drops_m"), [(0.3, (1.5,)), (0.9, (1.5,)), (0.3, (0.006, 1.5))])
def test_rough_glass_scatters_at_every_interface(roughness: float, drops_m: tuple[float, ...]) -> None:
    glass = replace(GLASS, roughness=roughness)
    slabs = [  # so thin and so close that hardly any light meets a side
        box(f"slab {n}", (1.0, 0.006, 1.0), (0.0, 1.503 + 0.012 * n, 0.0), glass) for n in range(len(drops_m))
    ]
    image, frame = photons(scene_of([plane("floor", 3.0), *slabs], [sun()], from_above(1.2)), 24, internal_bounces=0)
    truth = slabs_by_sampling((0.5, 0.003, 0.5), roughness, pixel_edges(1.2, 24), drops_m)
    check(image, truth, frame, 1.6e6)
    lost = frame.stats["solves"][0]["flux_lost_by_cause"]
    print("lost", {cause: flux / frame.stats["solves"][0]["flux"] for cause, flux in lost.items()})


@pytest.mark.parametrize("factor", [0.001, 1000.0])
def test_size_and_roughness_do_not_depend_on_the_scale(factor: float) -> None:
    light = Light(LightKind.POINT, intensity=10.0, position_ws=(0.3, 1.2, 0.1), radius_m=0.25)
    scene = under_water(light, 0.2)
    images = [photons(s, 16, frames=1, photons=60_000)[0] for s in (scene, scaled(scene, factor))]
    np.testing.assert_allclose(images[1], images[0], atol=0.03 * images[0].mean())


def test_neighbours_and_frames_share_the_disc_evenly() -> None:
    """Noise in soft light as a share of that of independent photons: of one frame, and of the mean of eight."""
    light = replace(sun(0.0), angular_diameter_rad=math.radians(20.0))
    for frames, bound in ((1, 0.75), (8, 0.6)):
        image, _ = photons(under_water(light), 48, frames=frames)
        inner = image[20:28, 20:28]  # where all of the disc is seen through the water
        independent = 1.0 / math.sqrt(250_000 * frames * (2.4 / 48) ** 2)  # the water has 1 m^2
        print(frames, "frames:", inner.std() / inner.mean() / independent)
        assert inner.std() / inner.mean() < bound * independent
