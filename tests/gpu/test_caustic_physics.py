"""Every caustics method against the closed forms, at quality high, seen straight from above.

Definitions, used throughout: both images are box filtered to 128 x 128. Relative RMSE = sqrt(mean((E - E_ref)^2)) /
mean(E_ref), both means over the case's region and the three channels. The region is the lit part of the receiver
without the outermost ring of bins (for the sphere: all bins within one radius of the axis). Energy: the flux summed
over the whole view (sphere: over that disc) against the entered flux times transmittance. `-s` shows the numbers.

Noisy methods run with their `unbiased_options`. Each states, as `noise_share`, the standard deviation of its noise as a
share of that of independent photons, whose variance in a bin is E x (flux of a photon) / (area of the bin). Tolerances
widen by that noise: RMSE in quadrature, single bins by five standard deviations. Energy, encircled flux, folds do not.

A method is left out of a case only where it declares by `why_not` that such a scene does not need it.
"""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

import glcaustics as glc
from glcaustics.caustics.registry import METHODS
from glcaustics.optics.pixels import box_filter
from glcaustics.renderer import Frame
from glcaustics.scene.model import Scene
from glcaustics.scene.transform import scaled
from tests.gpu.feature_scenes import BACKEND
from tests.gpu.physics_scenes import BINS, CASES, PhysicsCase, bin_centres

pytestmark = pytest.mark.gpu

FloatArray = npt.NDArray[np.float64]
SIZE = (512, 512)
NAMES = sorted(name for name in METHODS if name != "none")
ENERGY_TOLERANCE = 0.005
ROUNDING_SHARE = 0.025  # of independent photons' noise in a pixel that rounding may make, by moving some over borders
FLAT = [name for name in CASES if name.startswith("flat")]
SHAPED = [name for name in CASES if not name.startswith("flat")]
FOLDED = [name for name in CASES if name.startswith("sine-folds")]

case_of = cache(lambda name: CASES[name]())


def refuse_if_it_does_not_apply(scene: Scene, method: str) -> None:
    """Skip where the method itself says that it has nothing to do in such a scene."""
    because = METHODS[method].why_not(scene)
    if because:
        pytest.skip(f"{method} leaves out {scene.name}: {because}")


def render(scene: Scene, method: str) -> Frame:
    with glc.Renderer(
        scene,
        size=SIZE,
        method=method,
        quality="high",
        backend=BACKEND,
        aovs=("caustic_irradiance",),
        specular_view=False,
        options=METHODS[method].unbiased_options,
    ) as renderer:
        return renderer.render(time=0.0)


def measured(name: str, method: str) -> FloatArray:
    """Caustic irradiance (128, 128, 3) of a case, W/m^2; skips where the method does not take such a scene."""
    return shot(name, method)[0]


@cache
def shot(name: str, method: str) -> tuple[FloatArray, float]:
    """Caustic irradiance (128, 128, 3) of a case, W/m^2, and the mean flux of a photon that lands, W."""
    case: PhysicsCase = case_of(name)
    refuse_if_it_does_not_apply(case.scene, method)
    frame = render(case.scene, method)
    image = frame.aov["caustic_irradiance"]
    assert image.shape == (SIZE[1], SIZE[0], 3) and image.dtype == np.float32
    assert np.isfinite(image).all()
    solves = frame.stats["solves"]
    print(f"\n{method} {name}: solves {json.dumps(solves)}")
    photons = sum(s["converged"] + s["bracketed"] for s in solves)
    return box_filter(image, (BINS, BINS)), sum(s["flux_landed"] for s in solves) / max(photons, 1)


def noise(name: str, method: str) -> FloatArray:
    """Standard deviation of a bin's irradiance (128, 128, 3) that the method states, W/m^2; 0 without noise."""
    case, share = case_of(name), METHODS[method].noise_share
    if share == 0.0:
        return np.zeros_like(case.reference)
    flux_w = shot(name, method)[1]
    return np.asarray(share * np.sqrt(case.reference * flux_w / case.bin_area_m2))


def relative_rmse(image: FloatArray, reference: FloatArray) -> float:
    return float(np.sqrt(((image - reference) ** 2).mean()) / reference.mean())


@pytest.mark.parametrize("method", NAMES)
@pytest.mark.parametrize("name", FLAT)
def test_flat_water_is_exact_in_every_bin(name: str, method: str) -> None:
    case, image = case_of(name), measured(name, method)
    ratio = image[case.region] / case.reference[case.region]
    print(f"{method} {name}: E / E_ref mean {ratio.mean():.5f}, from {ratio.min():.5f} to {ratio.max():.5f}")
    allowed = case.tolerance + 5.0 * noise(name, method)[case.region] / case.reference[case.region]
    assert (np.abs(ratio - 1.0) < allowed).all()


