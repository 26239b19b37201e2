"""Point and spot lights in every view: cube maps for casters, receivers and shadows, cone fall-off, several lights."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import glcaustics as glc
from glcaustics.optics.closed_form import flat_point_irradiance
from glcaustics.optics.fresnel import transmittance_dielectric
from glcaustics.scene.model import Camera, Light, LightKind, Scene
from tests.gpu.feature_scenes import (
    BACKEND,
    WATER,
    box,
    from_above,
    lamp,
    plane,
    relative_rmse,
    scene_of,
    sheet,
    shoot,
    sun,
)

pytestmark = pytest.mark.gpu
NO_REFLECTION = {"reflect": False}
HEIGHT, DEPTH, HALF = 0.5, 0.5, 2.0
INTENSITY = 10.0


def faces_of(scene: Scene, **arguments: object) -> tuple[int, int, int]:
    """Most faces of the caster's, the receivers' and the shadow's views of the first light, after the fit."""
    with glc.Renderer(scene, size=(16, 16), method="caustic_map", backend=BACKEND, **arguments) as renderer:
        _ = renderer.plan
        light = renderer._setup.lights[0]
        assert light.caster and light.receivers and light.shadow
        return light.caster.faces, max(r.view.faces for r in light.receivers.values()), light.shadow.faces


def room(half_m: float = HALF, camera: Camera | None = None) -> Scene:
    """A lamp between a water below and a mirrored twin above: everything round it. Floor at -0.5, ceiling at 1.5."""
    above = sheet("water above", half_m, 0.0)
    flip = np.diag([1.0, -1.0, -1.0, 1.0])  # turned upside down about x
    flip[1, 3] = 2.0 * HEIGHT
    above = replace(above, world_from_object=flip)
    camera = camera or Camera.look_at((0.0, 1.45, 0.0), (0.0, 0.0, 0.0), yfov_rad=math.radians(110.0))
    instances = [
        plane("floor", 4.0, -DEPTH),
        plane("ceiling", 4.0, 2 * HEIGHT + DEPTH, up=False),
        sheet("water", half_m, 0.0),
        above,
    ]
    return scene_of(instances, [lamp((0.0, HEIGHT, 0.0), INTENSITY)], camera)


