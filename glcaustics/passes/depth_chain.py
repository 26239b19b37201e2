"""Bounds of an opaque layer's depth over cells of 4, 16 and 64 texels squared: what hierarchical marching skips by."""

from __future__ import annotations

from functools import partial

from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup


def _cells(size: tuple[int, int], texels: int) -> tuple[int, int]:
    return -(-size[0] // texels), -(-size[1] // texels)


def declare(graph: FrameGraph, setup: FrameSetup, layer: str = "") -> None:
    """The finest level, all levels in one texture, `depth_chain<layer>.bounds` (`glc_bounds_texel`), and of the first
    layer what is nearest around each cell of 16 x 16, `depth_chain.near` (`glc_way_above`).

    `layer`: suffix of an opaque layer of the G-buffer. Culled where nothing reads it.
    """
    chain = f"depth_chain{layer}"
    declare_over(graph, chain, f"gbuffer{layer}.plane", setup.size)
    if not layer:
        graph.add(
            PassDecl(
                "depth_chain.near",
                {"depth_chain.near": TextureDesc("rgba32f", _cells(setup.size, 16), "1/m")},
                partial(_execute_near, setup.size),
                reads=("depth_chain.bounds",),
                note="nearest depth in squares around 16 x 16 texels",
            )
        )


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


def _execute_near(size: tuple[int, int], ctx: PassContext) -> None:
    program = ctx.device.program("passes/depth_chain/near")
    program.set(t_bounds=ctx.texture("depth_chain.bounds"), u_origin=(_cells(size, 4)[0], 0), u_cells=_cells(size, 16))
    ctx.device.draw_fullscreen(program, ctx.target("depth_chain.near"))
