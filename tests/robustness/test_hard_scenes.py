"""Hard scenes and odd sizes: no NaN or Inf in any AOV or texture, no OpenGL error, no exception but a GlcError."""

from __future__ import annotations

import numpy as np
import pytest

import glcaustics as glc
from glcaustics.caustics.registry import METHODS
from glcaustics.errors import GlcError
from glcaustics.renderer import AOVS, Frame
from glcaustics.scene.model import Scene
from glcaustics.scene.transform import scaled
from tests.gpu.feature_scenes import BACKEND
from tests.robustness.hard_scenes import SCENES, everything, ground, moved

pytestmark = pytest.mark.gpu
SIZE = (48, 36)


def textures_are_finite(renderer: glc.Renderer) -> None:
    """Every float texture that the frame used."""
    assert renderer._runner is not None
    resource_of = {slot: name for name, slot in renderer._runner.plan.slots.items()}
    for slot, texture in enumerate(renderer._runner._slots):
        if texture.depth or texture.dtype not in ("f2", "f4"):
            continue
        values = renderer.device.read(texture)
        bad = ~np.isfinite(values)
        assert not bad.any(), f"{resource_of.get(slot)}: {int(bad.sum())} of {values.size} values are not finite"


def render(
    scene: Scene, size: tuple[int, int] = SIZE, *, specular_view: bool = True, method: str = "caustic_map"
) -> Frame:
    with glc.Renderer(
        scene, size, method=method, quality="draft", backend=BACKEND, aovs=tuple(AOVS), specular_view=specular_view
    ) as renderer:
        frame = renderer.render(time=0.0)
        textures_are_finite(renderer)
        renderer.device.check_error("after the hard scene")
    for name, values in {**frame.aov, "image": frame.image}.items():
        assert np.isfinite(values).all(), name
    for name in ("image", "caustic_irradiance", "direct_irradiance"):
        assert frame.aov[name].min() >= 0.0, name
    for solve in frame.stats["solves"]:
        assert all(np.isfinite(v) for v in solve.values() if isinstance(v, float)), solve
    return frame


@pytest.mark.parametrize("method", sorted(METHODS))
@pytest.mark.parametrize("name", SCENES)
def test_hard_scene(name: str, method: str) -> None:
    try:
        frame = render(SCENES[name](), method=method)
    except GlcError as error:
        assert "\n" not in str(error) and len(str(error)) > 10
        print(f"{name}: {error}")
        return
    assert frame.ldr.shape == (SIZE[1], SIZE[0], 3)


@pytest.mark.parametrize("size", [(1, 1), (1, 777), (777, 1), (37, 23), (2, 2), (255, 3)])
def test_odd_sizes(size: tuple[int, int]) -> None:
    frame = render(everything(), size)
    assert frame.image.shape == (size[1], size[0], 3)


@pytest.mark.parametrize("size", [(0, 10), (-3, 4), (100_000, 2)])
def test_impossible_sizes_are_one_line(size: tuple[int, int]) -> None:
    with pytest.raises(GlcError) as refused:
        render(everything(), size)
    assert "\n" not in str(refused.value)


@pytest.mark.smoke
def test_the_ordinary_scene_is_no_hard_scene() -> None:
    """What all hard scenes vary does light its pixels: the sweep is not one of black pictures."""
    frame = render(everything())
    assert frame.aov["caustic_irradiance"].max() > 0.0 and frame.aov["direct_irradiance"].max() > 0.0
    assert len(np.unique(frame.aov["solve_status"])) > 1


@pytest.mark.parametrize("factor", [1e-4, 1e5])
def test_scale_leaves_the_picture(factor: float) -> None:
    first, other = (render(s) for s in (everything(), scaled(everything(), factor)))
    rmse = np.sqrt(np.mean((first.ldr.astype(float) - other.ldr) ** 2)) / 255.0
    print(f"scale {factor:g}: RMSE {rmse:.2e}")
    assert rmse < 3e-3


def test_far_from_the_origin_the_picture_stays() -> None:
    """A kilometre away float32 keeps 0.1 mm: the picture is the same to the eye."""
    first, other = (render(s) for s in (everything(), moved(everything(), (1000.0, 200.0, -500.0))))
    rmse = np.sqrt(np.mean((first.ldr.astype(float) - other.ldr) ** 2)) / 255.0
    print(f"1 km away: RMSE {rmse:.4f}")
    assert rmse < 0.02


def test_a_huge_ground_hides_nothing() -> None:
    """Neither the camera's near plane nor the lamp's may run over what stands on a ground 10 000 times its size."""
    small, huge = (render(ground(size), (96, 72)) for size in (30.0, 1e4))
    lower = slice(30, None)  # below the horizon
    np.testing.assert_allclose(huge.aov["depth_m"][lower], small.aov["depth_m"][lower], rtol=1e-3)
    a, b = (f.aov["caustic_irradiance"][lower].astype(np.float64) for f in (small, huge))
    print(
        f"huge ground: caustic {b.sum() / a.sum():.4f} of that on a small one, direct "
        f"{huge.aov['direct_irradiance'][lower].sum() / small.aov['direct_irradiance'][lower].sum():.4f}"
    )
    assert b.sum() == pytest.approx(a.sum(), rel=0.02)
    direct = [f.aov["direct_irradiance"][lower].sum() for f in (small, huge)]
    assert direct[1] == pytest.approx(direct[0], rel=0.01)
