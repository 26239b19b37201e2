"""The built-in scenes: they load, say why they exist and under what licence, and are physically sound."""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest

from glcaustics.scene import OpticalKind, builtin_scenes, load_scene, scenes_root
from glcaustics.scene.mesh_tools import signed_volume
from glcaustics.scene.water import surface_of

NAMES = [name for name, _, _ in builtin_scenes()]


def kinds(name: str) -> set[OpticalKind]:
    return {instance.optical_kind for instance in load_scene(name).instances_at(0.0)}


def test_the_promised_scenes_exist() -> None:
    early = {"pool", "peer-pool", "glass-sphere", "glass-bunny", "metal-ring", "dry-room"}
    assert early | {"boat", "lagoon", "glass-statue"} <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_each_states_itself_and_needs_no_assumption(name: str) -> None:
    scene = load_scene(name)
    assert scene.name == name
    assert len(scene.purpose) > 20 and scene.purpose.endswith(".")
    assert "MIT" in scene.licence
    assert scene.announcements == () and scene.exposure is None
    assert scene.lights and not scene.camera.orthographic


@pytest.mark.parametrize("name", NAMES)
def test_geometry_is_sound(name: str) -> None:
    for instance in load_scene(name).instances_at(0.7):
        mesh = instance.mesh
        assert np.isfinite(mesh.positions_m).all() and np.isfinite(mesh.uv).all(), instance.name
        assert np.abs(np.linalg.norm(mesh.normals.astype(np.float64), axis=1) - 1.0).max() < 1e-5, instance.name
        corners = mesh.positions_m[mesh.triangles].astype(np.float64)
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal = mesh.normals[mesh.triangles].astype(np.float64).sum(axis=1)
        agree = np.einsum("ti,ti->t", face, normal) > 0.0  # else both sides are lit wrongly
        assert agree.mean() > 0.998, instance.name
        if instance.optical_kind in (OpticalKind.SOLID, OpticalKind.MIRROR):
            assert mesh.watertight, instance.name
        if mesh.watertight:
            assert signed_volume(mesh.positions_m, mesh.triangles) > 0.0, instance.name
        if instance.optical_kind is OpticalKind.INTERFACE:
            assert mesh.normals[:, 1].min() > 0.0, instance.name


@pytest.mark.parametrize("name", NAMES)
def test_assets_are_small_and_none_is_left_over(name: str) -> None:
    folder = scenes_root() / name
    text = (folder / "scene.toml").read_text(encoding="utf-8")
    for path in folder.iterdir():
        assert path.stat().st_size < 1_500_000, path
        assert path.suffix == ".py" or path.name == "scene.toml" or f'"{path.name}"' in text, path


def test_the_optical_kinds_that_each_scene_is_for() -> None:
    assert kinds("dry-room") == {OpticalKind.DIFFUSE}
    assert kinds("pool") == {OpticalKind.DIFFUSE, OpticalKind.INTERFACE}
    assert kinds("peer-pool") == {OpticalKind.DIFFUSE, OpticalKind.INTERFACE}
    assert kinds("glass-sphere") == {OpticalKind.DIFFUSE, OpticalKind.SOLID}
    assert kinds("glass-bunny") == {OpticalKind.DIFFUSE, OpticalKind.SOLID}
    assert kinds("boat") == kinds("lagoon") == {OpticalKind.DIFFUSE, OpticalKind.INTERFACE}
    assert kinds("glass-statue") == {OpticalKind.DIFFUSE, OpticalKind.SOLID}
    assert kinds("metal-ring") == {OpticalKind.DIFFUSE, OpticalKind.MIRROR}


