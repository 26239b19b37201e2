"""The truth for lights with a size and rough surfaces: sampling against Walter's formulas, discs and spheres against
closed forms.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from glcaustics.errors import UsageError
from glcaustics.optics.beam_scene import BeamLight, BeamMesh, BeamScene, SurfaceKind, SurfaceOptics
from glcaustics.optics.beam_spread import LambertPoint, RoughOptics, SizedBeamLight, spread
from glcaustics.optics.beam_trace import BeamSettings
from glcaustics.optics.closed_form import flat_directional_irradiance, flat_directional_shift_m
from glcaustics.optics.fresnel import fresnel_dielectric
from glcaustics.optics.microfacet import ggx_visible_share, rough_reflection, rough_transmission, visible_normals
from glcaustics.optics.pixels import interval_coverage, pixel_edges
from glcaustics.optics.receivers import PlaneGrid
from glcaustics.optics.reference import reference_map
from glcaustics.optics.refract import reflect, refract

FloatArray = npt.NDArray[np.float64]
WATER = SurfaceOptics(SurfaceKind.DIELECTRIC, (1.333,) * 3)
UP = np.array([0.0, 1.0, 0.0])


def square(y_m: float, half_m: float, optics: SurfaceOptics) -> BeamMesh:
    h = half_m
    corners = np.array([(-h, y_m, -h), (h, y_m, -h), (-h, y_m, h), (h, y_m, h)], np.float64)
    return BeamMesh(corners, np.tile(UP, (4, 1)), np.array([[0, 2, 1], [1, 2, 3]]), optics)


def pool(optics: SurfaceOptics, light: BeamLight) -> BeamScene:
    """Flat water over |x|, |z| <= 0.5, floor 1 m below."""
    return BeamScene((square(-1.0, 4.0, SurfaceOptics(SurfaceKind.DIFFUSE)), square(0.0, 0.5, optics)), (light,))


def moments(direction: FloatArray, weight: FloatArray) -> FloatArray:
    """Total, mean and mean squares of a distribution of directions, (7,)."""
    total = weight.sum()
    first, second = (weight[:, None] * direction).sum(axis=0), (weight[:, None] * direction**2).sum(axis=0)
    return np.concatenate([[total], first, second])


@pytest.mark.parametrize("roughness", [0.3, 0.6])
@pytest.mark.parametrize("kind", ["reflection", "transmission", "leaving glass"])
@pytest.mark.parametrize("theta_deg", [0.0, 60.0])
def test_visible_normals_scatter_light_as_walters_formulas_say(roughness: float, kind: str, theta_deg: float) -> None:
    """Sampled facets, weighted with Fresnel and G1, against the integral of f cos over a fine grid of directions."""
    alpha, theta = roughness**2, math.radians(theta_deg) * (0.5 if kind == "leaving glass" else 1.0)
    ior = 1.0 / 1.5 if kind == "leaving glass" else 1.5
    incoming = np.array([math.sin(theta), -math.cos(theta), 0.0])
    u = (np.arange(500) + 0.5) / 500
    samples = np.stack(np.meshgrid(u[::2], u[::2]), -1).reshape(-1, 2)
    facets = visible_normals(
        np.tile(UP, (len(samples), 1)),
        np.tile(incoming, (len(samples), 1)),
        np.full(len(samples), alpha),
        samples,
        np.array([0.0, 0.0, 1.0]),
    )
    lit = np.broadcast_to(incoming, facets.shape)
    cosine = np.clip(-np.einsum("ij,ij->i", lit, facets), 0.0, 1.0)
    reflected = fresnel_dielectric(cosine, 1.0, ior)
    if kind == "reflection":
        out, share, side = reflect(lit, facets), reflected, 1.0
    else:
        out, tir = refract(lit, facets, 1.0, ior)
        share, side = np.where(tir, 0.0, 1.0 - reflected), -1.0
    above = out[:, 1] * side > 0.0
    weight = np.where(above, share * ggx_visible_share(np.clip(out[:, 1] * side, 1e-9, 1.0), alpha), 0.0)
    sampled = moments(out, weight / len(samples))

    polar, angle = np.meshgrid(u, 2.0 * np.pi * u)
    z = 1.0 - polar**2  # over the hemisphere, denser around the normal: solid angle 2 polar
    ring = np.sqrt(1.0 - z**2)
    grid = np.stack([ring * np.cos(angle), side * z, ring * np.sin(angle)], -1).reshape(-1, 3)
    formula = rough_reflection if kind == "reflection" else rough_transmission
    exact = moments(grid, formula(incoming, grid, UP, alpha, ior) * polar.ravel() * (4.0 * np.pi / len(grid)))
    assert sampled == pytest.approx(exact, abs=2e-3 * exact[0]), (sampled, exact)


def disc_through_flat_water(
    theta: float, radius: float, edges: FloatArray, depth_m: float, half_m: float = 0.5
) -> FloatArray:
    """Irradiance (Z, X) of the floor under |x|, |z| <= half_m of flat water in light of an even disc: the closed form
    of directional light, integrated over the disc.
    """
    total = np.zeros((edges.size - 1,) * 2)
    rings, spokes = 12, 24
    for i in range(rings):
        for j in range(spokes):
            s, phi = math.sin(radius) * math.sqrt((i + 0.5) / rings), 2.0 * math.pi * (j + 0.5) / spokes
            c = math.sqrt(1.0 - s * s)
            ax, az = s * math.cos(phi), s * math.sin(phi)  # across the axis: in the plane of incidence, and along z
            x, y, z = c * math.sin(theta) + ax * math.cos(theta), c * math.cos(theta) - ax * math.sin(theta), az
            tilt = math.acos(y)
            value = float(flat_directional_irradiance(tilt, ior=1.333)) / c  # per unit of irradiance across the axis
            shift = float(flat_directional_shift_m(tilt, depth_m, ior=1.333)) / max(math.hypot(x, z), 1e-12)
            lit_z = interval_coverage(edges, -half_m + shift * z, half_m + shift * z)
            total += value * np.outer(lit_z, interval_coverage(edges, -half_m + shift * x, half_m + shift * x))
    return total / (rings * spokes)


def test_a_disc_through_flat_water_is_the_closed_form_convolved() -> None:
    theta, radius = math.radians(30.0), math.radians(6.0)
    light = SizedBeamLight((1.0,) * 3, (math.sin(theta), -math.cos(theta), 0.0), angular_radius_rad=radius, points=48)
    settings = BeamSettings(cells=16, split_levels=3, max_events=1, reflect=False)
    found = reference_map(pool(WATER, light), PlaneGrid.floor(1.2, -1.0, 48), settings, check_step=False)
    exact = disc_through_flat_water(theta, radius, pixel_edges(1.2, 48), 1.0)
    error = found.mean[..., 1] - exact
    assert found.mean[..., 1].sum() == pytest.approx(exact.sum(), rel=4e-3)
    assert np.sqrt((error**2).mean()) < 0.03 * exact.mean()


def test_a_sphere_sends_what_its_centre_would() -> None:
    """The flux of a sphere through a window that all of it sees is that of a point of the same intensity."""
    fluxes = []
    for radius_m in (0.0, 0.3):
        light = SizedBeamLight((10.0,) * 3, position_ws=(0.2, 1.5, 0.0), radius_m=radius_m, points=2048)
        scene = pool(WATER, light)
        points = scene.specular_points_ws()
        share = 0.0
        for part, _ in spread(light, scene, points, 1, 3):
            origin = np.asarray(part.position_ws)
            x = (np.arange(16) + 0.5) / 16 - 0.5
            window = np.stack([*np.meshgrid(x, x)], -1).reshape(-1, 2)
            to = np.stack([window[:, 0], np.zeros(256), window[:, 1]], 1) - origin
            distance = np.linalg.norm(to, axis=1)
            to /= distance[:, None]
            share += part.intensity_rgb[0] * float((part.cone(to) * -to[:, 1] / distance**2).mean())
        fluxes.append(share)
    assert fluxes[1] == pytest.approx(fluxes[0], rel=2e-3)


def test_parts_of_lights() -> None:
    scene = pool(WATER, BeamLight((1.0,) * 3))
    points = scene.specular_points_ws()
    plain = BeamLight((1.0, 2.0, 3.0), (0.2, -1.0, 0.1))
    assert list(spread(plain, scene, points, 2, 0)) == [(plain, None)]
    lamp = SizedBeamLight((1.0,) * 3, position_ws=(0.0, 2.0, 0.0), radius_m=0.1, points=64)
    parts = [part for part, _ in spread(lamp, scene, points, 1, 0)]
    assert 24 <= len(parts) <= 44 and all(isinstance(p, LambertPoint) for p in parts), "about half of it looks down"
    rough = pool(RoughOptics(**vars(WATER), roughness=0.2, facets=16), plain)
    passes = list(spread(plain, rough, points, 2, 0))
    assert len(passes) == 16 and sum(p.intensity_rgb[2] for p, _ in passes) == pytest.approx(3.0)
    assert all(f is not None and f.samples.shape == (2, 2) for _, f in passes)
    with pytest.raises(UsageError, match="spot light with a radius"):
        list(spread(replace(lamp, outer_cone_rad=0.5), scene, points, 1, 0))


def test_rough_beams_land_as_walters_formula_says() -> None:
    """A window of rough water: the lobe, smeared by the window's size, on the floor."""
    optics = RoughOptics(**vars(WATER), roughness=0.5, facets=64)
    h = 0.2
    scene = BeamScene(
        (square(-1.0, 4.0, SurfaceOptics(SurfaceKind.DIFFUSE)), square(0.0, h, optics)),
        (BeamLight((1.0,) * 3, (0.5, -1.0, 0.0)),),
    )
    settings = BeamSettings(cells=16, split_levels=3, max_events=1, reflect=False)
    found = reference_map(scene, PlaneGrid.floor(0.8, -1.0, 8), settings, check_step=False).mean[..., 1]
    exact = lobe_on_the_floor(np.array([0.5, -1.0, 0.0]) / math.sqrt(1.25), h, 1.0, 0.25, 0.8, 8)
    assert found.sum() == pytest.approx(exact.sum(), rel=0.01)
    assert np.sqrt(((found - exact) ** 2).mean()) < 0.05 * exact.mean()


