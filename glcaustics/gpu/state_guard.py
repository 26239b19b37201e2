"""A guest's manners: note the host's OpenGL state, start from a clean one, and put everything back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from glcaustics.gpu import gl_enums as gl
from glcaustics.gpu.rawgl import RawGL

#: Switches that moderngl or our passes may touch, or that would spoil them if the host left them on.
_SWITCHES = (
    gl.BLEND, gl.CULL_FACE, gl.DEPTH_TEST, gl.DEPTH_CLAMP, gl.STENCIL_TEST, gl.SCISSOR_TEST, gl.POLYGON_OFFSET_FILL,
    gl.PROGRAM_POINT_SIZE, gl.RASTERIZER_DISCARD, gl.FRAMEBUFFER_SRGB, gl.PRIMITIVE_RESTART, gl.COLOR_LOGIC_OP,
    gl.SAMPLE_ALPHA_TO_COVERAGE, gl.MULTISAMPLE, gl.DITHER, gl.TEXTURE_CUBE_MAP_SEAMLESS, gl.CLIP_DISTANCE0,
)  # fmt: skip
_ON_WHEN_CLEAN = (gl.MULTISAMPLE, gl.DITHER, gl.TEXTURE_CUBE_MAP_SEAMLESS)
#: texture target -> the enum that asks for its binding
_TARGETS = {
    gl.TEXTURE_2D: gl.TEXTURE_BINDING_2D,
    gl.TEXTURE_CUBE_MAP: gl.TEXTURE_BINDING_CUBE_MAP,
    gl.TEXTURE_2D_ARRAY: gl.TEXTURE_BINDING_2D_ARRAY,
    gl.TEXTURE_3D: gl.TEXTURE_BINDING_3D,
}
#: pixel storage -> its value when clean
_PIXEL_STORE = {
    gl.UNPACK_ALIGNMENT: 4, gl.UNPACK_ROW_LENGTH: 0, gl.UNPACK_SKIP_ROWS: 0, gl.UNPACK_SKIP_PIXELS: 0,
    gl.PACK_ALIGNMENT: 4, gl.PACK_ROW_LENGTH: 0, gl.PACK_SKIP_ROWS: 0, gl.PACK_SKIP_PIXELS: 0,
}  # fmt: skip
#: buffer target -> the enum that asks for its binding
_BUFFERS = {
    gl.ARRAY_BUFFER: gl.ARRAY_BUFFER_BINDING,
    gl.PIXEL_UNPACK_BUFFER: gl.PIXEL_UNPACK_BUFFER_BINDING,
    gl.PIXEL_PACK_BUFFER: gl.PIXEL_PACK_BUFFER_BINDING,
    gl.UNIFORM_BUFFER: gl.UNIFORM_BUFFER_BINDING,
    gl.TRANSFORM_FEEDBACK_BUFFER: gl.TRANSFORM_FEEDBACK_BUFFER_BINDING,
}


class _State:
    """Everything noted at entry. One instance a guard, so that guards nest."""

    def __init__(self, raw: RawGL, units: tuple[int, ...], color_masks: int, clip_control: bool) -> None:
        self.raw = raw
        get = raw.integer
        self.switches = {enum: bool(raw.glIsEnabled(enum)) for enum in _SWITCHES}
        self.framebuffers = (get(gl.DRAW_FRAMEBUFFER_BINDING), get(gl.READ_FRAMEBUFFER_BINDING))
        self.renderbuffer = get(gl.RENDERBUFFER_BINDING)
        self.viewport, self.scissor = raw.integers(gl.VIEWPORT, 4), raw.integers(gl.SCISSOR_BOX, 4)
        self.program, self.vertex_array = get(gl.CURRENT_PROGRAM), get(gl.VERTEX_ARRAY_BINDING)
        self.buffers = {target: get(binding) for target, binding in _BUFFERS.items()}
        self.blend_func = [
            get(enum) for enum in (gl.BLEND_SRC_RGB, gl.BLEND_DST_RGB, gl.BLEND_SRC_ALPHA, gl.BLEND_DST_ALPHA)
        ]
        self.blend_equation = (get(gl.BLEND_EQUATION_RGB), get(gl.BLEND_EQUATION_ALPHA))
        self.blend_color = raw.floats(gl.BLEND_COLOR, 4)
        self.depth_func, self.depth_mask = get(gl.DEPTH_FUNC), get(gl.DEPTH_WRITEMASK)
        self.depth_range = raw.doubles(gl.DEPTH_RANGE, 2)
        self.cull, self.front = get(gl.CULL_FACE_MODE), get(gl.FRONT_FACE)
        self.polygon_mode = raw.integers(gl.POLYGON_MODE, 2)[0]
        self.polygon_offset = (raw.floats(gl.POLYGON_OFFSET_FACTOR)[0], raw.floats(gl.POLYGON_OFFSET_UNITS)[0])
        self.point_size, self.line_width = raw.floats(gl.POINT_SIZE)[0], raw.floats(gl.LINE_WIDTH)[0]
        self.clear_color, self.clear_depth = raw.floats(gl.COLOR_CLEAR_VALUE, 4), raw.doubles(gl.DEPTH_CLEAR_VALUE)[0]
        self.color_masks = [raw.booleans_indexed(gl.COLOR_WRITEMASK, i, 4) for i in range(color_masks)]
        self.pixel_store = [get(enum) for enum in _PIXEL_STORE]
        self.clip_control = (get(gl.CLIP_ORIGIN), get(gl.CLIP_DEPTH_MODE)) if clip_control else None
        self.active_texture = get(gl.ACTIVE_TEXTURE)
        self.bindings: list[tuple[int, int, list[tuple[int, int]]]] = []
        for unit in units:
            raw.glActiveTexture(gl.TEXTURE0 + unit)
            textures = [(target, get(binding)) for target, binding in _TARGETS.items()]
            self.bindings.append((unit, get(gl.SAMPLER_BINDING), textures))
        raw.glActiveTexture(self.active_texture)

    def clean(self) -> None:
        """The state a fresh context has, as far as it could change what our passes draw."""
        raw = self.raw
        for enum in _SWITCHES:
            (raw.glEnable if enum in _ON_WHEN_CLEAN else raw.glDisable)(enum)
        raw.glBlendFuncSeparate(moderngl.ONE, moderngl.ZERO, moderngl.ONE, moderngl.ZERO)
        raw.glBlendEquationSeparate(gl.FUNC_ADD, gl.FUNC_ADD)
        raw.glDepthFunc(gl.LEQUAL)
        raw.glDepthMask(1)
        raw.glDepthRange(0.0, 1.0)
        raw.glCullFace(gl.BACK)
        raw.glFrontFace(gl.CCW)
        raw.glPolygonMode(gl.FRONT_AND_BACK, gl.FILL)
        raw.glPolygonOffset(0.0, 0.0)
        raw.glPointSize(1.0)
        raw.glColorMask(1, 1, 1, 1)
        for target in (gl.PIXEL_UNPACK_BUFFER, gl.PIXEL_PACK_BUFFER):
            raw.glBindBuffer(target, 0)
        for enum, value in _PIXEL_STORE.items():
            raw.glPixelStorei(enum, value)
        if self.clip_control:
            raw.glClipControl(gl.LOWER_LEFT, gl.NEGATIVE_ONE_TO_ONE)
        for unit, sampler, _ in self.bindings:
            if sampler:
                raw.glBindSampler(unit, 0)

    def restore(self) -> None:
        """Put back what was noted."""
        raw = self.raw
        for unit, sampler, textures in self.bindings:
            raw.glActiveTexture(gl.TEXTURE0 + unit)
            for target, texture in textures:
                raw.glBindTexture(target, texture)
            raw.glBindSampler(unit, sampler)
        raw.glActiveTexture(self.active_texture)
        raw.glBindFramebuffer(gl.DRAW_FRAMEBUFFER, self.framebuffers[0])
        raw.glBindFramebuffer(gl.READ_FRAMEBUFFER, self.framebuffers[1])
        raw.glBindRenderbuffer(gl.RENDERBUFFER, self.renderbuffer)
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
        raw.glPolygonMode(gl.FRONT_AND_BACK, self.polygon_mode)
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
    gl.BLEND: moderngl.BLEND, gl.DEPTH_TEST: moderngl.DEPTH_TEST, gl.CULL_FACE: moderngl.CULL_FACE,
    gl.RASTERIZER_DISCARD: moderngl.RASTERIZER_DISCARD, gl.PROGRAM_POINT_SIZE: moderngl.PROGRAM_POINT_SIZE,
}  # fmt: skip


@contextmanager
def guard_state(ctx: moderngl.Context, raw: RawGL, units: int, resting: moderngl.Framebuffer | None) -> Iterator[None]:
    """See `Device.guard_state`.

    Args:
        units: how many texture units our programs may use.
        resting: a framebuffer that outlives ours, for moderngl to hold on to where the host has used none.
    """
    framebuffer = ctx.fbo
    color_masks = min(raw.integer(gl.MAX_DRAW_BUFFERS), 8)
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
