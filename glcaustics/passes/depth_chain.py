"""Bounds of an opaque layer's depth over cells of 4, 16 and 64 texels squared: what hierarchical marching skips by."""

from __future__ import annotations

from functools import partial

from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup


def _cells(size: tuple[int, int], texels: int) -> tuple[int, int]:
    return -(-size[0] // texels), -(-size[1] // texels)


def declare(graph: FrameGraph, setup: FrameSetup, layer: str = "") -> None:
    """Two passes: the finest level, then all levels in one texture, `depth_chain<layer>.bounds` (`glc_bounds_texel`).

    `layer`: suffix of an opaque layer of the G-buffer. Culled where no pass marches over it.
    """
    declare_over(graph, f"depth_chain{layer}", f"gbuffer{layer}.plane", setup.size)


def declare_over(graph: FrameGraph, chain: str, planes: str, size: tuple[int, int], suffix: str = "") -> None:
    """The chain `<chain>.bounds<suffix>` over a texture of planes of any view. size: of that texture, texels."""
    fine, middle, coarse = (_cells(size, texels) for texels in (4, 16, 64))
    finest, levels = f"{chain}.bounds_4{suffix}", f"{chain}.bounds{suffix}"
    graph.add(
        PassDecl(
            f"{chain}.4{suffix}",
            {finest: TextureDesc("rg32f", fine, "1/m")},
            partial(_execute_finest, planes, finest),
            reads=(planes,),
            note="depth bounds of 4 x 4 texels",
        )
    )
    both = (fine[0] + middle[0], max(fine[1], middle[1] + coarse[1]))
    graph.add(
        PassDecl(
            f"{chain}.levels{suffix}",
            {levels: TextureDesc("rg32f", both, "1/m")},
            partial(_execute_levels, finest, levels, size),
            reads=(finest,),
            note="depth bounds of 4 x 4, 16 x 16 and 64 x 64 texels, side by side",
        )
    )


def _execute_finest(planes: str, finest: str, ctx: PassContext) -> None:
    program = ctx.device.program("passes/depth_chain/bounds_4")
    program.set(t_plane=ctx.texture(planes))
    ctx.device.draw_fullscreen(program, ctx.target(finest))


def _execute_levels(finest: str, levels: str, size: tuple[int, int], ctx: PassContext) -> None:
    right, above = _cells(size, 4)[0], _cells(size, 16)[1]
    for texels, origin in ((4, (0, 0)), (16, (right, 0)), (64, (right, above))):
        program = ctx.device.program("passes/depth_chain/levels", {"STEP": texels // 4})
        program.set(t_bounds_4=ctx.texture(finest), u_origin=origin)
        ctx.device.draw_fullscreen(program, ctx.target(levels), viewport=(*origin, *_cells(size, texels)))
