"""One draw call with exactly the state that it names."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import moderngl

from glcaustics.errors import ShaderError, UsageError
from glcaustics.gpu.program import Program
from glcaustics.gpu.texture import FramebufferInfo

_MODES = {
    "triangles": moderngl.TRIANGLES,
    "triangle_strip": moderngl.TRIANGLE_STRIP,
    "points": moderngl.POINTS,
    "lines": moderngl.LINES,
    "line_strip": moderngl.LINE_STRIP,
}
_BLENDS = {
    "add": ((moderngl.FUNC_ADD,) * 2, (moderngl.ONE, moderngl.ONE)),
    "alpha": ((moderngl.FUNC_ADD,) * 2, (moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA)),
    "min": ((moderngl.MIN,) * 2, (moderngl.ONE, moderngl.ONE)),
    "max": ((moderngl.MAX,) * 2, (moderngl.ONE, moderngl.ONE)),
}


def draw(
    ctx: moderngl.Context,
    array: moderngl.VertexArray,
    program: Program,
    fbo: moderngl.Framebuffer,
    *,
    mode: str,
    vertices: int,
    instances: int,
    first: int,
    depth_func: str | None,
    depth_write: bool,
    blend: str | None,
    cull: str | None,
    point_size: bool,
    viewport: tuple[int, int, int, int] | None,
) -> None:
    """See `Device.draw`."""
    if mode not in _MODES:
        raise UsageError(f"primitive mode '{mode}' is unknown", remedy=f"use one of {', '.join(_MODES)}")
    _check_feedback(program, fbo)
    with _framebuffer_state(fbo, viewport or (0, 0, *fbo.size), depth_write):
        fbo.use()
        ctx.enable_only(_set_state(ctx, depth_func, blend, cull, point_size))
        program.use()
        array.render(_MODES[mode], vertices=vertices, first=first, instances=instances)


@contextmanager
def _framebuffer_state(fbo: Any, viewport: tuple[int, int, int, int], depth_write: bool) -> Iterator[None]:
    """Viewport, scissor and masks for one draw. moderngl keeps them with each framebuffer object, and its `clear` obeys
    them too, so they are put back. Untyped, as moderngl's stubs do not know all that its setters take."""
    scissor = None if fbo.scissor == (0, 0, *fbo.size) else fbo.scissor
    kept = fbo.viewport, fbo.depth_mask, fbo.color_mask
    several = bool(kept[2]) and isinstance(kept[2][0], tuple)
    fbo.scissor = None
    fbo.viewport = viewport
    fbo.depth_mask = depth_write
    if kept[2]:  # a depth-only framebuffer has none to set
        fbo.color_mask = [(True,) * 4] * len(kept[2]) if several else (True,) * 4
    try:
        yield
    finally:
        fbo.scissor = scissor
        fbo.viewport, fbo.depth_mask = kept[:2]
        if kept[2]:
            fbo.color_mask = kept[2]


def _set_state(
    ctx: moderngl.Context, depth_func: str | None, blend: str | None, cull: str | None, point_size: bool
) -> int:
    flags = moderngl.PROGRAM_POINT_SIZE if point_size else moderngl.NOTHING
    if depth_func is not None:
        flags |= moderngl.DEPTH_TEST
        ctx.depth_func = depth_func
    if cull is not None:
        flags |= moderngl.CULL_FACE
        ctx.cull_face = cull
    if blend is not None:
        if blend not in _BLENDS:
            raise UsageError(f"blend '{blend}' is unknown", remedy=f"use one of {', '.join(_BLENDS)}")
        flags |= moderngl.BLEND
        ctx.blend_equation, ctx.blend_func = _BLENDS[blend]
    return flags


def _check_feedback(program: Program, fbo: moderngl.Framebuffer) -> None:
    sampled = program.sampled()
    for attachment in (*(fbo.color_attachments or ()), fbo.depth_attachment):
        if attachment is not None and attachment.glo in sampled:
            label = fbo.extra.label if isinstance(fbo.extra, FramebufferInfo) else "of the host"
            raise ShaderError(
                f"sampler '{sampled[attachment.glo]}' reads the texture that framebuffer '{label}' writes",
                where=program.label,
                remedy="write to another texture",
            )
