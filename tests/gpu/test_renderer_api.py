"""The renderer as a program uses it: dry scenes, a host's context, determinism, sequences."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from time import perf_counter
from typing import Any

import moderngl
import numpy as np
import pytest

import glcaustics as glc
from glcaustics.errors import UsageError
from glcaustics.gpu import Device
from glcaustics.renderer import AOVS, plan_frame
from glcaustics.scene.model import Scene
from tests.gpu.feature_scenes import BACKEND, GLASS, box, from_above, lamp, plane, scene_of, sheet, shoot, sun
from tests.gpu.test_device_state import Host, state_of

pytestmark = pytest.mark.gpu
SMALL = (64, 48)
CAUSTIC_WORDS = ("caust", "caster", "receiver", "specular", "refraction", "rsm")


def small_scene() -> Scene:
    return scene_of(
        [plane("floor", 2.0, -1.0), sheet("water", 1.0, 0.0), box("glass", (0.3, 0.3, 0.3), (0.2, 0.6, 0.0), GLASS)],
        [sun(20.0, 3.0), lamp((0.5, 2.0, 0.4), 2.0)],
        from_above(1.5, -1.0),
    )


# -- dry-room ---------------------------------------------------------------------------------------------------------


def test_the_plan_of_a_dry_room_leaves_out_every_caustics_pass() -> None:
    scene = glc.load_scene("dry-room")
    plan = plan_frame(scene, SMALL, "caustic_map", "medium")
    names = [step.name for step in plan.steps]
    assert names and not [n for n in names if any(word in n for word in CAUSTIC_WORDS)]
    left_out = {item.name for item in plan.left_out}
    assert {"caustic_map.gather", "gbuffer.specular", "refraction", "caster_view@0", "caustic_map.solve@0"} <= left_out
    assert names == [step.name for step in plan_frame(scene, SMALL, "none", "medium").steps]


def test_a_dry_room_costs_the_same_with_caustics_and_looks_the_same() -> None:
    scene = glc.load_scene("dry-room")
    arguments: dict[str, Any] = {"size": (160, 120), "quality": "low", "backend": BACKEND, "stats": False}
    with (
        glc.Renderer(scene, method="caustic_map", **arguments) as with_method,
        glc.Renderer(scene, method="none", **arguments) as without,
    ):
        frames = [r.render(time=0.0) for r in (with_method, without)]
        assert np.array_equal(frames[0].image, frames[1].image) and np.array_equal(frames[0].ldr, frames[1].ldr)
        assert [p["name"] for p in frames[0].stats["passes"]] == [p["name"] for p in frames[1].stats["passes"]]
        times: dict[int, list[float]] = {0: [], 1: []}
        for turn in range(24):
            for which in (0, 1) if turn % 2 else (1, 0):
                renderer = (with_method, without)[which]
                start = perf_counter()
                renderer.draw(time=0.01 * (turn + 1))
                renderer.device.ctx.finish()
                times[which].append(perf_counter() - start)
    ratio = float(np.median(times[0][4:]) / np.median(times[1][4:]))
    print(f"dry-room, caustic_map / none: {ratio:.3f}, median {1e3 * np.median(times[1]):.2f} ms")
    assert ratio < 1.15


# -- a host's context -------------------------------------------------------------------------------------------------


@pytest.fixture
def host() -> Iterator[Host]:
    if BACKEND != "egl":
        pytest.skip("the host of this test opens an EGL context")
    made = Host()
    yield made
    made.ctx.release()


def test_the_hosts_state_is_as_it_was(host: Host) -> None:
    host.make_odd()
    before = state_of(host.raw, 16)
    renderer = glc.Renderer(small_scene(), SMALL, quality="draft", context=host.ctx, aovs=("depth_m",))
    assert state_of(host.raw, 16) == before
    frame = renderer.render(time=0.0)
    assert state_of(host.raw, 16) == before
    renderer.draw(time=0.1)
    _ = renderer.plan
    assert state_of(host.raw, 16) == before
    renderer.close()
    assert state_of(host.raw, 16) == before
    assert host.ctx.error == "GL_NO_ERROR"
    own = shoot(small_scene(), SMALL, quality="draft", specular_view=True, method="auto", aovs=("depth_m",))
    assert np.array_equal(frame.image, own.image) and np.array_equal(frame.ldr, own.ldr)


def test_the_hosts_framebuffer_gets_the_picture(host: Host) -> None:
    texture = host.ctx.texture(SMALL, 4)
    target = host.ctx.framebuffer([texture])
    target.clear(1.0, 0.0, 1.0, 1.0)
    with glc.Renderer(small_scene(), SMALL, quality="draft", context=host.ctx, target=target) as renderer:
        frame = renderer.render(time=0.0)
        renderer.draw(time=0.0)
    shown = np.frombuffer(texture.read(), np.uint8).reshape(SMALL[1], SMALL[0], 4)[::-1, :, :3]
    assert np.array_equal(shown, frame.ldr) and frame.ldr.max() > 50


def test_a_target_of_another_size_is_refused(host: Host) -> None:
    target = host.ctx.framebuffer([host.ctx.texture((10, 10), 4)])
    with pytest.raises(UsageError, match="target"):
        glc.Renderer(small_scene(), SMALL, context=host.ctx, target=target)


def test_two_renderers_take_turns() -> None:
    """Each with a context of its own: neither draws into the other's."""
    scenes = (small_scene(), scene_of([plane("floor", 2.0)], [sun(0.0, 2.0)], from_above(1.0)))
    alone = [shoot(s, SMALL, quality="draft", specular_view=True, aovs=()) for s in scenes]
    arguments: dict[str, Any] = {"method": "caustic_map", "quality": "draft", "backend": BACKEND}
    with glc.Renderer(scenes[0], SMALL, **arguments) as a, glc.Renderer(scenes[1], SMALL, **arguments) as b:
        for _ in range(2):
            assert np.array_equal(b.render(time=0.0).image, alone[1].image)
            assert np.array_equal(a.render(time=0.0).image, alone[0].image)


