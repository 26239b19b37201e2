"""Fitted light views without a GPU: they hold their points, measures are right, cubes tile the sphere."""

from __future__ import annotations

import math

import numpy as np
import pytest

from glcaustics.passes.fit_view import MAX_TANGENT, best_turn, cube_view, depth_range, fit_size, fit_view
from glcaustics.passes.light_views import CUBE_FORWARD, LightView, light_uniforms
from glcaustics.scene.model import Light, LightKind

RANDOM = np.random.default_rng(7)
CLOUD = RANDOM.normal(size=(500, 3)) * (1.5, 0.3, 0.7) + (2.0, -1.0, 0.5)


def directional(*d: float) -> Light:
    v = np.asarray(d) / np.linalg.norm(d)
    return Light(LightKind.DIRECTIONAL, direction_ws=(float(v[0]), float(v[1]), float(v[2])))


def point(*p: float) -> Light:
    return Light(LightKind.POINT, position_ws=(p[0], p[1], p[2]))


def project(view: LightView, points: np.ndarray, face: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Normalised device coordinates (N, 3) and clip w (N,)."""
    clip = np.concatenate([points, np.ones((len(points), 1))], 1) @ view.matrices[face].T
    return clip[:, :3] / clip[:, 3:], clip[:, 3]


LIGHTS = {
    "from above": directional(0.0, -1.0, 0.0),
    "slanted": directional(0.4, -1.0, 0.3),
    "along x": directional(1.0, 0.0, 0.0),
    "from below": directional(0.1, 1.0, -0.2),
    "lamp above": point(2.0, 4.0, 0.5),
    "lamp aside": point(-6.0, 0.0, 3.0),
}


@pytest.mark.parametrize("name", LIGHTS)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_a_view_holds_its_points_with_a_border(name: str, scale: float) -> None:
    light = LIGHTS[name]
    if light.kind is LightKind.POINT:
        light = point(*(np.asarray(light.position_ws) * scale))
    view = fit_view(light, CLOUD * scale, 256)
    assert view.faces == 1
    ndc, w = project(view, CLOUD * scale)
    assert (w > 0.0).all() and (np.abs(ndc) <= 1.0).all()
    texels = (ndc[:, :2] * 0.5 + 0.5) * view.size
    border = np.minimum(texels, np.asarray(view.size) - texels).min()
    assert border >= 1.9  # two texels all round
    used = np.ptp(texels, axis=0) / view.size
    assert used.max() > 0.9  # and tight along one axis at least
    assert 0.8 * 256**2 < view.size[0] * view.size[1] < 1.25 * 256**2


def test_texel_measure_of_a_directional_view_is_the_cross_section() -> None:
    view = fit_view(LIGHTS["slanted"], CLOUD, 200)
    x0, x1, y0, y1 = view.rect
    assert view.texel_measure == pytest.approx((x1 - x0) * (y1 - y0) / (view.size[0] * view.size[1]))
    # two points one metre apart across the light are 2 / width apart in clip space
    pair = np.stack((CLOUD[0], CLOUD[0] + view.right_ws))
    ndc, _ = project(view, pair)
    assert np.hypot(*(ndc[1] - ndc[0])[:2]) == pytest.approx(2.0 / (x1 - x0), rel=1e-9)


def test_texel_measure_of_a_frustum_sums_to_its_solid_angle() -> None:
    """Sum over the texels of measure x cos^3 = the solid angle of the window, by the closed form of a rectangle."""
    view = fit_view(LIGHTS["lamp above"], CLOUD, 200)
    x0, x1, y0, y1 = view.rect
    x = x0 + (np.arange(view.size[0]) + 0.5) / view.size[0] * (x1 - x0)
    y = y0 + (np.arange(view.size[1]) + 0.5) / view.size[1] * (y1 - y0)
    cosine = 1.0 / np.sqrt(1.0 + x[None, :] ** 2 + y[:, None] ** 2)

    def corner(a: float, b: float) -> float:
        return math.atan(a * b / math.sqrt(1.0 + a * a + b * b))

    solid_angle = corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)
    assert view.texel_measure * (cosine**3).sum() == pytest.approx(solid_angle, rel=1e-4)


def test_cube_faces_tile_the_sphere() -> None:
    light = point(0.3, -0.2, 0.1)
    view = fit_view(light, CLOUD - CLOUD.mean(axis=0) + np.asarray(light.position_ws), 256)
    assert view.faces == 6 and view.size[0] * 2 == view.size[1] * 3
    directions = RANDOM.normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = np.asarray(light.position_ws) + directions * 0.5
    seen = np.zeros(len(points), int)
    for face in range(6):
        ndc, w = project(view, points, face)
        inside = (w > 0.0) & (np.abs(ndc[:, :2]) <= 1.0).all(axis=1)
        seen += inside
        forward = CUBE_FORWARD[face]
        assert (np.argmax(np.abs(directions[inside]), axis=1) == np.argmax(np.abs(forward))).all()
        np.testing.assert_allclose(view.forward_of(face), forward)
    assert (seen == 1).all()
    tile = view.size[0] // 3
    t = (np.arange(tile) + 0.5) / tile * 2.0 - 1.0
    cosine = 1.0 / np.sqrt(1.0 + t[None, :] ** 2 + t[:, None] ** 2)
    assert 6.0 * view.texel_measure * (cosine**3).sum() == pytest.approx(4.0 * math.pi, rel=1e-3)
    boxes = view.viewports()
    assert len({box[:2] for box in boxes}) == 6 and all(box[2:] == (tile, tile) for box in boxes)


def test_cube_projection_is_what_the_shader_computes() -> None:
    """`glc_view_project_on` rebuilds a face from its axes instead of reading a matrix: both must agree."""
    light = point(0.0, 0.0, 0.0)
    view = cube_view(light, 128, CLOUD)
    for face, forward in enumerate(CUBE_FORWARD):
        up = np.array([0.0, 1.0, 0.0])
        if face in (2, 3):
            up = np.array([0.0, 0.0, -forward[1]])
        right = np.cross(forward, up)
        p = forward + 0.3 * right - 0.7 * up
        ndc, _ = project(view, p[None], face)
        np.testing.assert_allclose(ndc[0, :2], (0.3, -0.7), atol=1e-12)


def test_wide_points_ask_for_a_cube_and_narrow_ones_do_not() -> None:
    flat = np.array([[x, 0.0, z] for x in (-1.0, 1.0) for z in (-1.0, 1.0)])
    assert fit_view(point(0.0, 1.1 / MAX_TANGENT, 0.0), flat, 64).faces == 1
    assert fit_view(point(0.0, 0.5 / MAX_TANGENT, 0.0), flat, 64).faces == 6
    assert fit_view(point(0.0, 0.0, 0.0), flat, 64).faces == 6


def test_a_spot_sees_no_more_than_its_cone() -> None:
    spot = Light(
        LightKind.SPOT, position_ws=(0.0, 2.0, 0.0), direction_ws=(0.0, -1.0, 0.0), outer_cone_rad=math.radians(20.0)
    )
    floor = RANDOM.uniform(-50.0, 50.0, (300, 3)) * (1.0, 0.0, 1.0)
    view = fit_view(spot, floor, 128)
    tangent = math.tan(math.radians(20.0))
    assert view.faces == 1
    assert max(abs(v) for v in view.rect) < 1.1 * tangent
    small = fit_view(spot, floor * 1e-3, 128)  # what is smaller than the cone gets the whole window
    assert max(abs(v) for v in small.rect) < 0.05


def test_spot_cone_uniforms_are_gltfs() -> None:
    spot = Light(LightKind.SPOT, inner_cone_rad=0.3, outer_cone_rad=0.7, direction_ws=(0.0, -1.0, 0.0))
    scale, offset = light_uniforms(spot)["u_light_cone"]
    assert math.cos(0.7) * scale + offset == pytest.approx(0.0, abs=1e-12)
    assert math.cos(0.3) * scale + offset == pytest.approx(1.0)
    assert light_uniforms(point(0.0, 1.0, 0.0))["u_light_cone"] == (0.0, 1.0)


def test_best_turn_aligns_a_turned_rectangle() -> None:
    angle = math.radians(33.0)
    u, v = RANDOM.uniform(-3.0, 3.0, 2000), RANDOM.uniform(-0.2, 0.2, 2000)
    turned = (math.cos(angle) * u - math.sin(angle) * v, math.sin(angle) * u + math.cos(angle) * v)
    assert best_turn(*turned) == pytest.approx(angle, abs=math.radians(1.6))


@pytest.mark.parametrize("aspect", [1e-6, 0.1, 1.0, 3.7, 1e9])
def test_sizes_keep_their_area_and_their_limits(aspect: float) -> None:
    width, height = fit_size(256, aspect)
    assert width % 8 == height % 8 == 0 and min(width, height) >= 8
    assert width * height == pytest.approx(256**2, rel=0.15)
    assert width / height == pytest.approx(min(max(aspect, 0.125), 8.0), rel=0.15)


@pytest.mark.parametrize("positional", [False, True])
def test_depth_ranges_are_never_empty(positional: bool) -> None:
    cases = ((1.0, 2.0, 1.0), (3.0, 3.0, 0.0), (0.0, 0.0, 0.0), (1e-7, 1e-7, 0.0), (1e9, 1e9, 1.0))
    for low, high, extent in cases:
        near, far = depth_range(np.array([low, high]), extent, positional=positional)
        assert near < far and high <= far
        assert near > 0.0 if positional else near <= low


@pytest.mark.parametrize("light", [directional(0.2, -1.0, 0.1), point(0.0, 3.0, 0.0)], ids=["sun", "lamp"])
def test_points_without_extent_give_a_finite_view(light: Light) -> None:
    for points in (np.zeros((1, 3)), np.tile([[0.3, 0.1, -2.0]], (5, 1)), np.array([[-1.0, 0, 0], [1.0, 0, 0]])):
        view = fit_view(light, points, 64)
        assert all(np.isfinite(m).all() for m in view.matrices) and view.texel_measure > 0.0
