"""A guest leaves the host's OpenGL state as it found it, and is not disturbed by it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest

from glcaustics.gpu import Device, create_device, glsl_root
from glcaustics.gpu.rawgl import RawGL
from glcaustics.gpu.shader_source import FULLSCREEN_VERTEX

SWITCHES = (0x0BE2, 0x0B44, 0x0B71, 0x864F, 0x0B90, 0x0C11, 0x8037, 0x8642, 0x8C89, 0x8DB9)
INTEGERS = {
    "draw fbo": (0x8CA6, 1), "read fbo": (0x8CAA, 1), "viewport": (0x0BA2, 4), "scissor": (0x0C10, 4),
    "program": (0x8B8D, 1), "vertex array": (0x85B5, 1), "array buffer": (0x8894, 1), "unpack buffer": (0x88EF, 1),
    "active texture": (0x84E0, 1), "blend src rgb": (0x80C9, 1), "blend dst rgb": (0x80C8, 1),
    "blend src alpha": (0x80CB, 1), "blend dst alpha": (0x80CA, 1), "equation rgb": (0x8009, 1),
    "equation alpha": (0x883D, 1), "depth func": (0x0B74, 1), "depth mask": (0x0B72, 1), "cull": (0x0B45, 1),
    "front": (0x0B46, 1), "polygon mode": (0x0B40, 1), "unpack alignment": (0x0CF5, 1), "pack row length": (0x0D02, 1),
}  # fmt: skip
FLOATS = {"blend color": (0x8005, 4), "clear color": (0x0C22, 4), "offset": (0x8038, 1), "point size": (0x0B11, 1),
          "depth range": (0x0B70, 2)}  # fmt: skip


def state_of(raw: RawGL, units: int) -> dict[str, Any]:
    """What the host can see, asked of the driver itself."""
    found: dict[str, Any] = {f"switch {enum:#x}": bool(raw.glIsEnabled(enum)) for enum in SWITCHES}
    found |= {name: raw.integers(enum, max(count, 2))[:count] for name, (enum, count) in INTEGERS.items()}
    found |= {name: raw.floats(enum, count) for name, (enum, count) in FLOATS.items()}
    found["colour masks"] = [raw.booleans_indexed(0x0C23, i, 4) for i in range(4)]
    active = raw.integer(0x84E0)
    for unit in range(units):
        raw.glActiveTexture(0x84C0 + unit)
        found[f"unit {unit}"] = (raw.integer(0x8069), raw.integer(0x8514), raw.integer(0x8C1D), raw.integer(0x8919))
    raw.glActiveTexture(active)
    return found


class Host:
    """Somebody else's program, with OpenGL in as odd a state as it can be brought into."""

    def __init__(self) -> None:
        settings: dict[str, Any] = {"backend": "egl"}
        self.ctx = moderngl.create_context(standalone=True, **settings)
        self.raw = RawGL(self.ctx)
        self.textures = [self.ctx.texture((8, 8), 4) for _ in range(3)]
        self.depth = self.ctx.depth_texture((8, 8))
        self.fbo = self.ctx.framebuffer(self.textures[:1], self.depth)
        self.other = self.ctx.framebuffer(self.textures[1:2])
        self.sampler = self.ctx.sampler()
        self.buffer = self.ctx.buffer(b"x" * 64)
        self.program = self.ctx.program(
            vertex_shader="#version 330 core\nin vec2 p; void main() { gl_Position = vec4(p, 0, 1); }",
            fragment_shader="#version 330 core\nout vec4 c; void main() { c = vec4(1); }",
        )
        self.array = self.ctx.vertex_array(self.program, [(self.buffer, "2f", "p")])

    def make_odd(self) -> None:
        raw = self.raw
        self.fbo.viewport = (1, 2, 5, 3)
        self.fbo.scissor = (0, 1, 2, 2)
        self.fbo.use()
        for enum in SWITCHES:
            raw.glEnable(enum)
        raw.glBindFramebuffer(0x8CA8, self.other.glo)
        raw.glBlendFuncSeparate(0x0302, 0x0303, 1, 0x0304)
        raw.glBlendEquationSeparate(0x800A, 0x8007)
        raw.glBlendColor(0.25, 0.5, 0.75, 1.0)
        raw.glDepthFunc(0x0204)
        raw.glDepthMask(0)
        raw.glDepthRange(0.25, 0.75)
        raw.glCullFace(0x0404)
        raw.glFrontFace(0x0900)
        raw.glPolygonMode(0x0408, 0x1B01)
        raw.glPolygonOffset(3.0, 2.0)
        raw.glPointSize(4.0)
        raw.glClearColor(0.5, 0.25, 0.125, 1.0)
        raw.glColorMaski(0, 1, 0, 0, 1)
        raw.glColorMaski(1, 0, 1, 0, 1)
        raw.glPixelStorei(0x0CF5, 8)
        raw.glPixelStorei(0x0D02, 77)
        raw.glUseProgram(self.program.glo)
        raw.glBindVertexArray(self.array.glo)
        raw.glBindBuffer(0x8892, self.buffer.glo)
        raw.glBindBuffer(0x88EC, self.buffer.glo)
        for unit, texture in enumerate(self.textures):
            raw.glActiveTexture(0x84C0 + unit)
            raw.glBindTexture(0x0DE1, texture.glo)
        self.sampler.use(1)
        raw.glActiveTexture(0x84C0 + 2)