# -- reading nothing back ---------------------------------------------------------------------------------------------


@contextmanager
def counted(monkeypatch: pytest.MonkeyPatch, owner: Any, names: tuple[str, ...]) -> Iterator[Counter[str]]:
    """Counts the calls of some methods of a class."""
    calls: Counter[str] = Counter()
    with monkeypatch.context() as patch:
        for name in names:
            original = getattr(owner, name)

            def wrapped(*args: Any, _name: str = name, _original: Any = original, **kwargs: Any) -> Any:
                calls[_name] += 1
                return _original(*args, **kwargs)

            patch.setattr(owner, name, wrapped)
        yield calls


def test_draw_reads_nothing_back(monkeypatch: pytest.MonkeyPatch) -> None:
    with glc.Renderer(small_scene(), SMALL, quality="draft", backend=BACKEND, aovs=("depth_m",)) as renderer:
        renderer.render(time=0.0)
        with (
            counted(monkeypatch, moderngl.Texture, ("read", "read_into")) as textures,
            counted(monkeypatch, moderngl.Framebuffer, ("read", "read_into")) as framebuffers,
            counted(monkeypatch, moderngl.Buffer, ("read", "read_into")) as buffers,
        ):
            renderer.draw(time=0.1)
            assert not textures and not framebuffers and not buffers
            renderer.render(time=0.1)
            assert textures["read"] > 0  # the counter counts