@pytest.mark.parametrize("method", NAMES)
@pytest.mark.parametrize("name", SHAPED)
def test_relative_rmse(name: str, method: str) -> None:
    case, image = case_of(name), measured(name, method)
    error = relative_rmse(image[case.region], case.reference[case.region])
    noisy = float(np.sqrt((noise(name, method)[case.region] ** 2).mean()) / case.reference[case.region].mean())
    print(f"{method} {name}: relative RMSE {error:.4f}, of which noise may be {noisy:.4f}")
    assert error < np.hypot(case.tolerance, noisy)


@pytest.mark.parametrize("method", NAMES)
@pytest.mark.parametrize("name", CASES)
def test_energy(name: str, method: str) -> None:
    case, image = case_of(name), measured(name, method)
    landed = image[case.flux_region].sum(axis=0) * case.bin_area_m2
    print(f"{method} {name}: flux {landed} W of {case.flux_w} W, ratio {landed / case.flux_w}")
    np.testing.assert_allclose(landed, case.flux_w, rtol=ENERGY_TOLERANCE)


@pytest.mark.parametrize("method", NAMES)
@pytest.mark.parametrize("name", FOLDED)
def test_folds_add(name: str, method: str) -> None:
    """Where three sheets overlap, E is their sum: the strongest alone would be less than half of it."""
    case, image = case_of(name), measured(name, method)
    folded = case.extra["folded"] > 0
    total, reference = image[folded].sum(), case.reference[folded].sum()
    largest = case.extra["largest"][folded].sum()
    print(f"{method} {name}: folds hold {total / reference:.4f} of the truth, one sheet {largest / reference:.4f}")
    assert largest < 0.6 * reference
    assert total == pytest.approx(reference, rel=0.02)


@pytest.mark.parametrize("method", NAMES)
def test_the_spheres_cusp_stands_on_the_axis(method: str) -> None:
    """Encircled flux: the share within r of the axis follows the truth to 1 % of the whole, from two bins on."""
    case, image = case_of("sphere-cusp"), measured("sphere-cusp", method)
    radius = np.hypot(*bin_centres(case.half_extent_m))[case.flux_region]
    order = np.argsort(radius)
    curve = np.cumsum(image[case.flux_region][order].mean(axis=1))
    truth = np.cumsum(case.reference[case.flux_region][order].mean(axis=1))
    beyond = radius[order] > 2.0 * bin_width_m(case)
    error = np.abs(curve - truth)[beyond].max() / truth[-1]
    print(f"{method} sphere-cusp: encircled flux off by at most {error:.4f}")
    assert error < 0.01


def bin_width_m(case: PhysicsCase) -> float:
    """Width of a bin, metres."""
    return 2.0 * case.half_extent_m / BINS


def pixel_noise(name: str, method: str, frame: Frame) -> float:
    """Relative RMSE of a single pixel with independent photons of the frame's mean flux; 0 without noise."""
    case, solves = case_of(name), frame.stats["solves"]
    if METHODS[method].noise_share == 0.0:
        return 0.0
    flux_w = sum(s["flux_landed"] for s in solves) / sum(s["converged"] + s["bracketed"] for s in solves)
    area_m2 = (2.0 * case.half_extent_m / SIZE[0]) ** 2
    return float(np.sqrt(flux_w / area_m2 / frame.aov["caustic_irradiance"].mean()))


def rounded(irradiance: FloatArray) -> float:
    """Relative RMSE of a picture that is moved by 1 / 4096 px: of float32's 24 bits a place among the map's 2520 texels
    leaves 12 behind the point. It shows at the nephroid's cusp alone, where pixels hold a hundred times the mean.
    """
    steps = np.gradient(irradiance, axis=(0, 1))
    return float(np.sqrt(np.mean(steps[0] ** 2 + steps[1] ** 2)) / 4096.0 / irradiance.mean())


@pytest.mark.parametrize("factor", [0.001, 1000.0])
@pytest.mark.parametrize("method", NAMES)
@pytest.mark.parametrize("name", ["sine-folds", "flat-point", "sphere-absorbing", "nephroid"])
def test_scale_changes_nothing(name: str, method: str, factor: float) -> None:
    scene = case_of(name).scene
    refuse_if_it_does_not_apply(scene, method)
    frame, other = (render(s, method) for s in (scene, scaled(scene, factor)))
    ldr = np.sqrt(np.mean((frame.ldr.astype(np.float64) - other.ldr) ** 2)) / 255.0
    reference = frame.aov["caustic_irradiance"].astype(np.float64)
    caustic = relative_rmse(other.aov["caustic_irradiance"].astype(np.float64), reference)
    place = rounded(reference)
    print(
        f"{method} {name} x {factor:g}: RMSE {ldr:.2e} of the picture, {caustic:.2e} of the caustic, place {place:.1e}"
    )
    assert reference.mean() > 0.0
    rounding = ROUNDING_SHARE * pixel_noise(name, method, frame)
    assert ldr < 1e-3 + rounding
    assert caustic < 1e-3 + rounding + place