def lobe_on_the_floor(
    incoming: FloatArray, half_m: float, depth_m: float, alpha: float, extent_m: float, bins: int, ior: float = 1.333
) -> FloatArray:
    """Irradiance (bins, bins) of the floor by a window |x|, |z| <= half of rough water in unit directional light: the
    lobe summed over the window, which holds a whole number of steps of 1/12 bin.
    """
    step = 2.0 * extent_m / (12 * bins)
    wide, fine = round(2.0 * half_m / step), 12 * bins
    assert math.isclose(wide * step, 2.0 * half_m)
    x = (np.arange(fine + wide - 1) - 0.5 * (fine + wide - 2)) * step  # floor point minus window point
    out = np.stack(np.broadcast_arrays(x[None, :], -depth_m, x[:, None]), -1)
    distance = np.linalg.norm(out, axis=-1)
    out = out / distance[..., None]
    lobe = rough_transmission(incoming, out, UP, alpha, ior) * -out[..., 1] / distance**2
    total = np.pad(lobe.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    total = total[wide:, wide:] - total[:-wide, wide:] - total[wide:, :-wide] + total[:-wide, :-wide]
    return np.asarray(total.reshape(bins, 12, bins, 12).mean(axis=(1, 3)) * (step**2 * -float(incoming[1])))