@pytest.mark.parametrize("s", [0.5, 1.0, 2.0])
def test_peer_pool_is_exactly_the_published_comparison(s: float) -> None:
    scene = load_scene("peer-pool", overrides={"water[0].amplitude_scale": s})
    (light,), (water,) = scene.lights, scene.waters
    assert light.intensity == 1.0 and light.color == (1.0, 1.0, 1.0)
    np.testing.assert_allclose(light.direction_ws, np.array([0.2, -1.0, 0.1]) / math.sqrt(1.05), rtol=1e-15)
    assert water.material.ior == 1.333 and not water.animated
    x, z = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 1000))
    height = np.zeros(1000)
    for length, degrees, phase in ((0.70, 20, 0.3), (0.45, 100, 1.7), (0.31, -35, 4.1), (0.23, 65, 2.2)):
        k = 2.0 * math.pi / length
        kx, kz = k * math.cos(math.radians(degrees)), k * math.sin(math.radians(degrees))
        height += 1.5 * s / k**2 * np.sin(kx * x + kz * z + phase)
    for time_s in (0.0, 2.0):
        np.testing.assert_allclose(surface_of(water).height(x, z, time_s), height, rtol=0, atol=1e-14)
    positions = scene.instances_at(0.0)[-1].positions_ws()
    np.testing.assert_allclose([positions.min(0)[[0, 2]], positions.max(0)[[0, 2]]], [[-1, -1], [1, 1]])
    (floor,) = scene.instances
    low, high = floor.positions_ws().min(0), floor.positions_ws().max(0)
    assert low[1] == high[1] == -1.0 and low[[0, 2]].max() < -1.5 and high[[0, 2]].min() > 1.5


def test_pool_holds_its_water() -> None:
    """The water meets the tiled walls all round, stays under the coping, and its waves focus near the floor."""
    scene = load_scene("pool")
    parts = {instance.name: instance for instance in scene.instances}
    (water,) = scene.waters
    waves = surface_of(water).waves  # type: ignore[attr-defined]
    assert 6 <= len(waves) <= 10
    level = float(water.world_from_object[1, 3])
    crest = level + sum(abs(w.amplitude_m) for w in waves)
    band = parts["border"].positions_ws()
    assert crest < 0.0 and band[:, 1].min() < level - 3 * 0.02 and band[:, 1].max() > level
    sheet = scene.instances_at(0.0)[-1].positions_ws()
    for axis in (0, 2):
        inner = np.unique(np.abs(band[:, axis]).round(6)).min()
        assert sheet[:, axis].min() == pytest.approx(-inner) and sheet[:, axis].max() == pytest.approx(inner)
    floor = parts["basin"].positions_ws()[:, 1]
    depth = level - np.sort(np.unique(floor.round(6)))[1]
    assert 1.4 <= depth <= 2.0
    sigma = math.sqrt(sum((w.amplitude_m * w.k**2) ** 2 for w in waves) / 2.0)  # rms curvature
    n = water.material.ior
    assert 0.3 < sigma * depth * (n - 1.0) / n < 1.0


def test_the_sphere_and_the_ring_are_smooth_and_stand_clear_of_the_floor() -> None:
    ball = load_scene("glass-sphere").instances[-1]
    radius = np.linalg.norm(ball.mesh.positions_m.astype(np.float64), axis=1)
    np.testing.assert_allclose(radius, radius[0], rtol=1e-6)
    np.testing.assert_allclose(ball.mesh.normals, ball.mesh.positions_m / radius[0], atol=1e-6)
    assert ball.positions_ws()[:, 1].min() > 0.0 and ball.material.ior == 1.5
    ring = load_scene("metal-ring").instances[-1]
    assert ring.positions_ws()[:, 1].min() > 0.0 and len(ring.mesh.triangles) >= 2048


def test_the_bunny_is_one_absorbing_manifold() -> None:
    bunny = load_scene("glass-bunny").instances[-1]
    triangles = bunny.mesh.triangles.astype(np.int64)
    assert 20_000 <= len(triangles) <= 40_000
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    unique, uses = np.unique(edges, axis=0, return_counts=True)
    assert (uses == 2).all()  # no edge where the surface touches itself
    assert len(bunny.mesh.positions_m) - len(unique) + len(triangles) == 2  # Euler: one piece, no handle
    assert bunny.positions_ws()[:, 1].min() > 0.0 and np.ptp(bunny.positions_ws()[:, 1]) == pytest.approx(0.2, abs=1e-3)
    assert bunny.material.sigma_a.min() > 0.0