def test_a_sequence_reuses_its_buffers(monkeypatch: pytest.MonkeyPatch) -> None:
    """pool's water moves: frames differ, and from the second frame on nothing is created on the GPU."""
    scene = glc.load_scene("pool")
    made = ("texture", "buffer", "framebuffer", "vertex_array")
    with glc.Renderer(scene, SMALL, quality="draft", backend=BACKEND) as renderer:
        images = [renderer.render(time=t).image for t in (0.0, 0.1)]
        with (
            counted(monkeypatch, Device, made) as calls,
            counted(
                monkeypatch, moderngl.Context, ("texture", "buffer", "framebuffer", "vertex_array", "program", "query")
            ) as raw,
        ):
            images += [renderer.render(time=t).image for t in (0.2, 0.3, 0.4)]
        assert not calls, calls
        assert not raw, raw
    for a, b in zip(images, images[1:], strict=False):
        assert np.abs(a - b).max() > 0.0


def test_drawing_to_a_target_creates_nothing(host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    target = host.ctx.framebuffer([host.ctx.texture(SMALL, 4)])
    with glc.Renderer(small_scene(), SMALL, quality="draft", context=host.ctx, target=target) as renderer:
        renderer.draw(time=0.0)
        renderer.draw(time=0.1)
        with counted(monkeypatch, moderngl.Context, ("texture", "buffer", "framebuffer", "vertex_array")) as raw:
            renderer.draw(time=0.2)
        assert not raw, raw


# -- determinism ------------------------------------------------------------------------------------------------------


@pytest.mark.smoke
def test_one_seed_gives_one_picture() -> None:
    first, again = (
        shoot(small_scene(), SMALL, quality="draft", specular_view=True, seed=3, aovs=("caustic_irradiance",))
        for _ in range(2)
    )
    assert np.array_equal(first.image, again.image)
    assert np.array_equal(first.aov["caustic_irradiance"], again.aov["caustic_irradiance"])


def test_a_frame_does_not_depend_on_the_frames_before() -> None:
    """Time 0.3 at once and after two other frames; the same time twice, when light-space passes are kept."""
    scene = glc.load_scene("peer-pool")
    arguments: dict[str, Any] = {"size": SMALL, "quality": "draft", "backend": BACKEND}
    with glc.Renderer(scene, **arguments) as renderer:
        history = [renderer.render(time=t) for t in (0.0, 0.7, 0.3, 0.3)]
        steps = [renderer.render(time=t) for t in (0.0, 0.0)]
    assert np.array_equal(history[2].image, history[3].image)
    assert np.array_equal(history[0].image, steps[0].image) and np.array_equal(steps[0].image, steps[1].image)


def test_stats_are_json_and_name_what_ran() -> None:
    frame = shoot(small_scene(), SMALL, quality="draft", specular_view=True, aovs=tuple(AOVS))
    stats = json.loads(json.dumps(frame.stats, allow_nan=False))
    assert stats["backend"] == BACKEND and stats["method"] == "caustic_map" and stats["size"] == list(SMALL)
    assert all(p["ms"] is None or p["ms"] >= 0.0 for p in stats["passes"])
    assert all(p["bytes"] > 0 for p in stats["passes"])
    assert stats["frame_ms"] > 0.0 and 0.0 <= stats["lost_flux"] < 0.5
    for solve in stats["solves"]:
        assert solve["rays"] >= solve["converged"] + solve["bracketed"] >= 0
        assert solve["flux_landed"] + solve["flux_lost"] <= solve["flux"] * (1.0 + 1e-6)


def test_without_stats_nothing_is_solved_twice_and_the_picture_is_the_same() -> None:
    with_stats, without = (
        shoot(small_scene(), SMALL, quality="draft", specular_view=True, stats=flag, aovs=()) for flag in (True, False)
    )
    assert np.array_equal(with_stats.image, without.image)
    assert with_stats.stats["solves"] and not without.stats["solves"]


def test_exposure_scales_the_picture_not_the_radiance() -> None:
    frames = [
        shoot(replace(small_scene(), exposure=e), SMALL, quality="draft", specular_view=True, aovs=())
        for e in (0.1, 1.0)
    ]
    assert np.array_equal(frames[0].image, frames[1].image)
    assert frames[0].ldr.mean() < frames[1].ldr.mean()