@pytest.fixture
def host() -> Iterator[Host]:
    opened = Host()
    yield opened
    opened.ctx.release()


@pytest.fixture
def guest(host: Host, tmp_path: Path) -> Iterator[Device]:
    (tmp_path / "interface").mkdir()
    (tmp_path / FULLSCREEN_VERTEX).write_text((glsl_root() / FULLSCREEN_VERTEX).read_text())
    (tmp_path / "x.frag").write_text(
        "uniform sampler2D t_a;\nin vec2 v_uv;\nlayout(location = 0) out vec4 color;\n"
        "void main() { color = texture(t_a, v_uv); }\n"
    )
    device = create_device(context=host.ctx, shader_root=tmp_path)
    yield device
    device.close()


def render(device: Device, target: moderngl.Framebuffer) -> np.ndarray:
    """A frame that touches all that a frame of ours may touch. Returns the picture it made."""
    source = device.texture((4, 4), "rgba32f", data=np.full((4, 4, 4), 0.5), label="source")
    depth = device.texture((8, 8), "depth24", label="depth")
    color = device.texture((8, 8), "rgba32f", label="color")
    own = device.framebuffer([color], depth, label="own")
    own.clear(depth=1.0)
    program = device.program("x").set(t_a=source)
    device.draw_fullscreen(program, own, blend="add")
    device.draw_fullscreen(program, own, blend="min", viewport=(0, 0, 4, 4))
    device.draw_fullscreen(program, target)
    image = device.read(color)
    for thing in (own, color, depth, source):
        thing.release()
    return image


def test_an_odd_host_is_restored_in_full(host: Host, guest: Device) -> None:
    host.make_odd()
    before = state_of(host.raw, 8)
    assert before["switch 0xbe2"] and before["scissor"] == (0, 1, 2, 2) and before["unit 1"][3] != 0
    with guest.guard_state():
        image = render(guest, host.fbo)
    after = state_of(host.raw, 8)
    assert {k: (v, after[k]) for k, v in before.items() if after[k] != v} == {}
    assert (image == 0.5).all(), "the host's state must not reach into our picture"
    guest.check_error("the frame")


def test_the_guest_draws_to_all_of_the_hosts_target(host: Host, guest: Device) -> None:
    host.make_odd()
    with guest.guard_state():
        render(guest, host.fbo)
        pixels = np.frombuffer(host.textures[0].read(), np.uint8)
    assert set(pixels.tolist()) <= {127, 128}, "scissor, viewport and masks of the host must not cut our picture"
    assert host.fbo.viewport == (1, 2, 5, 3) and host.fbo.scissor == (0, 1, 2, 2)
    assert host.ctx.fbo is host.fbo


def test_a_plain_host_is_restored_too(host: Host, guest: Device) -> None:
    host.fbo.use()
    before = state_of(host.raw, 8)
    with guest.guard_state():
        render(guest, host.other)
    assert state_of(host.raw, 8) == before
    assert host.ctx.fbo is host.fbo


def test_state_is_restored_after_an_exception(host: Host, guest: Device) -> None:
    host.make_odd()
    before = state_of(host.raw, 8)
    with pytest.raises(ZeroDivisionError), guest.guard_state():
        render(guest, host.fbo)
        raise ZeroDivisionError
    assert state_of(host.raw, 8) == before


def test_guards_nest(host: Host, guest: Device) -> None:
    host.make_odd()
    before = state_of(host.raw, 8)
    with guest.guard_state():
        clean = state_of(host.raw, 8)
        with guest.guard_state():
            render(guest, host.fbo)
        assert state_of(host.raw, 8) == clean != before
    assert state_of(host.raw, 8) == before


def test_moderngls_own_copy_of_the_switches_is_restored(host: Host, guest: Device) -> None:
    host.ctx.enable_only(moderngl.BLEND | moderngl.CULL_FACE)
    with guest.guard_state():
        render(guest, host.fbo)
    with host.ctx.scope(host.fbo, moderngl.DEPTH_TEST):
        assert not host.raw.glIsEnabled(0x0BE2)
    assert host.raw.glIsEnabled(0x0BE2) and host.raw.glIsEnabled(0x0B44) and not host.raw.glIsEnabled(0x0B71)
