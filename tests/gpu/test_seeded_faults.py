"""A wrong method must be caught: known faults are seeded into a copy of the shaders, and the metrics must see each one.

Each fault is one that published code has. It counts as seen when a metric is both beyond the limit that the
tests of the healthy method set, and several times the healthy run's own value.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import glcaustics as glc
from glcaustics import metrics
from glcaustics.gpu import Device, glsl_root
from glcaustics.optics.fresnel import fresnel_dielectric
from glcaustics.optics.pixels import box_filter
from tests.gpu.feature_scenes import BACKEND
from tests.gpu.physics_scenes import BINS, CASES, WATER_IOR, PhysicsCase

pytestmark = pytest.mark.gpu

SIZE = 2 * BINS
CLEARLY = 4.0  # times the healthy run's value

FloatArray = npt.NDArray[np.float64]
case_of = cache(lambda name: CASES[name]())


@dataclass(frozen=True)
class Fault:
    """`old` -> `new`, exactly one place in glsl/; `case`: where it shows; `metric`: of (case, irradiance); `limit`:
    what a healthy run stays under."""

    name: str
    case: str
    old: str
    new: str
    metric: Callable[[PhysicsCase, FloatArray], float]
    limit: float
    method: str = "caustic_map"
    also: tuple[tuple[str, str], ...] = ()


def rmse(case: PhysicsCase, image: FloatArray) -> float:
    return metrics.relative_rmse(case.reference, image, mask=case.region)


def bias(case: PhysicsCase, image: FloatArray) -> float:
    return abs(metrics.bias_of_mean(case.reference, image, mask=case.region))


def energy(case: PhysicsCase, image: FloatArray) -> float:
    seen = image * case.flux_region[..., None]
    return float(np.abs(metrics.flux_balance(seen, case.bin_area_m2, case.flux_w)).max())


FAULTS = [
    Fault(
        "cosine counted twice in the flux of a texel",
        "flat-60",
        "return u_light_intensity * view.texel_measure;",
        "return u_light_intensity * view.texel_measure * n_dot_l;",
        energy,
        0.005,
    ),
    Fault(
        "no Fresnel",
        "flat-0",
        "(1.0 - glc_fresnel_dielectric(n_dot_l, eta)) * object.transmission",
        "object.transmission",
        bias,
        0.005,
    ),
    Fault(
        "area by product of lengths",
        "sphere",
        "a.x * b.y - a.y * b.x, float(links)",
        "length(a) * length(b), float(links)",
        rmse,
        0.01,
        "displaced_mesh",
        # The triangle's area too, or the splats that make up for what the triangles do not hold would hide the fault.
        (("0.5 * cross2(b.xy - a.xy, c.xy - a.xy)", "0.5 * length(b.xy - a.xy) * length(c.xy - a.xy)"),),
    ),
    Fault(
        "map shifted by a texel", "sine", "vec2 at = projected.xy - 0.5;", "vec2 at = projected.xy + 0.5;", rmse, 0.01
    ),
]


def seeded(target: Path, *changes: tuple[str, str]) -> Path:
    """A copy of glsl/ with the fault in it: (old, new) texts.

    Raises:
        AssertionError: the text is not there exactly once: the shader was changed, and the fault must follow it.
    """
    shutil.copytree(glsl_root(), target)
    for old, new in changes:
        files = [path for path in target.rglob("*.*") if path.is_file() and old in path.read_text()]
        assert len(files) == 1 and files[0].read_text().count(old) == 1, f"{old!r} is in {files}"
        files[0].write_text(files[0].read_text().replace(old, new))
    return target


def render(
    case: PhysicsCase, shaders: Path | None = None, *, aov: str = "caustic_irradiance", method: str = "caustic_map"
) -> FloatArray:
    """(128, 128, 3) of a case, seen from straight above; `image`: through the water, else of the floor behind it."""
    with glc.Renderer(
        case.scene,
        size=(SIZE, SIZE),
        method=method,
        quality="medium",
        backend=BACKEND,
        aovs=(aov,) if aov != "image" else (),
        specular_view=aov == "image",
        shader_root=shaders,
        stats=False,
    ) as renderer:
        frame = renderer.render()
    image = frame.image if aov == "image" else frame.aov[aov]
    assert metrics.non_finite_share(image) == 0.0
    return box_filter(image, (BINS, BINS))


@cache
def healthy(name: str, method: str = "caustic_map") -> FloatArray:
    return render(case_of(name), method=method)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_metrics_see_a_fault_in_the_shaders(fault: Fault, tmp_path: Path) -> None:
    case = case_of(fault.case)
    well = fault.metric(case, healthy(fault.case, fault.method))
    shaders = seeded(tmp_path / "glsl", (fault.old, fault.new), *fault.also)
    ill = fault.metric(case, render(case, shaders, method=fault.method))
    print(f"\n{fault.name}: healthy {well:.4f}, with the fault {ill:.4f}, limit {fault.limit}")
    assert well < fault.limit
    assert ill > fault.limit and ill > CLEARLY * well


@contextmanager
def no_blending(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Points overwrite each other, as where folds are not summed."""
    original = Device.draw

    def draw(self: Device, *args: Any, **named: Any) -> None:
        if named.get("mode") == "points":
            named["blend"] = None
        original(self, *args, **named)

    with monkeypatch.context() as patch:
        patch.setattr(Device, "draw", draw)
        yield


def test_metrics_see_light_that_is_overwritten(monkeypatch: pytest.MonkeyPatch) -> None:
    case = case_of("sine-folds")
    well = energy(case, healthy("sine-folds"))
    with no_blending(monkeypatch):
        ill = energy(case, render(case))
    print(f"\nno additive blending: healthy {well:.4f}, with the fault {ill:.4f}")
    assert well < 0.01  # at this small size
    assert ill > 0.05 and ill > CLEARLY * well


def test_metrics_see_the_missing_radiance_scale(tmp_path: Path) -> None:
    """Straight down through flat water: L = T_eye E rho / (pi n^2), E = T E_perp; the sky is black."""
    case = case_of("flat-0")
    passes = 1.0 - float(fresnel_dielectric(1.0, 1.0, WATER_IOR))
    middle = np.zeros((BINS, BINS), bool)
    middle[BINS // 2 - 8 : BINS // 2 + 8, BINS // 2 - 8 : BINS // 2 + 8] = True
    truth = np.full((BINS, BINS, 3), passes**2 * 0.5 / (np.pi * WATER_IOR**2))
    root = seeded(tmp_path / "glsl", ("tint /= at.eta * at.eta;", ""))
    well = abs(metrics.bias_of_mean(truth, render(case, aov="image"), mask=middle))
    ill = abs(metrics.bias_of_mean(truth, render(case, root, aov="image"), mask=middle))
    print(f"\nno 1/n^2: healthy {well:.4f}, with the fault {ill:.4f}")
    assert well < 0.01
    assert ill == pytest.approx(WATER_IOR**2 - 1.0, rel=0.05)