def edges_of(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The undirected edges (E, 2) and how many triangles use each."""
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    unique, uses = np.unique(edges, axis=0, return_counts=True)
    return unique, uses


def test_the_statue_is_one_smooth_manifold_before_an_uneven_wall() -> None:
    parts = {instance.name.split("/")[0]: instance for instance in load_scene("glass-statue").instances}
    statue = parts["statue"]
    triangles = statue.mesh.triangles.astype(np.int64)
    assert 40_000 <= len(triangles) <= 80_000
    assert (edges_of(triangles)[1] == 2).all()
    positions = statue.positions_ws()
    assert positions[:, 1].min() > 0.0 and np.ptp(positions[:, 1]) == pytest.approx(0.5, abs=1e-3)
    wall = parts["wall"]
    relief = wall.positions_ws()[:, 2]
    assert np.ptp(relief) > 0.03 and np.std(relief) > 0.005  # metres of relief
    assert wall.material.base_color_image is not None and parts["floor"].material.base_color_image is not None
    assert relief.max() < positions[:, 2].min()  # behind the figure, not through it


@pytest.mark.parametrize("name", ["boat", "lagoon"])
def test_lakes_lie_in_their_beds(name: str) -> None:
    """Water ends over ground that goes on, rises above it on the far side, and focuses near the bed; limits hold."""
    scene = load_scene(name)
    bed = next(i for i in scene.instances if i.name.startswith("bed")).positions_ws()
    (water,) = scene.waters
    everything = scene.instances_at(0.0)
    sheet = everything[-1].positions_ws()
    for axis in (0, 2):
        assert bed[:, axis].min() < sheet[:, axis].min() and bed[:, axis].max() > sheet[:, axis].max()
    level = float(water.world_from_object[1, 3])
    far = bed[bed[:, 2] <= sheet[:, 2].min() + 0.1]
    assert np.median(far[:, 1]) > sheet[:, 1].max()  # the far shore hides the water's edge
    depth = level - np.median(bed[bed[:, 1] < level - 0.3][:, 1])
    assert 0.7 < depth < 1.4
    waves = surface_of(water).waves  # type: ignore[attr-defined]
    sigma = math.sqrt(sum((w.amplitude_m * w.k**2) ** 2 for w in waves) / 2.0)  # rms curvature
    assert 0.3 < sigma * depth * (water.material.ior - 1.0) / water.material.ior < 1.0
    assert sum(len(i.mesh.triangles) for i in everything) < 250_000


def test_the_boat_is_half_sunk_among_weeds() -> None:
    scene = load_scene("boat")

    def heights(name: str) -> np.ndarray:
        return np.concatenate([i.positions_ws()[:, 1] for i in scene.instances if i.name.split("/")[0] == name])

    hull = heights("hull")
    assert hull.min() < -0.3 and hull.max() > 0.3  # stern under, bow out
    weeds = [i for i in scene.instances if i.name.split("/")[0] == "weeds"]
    assert len(weeds) >= 20 and sum(len(i.mesh.triangles) for i in weeds) > 30_000
    tall = [np.ptp(i.positions_ws()[:, 1]) for i in weeds]
    assert np.median(tall) > 0.6 and heights("weeds").max() < 0.05
    assert heights("reeds").max() > 0.8 and heights("reeds").min() < -0.1  # these come through the surface


def test_things_float_and_sink_in_the_lagoon() -> None:
    scene = load_scene("lagoon")
    spans: dict[str, list[float]] = {}
    for instance in scene.instances:
        y = instance.positions_ws()[:, 1]
        low, high = spans.setdefault(instance.name.split("/")[0], [math.inf, -math.inf])
        spans[instance.name.split("/")[0]] = [min(low, float(y.min())), max(high, float(y.max()))]
    for afloat in ("buoy", "floats"):
        assert spans[afloat][0] < 0.0 < spans[afloat][1], afloat
    for sunken in ("staghorn", "brain", "table", "sponge"):
        assert spans[sunken][1] < 0.0, sunken
    assert spans["rocks"][1] > 0.05 and spans["log"][0] > -0.1


@pytest.mark.parametrize("name", NAMES)
def test_no_key_hides_in_a_builtin_file(name: str) -> None:
    """Strictness is proved on the shipped files: a stray key in any table of theirs is refused."""
    data = tomllib.loads((scenes_root() / name / "scene.toml").read_text(encoding="utf-8"))
    tables = [f"{key}[0]" if isinstance(value, list) else key for key, value in data.items()]
    for table in tables:
        with pytest.raises(Exception, match="unknown key 'stray'"):
            load_scene(name, overrides={f"{table}.stray": 1})
