"""A guest's manners: note the host's OpenGL state, start from a clean one, and put everything back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from glcaustics.gpu.rawgl import RawGL

#: Switches that moderngl or our passes may touch, or that would spoil them if the host left them on.
_SWITCHES = {
    "BLEND": 0x0BE2, "CULL_FACE": 0x0B44, "DEPTH_TEST": 0x0B71, "DEPTH_CLAMP": 0x864F, "STENCIL_TEST": 0x0B90,
    "SCISSOR_TEST": 0x0C11, "POLYGON_OFFSET_FILL": 0x8037, "PROGRAM_POINT_SIZE": 0x8642, "RASTERIZER_DISCARD": 0x8C89,
    "FRAMEBUFFER_SRGB": 0x8DB9, "PRIMITIVE_RESTART": 0x8F9D, "COLOR_LOGIC_OP": 0x0BF2, "ALPHA_TO_COVERAGE": 0x809E,
    "MULTISAMPLE": 0x809D, "DITHER": 0x0BD0, "TEXTURE_CUBE_MAP_SEAMLESS": 0x884F, "CLIP_DISTANCE0": 0x3000,
}  # fmt: skip
_ON_WHEN_CLEAN = ("MULTISAMPLE", "DITHER", "TEXTURE_CUBE_MAP_SEAMLESS")
#: texture target -> the enum that asks for its binding
_TARGETS = {0x0DE1: 0x8069, 0x8513: 0x8514, 0x8C1A: 0x8C1D, 0x806F: 0x806A}
#: UNPACK, then PACK: alignment, row length, skipped rows, skipped pixels
_PIXEL_STORE = (0x0CF5, 0x0CF2, 0x0CF3, 0x0CF4, 0x0D05, 0x0D02, 0x0D03, 0x0D04)
_PIXEL_STORE_CLEAN = (4, 0, 0, 0, 4, 0, 0, 0)
_DRAW_FRAMEBUFFER, _READ_FRAMEBUFFER = 0x8CA9, 0x8CA8
#: ARRAY, PIXEL_UNPACK, PIXEL_PACK, UNIFORM, TRANSFORM_FEEDBACK
_BUFFERS = {0x8892: 0x8894, 0x88EC: 0x88EF, 0x88EB: 0x88ED, 0x8A11: 0x8A28, 0x8C8E: 0x8C8F}
_ACTIVE_TEXTURE, _TEXTURE0, _SAMPLER_BINDING = 0x84E0, 0x84C0, 0x8919
_ONE, _ZERO, _FUNC_ADD = 1, 0, 0x8006
_CLIP_ORIGIN, _CLIP_DEPTH_MODE = 0x935C, 0x935D


class _State:
    """Everything noted at entry. One instance a guard, so that guards nest."""

    def __init__(self, raw: RawGL, units: tuple[int, ...], color_masks: int, clip_control: bool) -> None:
        self.raw = raw
        get = raw.integer
        self.switches = {enum: bool(raw.glIsEnabled(enum)) for enum in _SWITCHES.values()}
        self.framebuffers = (get(0x8CA6), get(0x8CAA))
        self.renderbuffer = get(0x8CA7)
        self.viewport, self.scissor = raw.integers(0x0BA2, 4), raw.integers(0x0C10, 4)
        self.program, self.vertex_array = get(0x8B8D), get(0x85B5)
        self.buffers = {target: get(binding) for target, binding in _BUFFERS.items()}
        self.blend_func = (get(0x80C9), get(0x80C8), get(0x80CB), get(0x80CA))
        self.blend_equation = (get(0x8009), get(0x883D))
        self.blend_color = raw.floats(0x8005, 4)
        self.depth_func, self.depth_mask, self.depth_range = get(0x0B74), get(0x0B72), raw.doubles(0x0B70, 2)
        self.cull, self.front = get(0x0B45), get(0x0B46)
        self.polygon_mode = raw.integers(0x0B40, 2)[0]
        self.polygon_offset = (raw.floats(0x8038)[0], raw.floats(0x2A00)[0])
        self.point_size, self.line_width = raw.floats(0x0B11)[0], raw.floats(0x0B21)[0]
        self.clear_color, self.clear_depth = raw.floats(0x0C22, 4), raw.doubles(0x0B73)[0]
        self.color_masks = [raw.booleans_indexed(0x0C23, i, 4) for i in range(color_masks)]
        self.pixel_store = [get(enum) for enum in _PIXEL_STORE]
        self.clip_control = (get(_CLIP_ORIGIN), get(_CLIP_DEPTH_MODE)) if clip_control else None
        self.active_texture = get(_ACTIVE_TEXTURE)
        self.bindings: list[tuple[int, int, list[tuple[int, int]]]] = []
        for unit in units:
            raw.glActiveTexture(_TEXTURE0 + unit)
            textures = [(target, get(binding)) for target, binding in _TARGETS.items()]
            self.bindings.append((unit, get(_SAMPLER_BINDING), textures))
        raw.glActiveTexture(self.active_texture)

    def clean(self) -> None:
        """The state a fresh context has, as far as it could change what our passes draw."""
        raw = self.raw
        for name, enum in _SWITCHES.items():
            (raw.glEnable if name in _ON_WHEN_CLEAN else raw.glDisable)(enum)
        raw.glBlendFuncSeparate(_ONE, _ZERO, _ONE, _ZERO)
        raw.glBlendEquationSeparate(_FUNC_ADD, _FUNC_ADD)
        raw.glDepthFunc(0x0203)
        raw.glDepthMask(1)
        raw.glDepthRange(0.0, 1.0)
        raw.glCullFace(0x0405)
        raw.glFrontFace(0x0901)
        raw.glPolygonMode(0x0408, 0x1B02)
        raw.glPolygonOffset(0.0, 0.0)
        raw.glPointSize(1.0)
        raw.glColorMask(1, 1, 1, 1)
        for target in (0x88EC, 0x88EB):
            raw.glBindBuffer(target, 0)
        for enum, value in zip(_PIXEL_STORE, _PIXEL_STORE_CLEAN, strict=True):
            raw.glPixelStorei(enum, value)
        if self.clip_control:
            raw.glClipControl(0x8CA1, 0x935E)  # LOWER_LEFT, NEGATIVE_ONE_TO_ONE
        for unit, sampler, _ in self.bindings:
            if sampler:
                raw.glBindSampler(unit, 0)

    def restore(self) -> None:
        """Put back what was noted."""
        raw = self.raw
        for unit, sampler, textures in self.bindings:
            raw.glActiveTexture(_TEXTURE0 + unit)
            for target, texture in textures:
                raw.glBindTexture(target, texture)
            raw.glBindSampler(unit, sampler)
        raw.glActiveTexture(self.active_texture)
        raw.glBindFramebuffer(_DRAW_FRAMEBUFFER, self.framebuffers[0])
        raw.glBindFramebuffer(_READ_FRAMEBUFFER, self.framebuffers[1])
        raw.glBindRenderbuffer(0x8D41, self.renderbuffer)
        raw.glUseProgram(self.program)
        raw.glBindVertexArray(self.vertex_array)
        for target, buffer in self.buffers.items():
            raw.glBindBuffer(target, buffer)
        raw.glViewport(*self.viewport)
        raw.glScissor(*self.scissor)
        self._restore_fixed_function()
        for enum, on in self.switches.items():
            (raw.glEnable if on else raw.glDisable)(enum)

    def _restore_fixed_function(self) -> None:
        raw = self.raw
        raw.glBlendFuncSeparate(*self.blend_func)
        raw.glBlendEquationSeparate(*self.blend_equation)
        raw.glBlendColor(*self.blend_color)
        raw.glDepthFunc(self.depth_func)
        raw.glDepthMask(self.depth_mask)
        raw.glDepthRange(*self.depth_range)
        raw.glCullFace(self.cull)
        raw.glFrontFace(self.front)
        raw.glPolygonMode(0x0408, self.polygon_mode)
        raw.glPolygonOffset(*self.polygon_offset)
        raw.glPointSize(self.point_size)
        raw.glLineWidth(self.line_width)
        raw.glClearColor(*self.clear_color)
        raw.glClearDepth(self.clear_depth)
        for i, mask in enumerate(self.color_masks):
            raw.glColorMaski(i, *mask)
        for enum, value in zip(_PIXEL_STORE, self.pixel_store, strict=True):
            raw.glPixelStorei(enum, value)
        if self.clip_control:
            raw.glClipControl(*self.clip_control)


#: moderngl keeps its own copy of these switches; a scope of the host would otherwise restore ours.
_MODERNGL_FLAGS = {
    0x0BE2: moderngl.BLEND, 0x0B71: moderngl.DEPTH_TEST, 0x0B44: moderngl.CULL_FACE,
    0x8C89: moderngl.RASTERIZER_DISCARD, 0x8642: moderngl.PROGRAM_POINT_SIZE,
}  # fmt: skip


@contextmanager
def guard_state(ctx: moderngl.Context, raw: RawGL, units: int, resting: moderngl.Framebuffer | None) -> Iterator[None]:
    """See `Device.guard_state`.

    Args:
        units: how many texture units our programs may use.
        resting: a framebuffer that outlives ours, for moderngl to hold on to where the host has used none.
    """
    framebuffer = ctx.fbo
    color_masks = min(raw.integer(0x8824), 8)
    state = _State(raw, (*range(units), ctx.default_texture_unit), color_masks, ctx.version_code >= 450)
    shadow = (ctx.front_face, ctx.cull_face, ctx.wireframe)
    state.clean()
    try:
        yield
    finally:
        ctx.front_face, ctx.cull_face, ctx.wireframe = shadow
        flags = 0
        for enum, flag in _MODERNGL_FLAGS.items():
            flags |= flag if state.switches[enum] else 0
        ctx.enable_only(flags)
        ctx.fbo = framebuffer
        kept = framebuffer if framebuffer is not None else resting
        if kept is not None and not isinstance(kept.mglo, moderngl.InvalidObject):
            ctx.mglo.fbo = kept.mglo
        state.restore()