def truth_at(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Irradiance on the floor below the flat water, and where the sheet's rim does not matter."""
    radius = np.hypot(position[..., 0], position[..., 2])
    value = flat_point_irradiance(radius, height_m=HEIGHT, depth_m=DEPTH, ior=1.333, intensity=INTENSITY)
    return value, (np.abs(position[..., 1] + DEPTH) < 1e-3) & (radius < 1.6)


def test_a_lamp_among_casters_takes_cube_maps() -> None:
    assert faces_of(room()) == (6, 6, 6)


@pytest.mark.parametrize("quality", ["medium", "high"])
def test_cube_map_views_give_the_closed_form_without_seams(quality: str) -> None:
    """Flat water far past the borders of the downward face (|x| = 0.5 at the water): a smooth field, no seam in it."""
    frame = shoot(room(), (256, 256), quality=quality, options=NO_REFLECTION)
    position = frame.aov["position_ws"].astype(np.float64)
    truth, region = truth_at(position)
    ratio = frame.aov["caustic_irradiance"][..., 1].astype(np.float64) / truth
    # where the floor's light view and the caster's view change face: |x| or |z| equals the distance below the lamp
    side = np.maximum(np.abs(position[..., 0]), np.abs(position[..., 2]))
    seam = region & (np.abs(side - 1.0) < 0.05)  # receiver: lamp is 1 m above the floor
    inner, outer = region & (side < 0.9), region & (side > 1.1)
    for name, part in (("inner", inner), ("seam", seam), ("outer", outer)):
        values = ratio[part]
        print(
            f"{quality} {name}: E/E_ref mean {values.mean():.4f}, std {values.std():.4f}, "
            f"{values.min():.3f} to {values.max():.3f}"
        )
    assert seam.sum() > 300 and outer.sum() > 1000
    for part in (inner, seam, outer):
        assert ratio[part].mean() == pytest.approx(1.0, abs=0.01)
        assert np.percentile(np.abs(ratio[part] - 1.0), 99) < 0.04
    assert np.abs(ratio[seam] - 1.0).max() < 0.06


def test_cube_and_single_frustum_agree_where_both_apply() -> None:
    """The same lamp, water and floor; a second sheet high above turns the frusta into cubes."""
    small = scene_of(
        [plane("floor", 1.6, -DEPTH), sheet("water", 0.7, 0.0)],
        [lamp((0.0, HEIGHT, 0.0), INTENSITY)],
        from_above(1.2, -DEPTH),
    )
    assert faces_of(small)[0] == 1
    other = room(0.7)
    cubed = replace(other, instances=(*small.instances, *other.instances[1:2], other.instances[3]))
    camera = Camera.look_at((0.0, 1.45, 0.0), (0.0, -DEPTH, 0.0), yfov_rad=math.radians(55.0))
    one = shoot(replace(small, camera=camera), (192, 192), options=NO_REFLECTION, quality="high")
    six = shoot(replace(cubed, camera=camera), (192, 192), options=NO_REFLECTION, quality="high")
    assert faces_of(replace(cubed, camera=camera))[0] == 6
    a, b = (f.aov["caustic_irradiance"][..., 1].astype(np.float64) for f in (one, six))
    position = one.aov["position_ws"].astype(np.float64)
    inside = (np.maximum(np.abs(position[..., 0]), np.abs(position[..., 2])) < 0.95) & (a > 0)
    print("cube against frustum: RMSE", relative_rmse(b[inside], a[inside]), "flux", b.sum() / a.sum())
    assert relative_rmse(b[inside], a[inside]) < 0.015
    assert b.sum() == pytest.approx(a.sum(), rel=0.01)


def test_energy_through_cube_maps() -> None:
    """Flux on floor and ceiling from the statistics: what enters both sheets lands."""
    frame = shoot(room(), (32, 32), options=NO_REFLECTION)
    (solve,) = frame.stats["solves"]
    t, w = np.polynomial.legendre.leggauss(128)
    x, z = np.meshgrid(HALF * t, HALF * t)
    d2 = x**2 + z**2 + HEIGHT**2
    cos_i = HEIGHT / np.sqrt(d2)
    entered = INTENSITY * cos_i / d2 * transmittance_dielectric(cos_i, 1.0, 1.333)
    one_sheet = float((np.outer(w, w) * entered).sum() * HALF**2)
    print(solve["flux_landed"], 2 * one_sheet, solve["flux_lost_by_cause"])
    assert solve["flux_landed"] == pytest.approx(2.0 * one_sheet, rel=0.01)
    assert solve["flux_lost_share"] < 0.005


def spot(inner_deg: float, outer_deg: float, position: tuple[float, float, float] = (0.0, 1.5, 0.0)) -> Light:
    return Light(
        LightKind.SPOT,
        intensity=INTENSITY,
        position_ws=position,
        direction_ws=(0.0, -1.0, 0.0),
        inner_cone_rad=math.radians(inner_deg),
        outer_cone_rad=math.radians(outer_deg),
    )


@pytest.mark.parametrize("cone", [(0.0, 20.0), (15.0, 25.0), (20.0, 20.5)])
def test_spot_light_through_water(cone: tuple[float, float]) -> None:
    """Flux: the integral over the cone of I f(angle)^2 T 2 pi sin; outside of the cone's image: darkness."""
    light = spot(*cone)
    pixels, half = 160, 1.2
    scene = scene_of([plane("floor", 2.0, -1.0), sheet("water", 1.5, 0.0)], [light], from_above(half, -1.0))
    frame = shoot(scene, (pixels, pixels), options=NO_REFLECTION)
    value = frame.aov["caustic_irradiance"][..., 1].astype(np.float64)
    outer, inner = math.cos(light.outer_cone_rad), math.cos(light.inner_cone_rad)

    def fall_off(cosine: np.ndarray) -> np.ndarray:
        return np.clip((cosine - outer) / max(inner - outer, 1e-3), 0.0, 1.0) ** 2

    cosines, weights = np.polynomial.legendre.leggauss(300)
    cosines = 0.5 * (1 - outer) * (cosines + 1) + outer
    integrand = INTENSITY * fall_off(cosines) * transmittance_dielectric(cosines, 1.0, 1.333) * 2 * math.pi
    flux = float((weights * integrand).sum() * 0.5 * (1 - outer))
    measured = value.sum() * (2 * half / pixels) ** 2
    print(f"spot {cone}: flux {measured:.5f} of {flux:.5f}")
    assert measured == pytest.approx(flux, rel=0.01)
    assert frame.stats["solves"][0]["flux"] == pytest.approx(flux, rel=0.01)
    # what lies outside of the cone is dark: rim of the lit disc, by Snell
    position = frame.aov["position_ws"].astype(np.float64)
    radius = np.hypot(position[..., 0], position[..., 2])
    sin_t = math.sin(light.outer_cone_rad) / 1.333
    rim = 1.5 * math.tan(light.outer_cone_rad) + sin_t / math.sqrt(1 - sin_t**2)
    assert value[radius > rim + 0.05].max() < 0.01 * value.max()


def test_several_lights_add_up() -> None:
    lights = [sun(20.0, 2.0), lamp((0.5, 1.2, 0.3), 3.0), spot(5.0, 30.0, (-0.4, 1.5, 0.2)), sun(-35.0, 1.0)]
    instances = [plane("floor", 2.0, -1.0), sheet("water", 1.0, 0.0), box("box", (0.3, 0.3, 0.3), (0.4, -0.85, -0.4))]
    scenes = [scene_of(instances, chosen, from_above(1.5, -1.0)) for chosen in (lights, *([light] for light in lights))]
    together, *single = [shoot(s, (96, 96), quality="low") for s in scenes]
    for name in ("caustic_irradiance", "direct_irradiance"):
        total = sum(f.aov[name].astype(np.float64) for f in single)
        np.testing.assert_allclose(together.aov[name], total, rtol=1e-4, atol=1e-5 * total.max())
    assert len(together.stats["solves"]) == sum(len(f.stats["solves"]) for f in single)


def test_coloured_light_colours_its_caustic() -> None:
    light = replace(sun(10.0, 2.0), color=(1.0, 0.5, 0.0))
    scene = scene_of([plane("floor", 2.0, -1.0), sheet("water", 1.0, 0.0, WATER)], [light], from_above(0.5, -1.0))
    value = shoot(scene, (32, 32), quality="low").aov["caustic_irradiance"]
    np.testing.assert_allclose(value[..., 1], 0.5 * value[..., 0], rtol=1e-5)
    assert value[..., 0].min() > 0.0 and not value[..., 2].any()
