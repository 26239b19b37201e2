"""Bounds of the opaque layer's depth over 4 x 4 and 16 x 16 texels: what hierarchical marching skips by."""

from __future__ import annotations

from functools import partial

from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.frame import FrameSetup, PassContext


def declare(graph: FrameGraph, setup: FrameSetup, layer: str = "") -> None:
    """Two passes, one a level, of an opaque layer ("" or `gbuffer.SECOND`); culled where no pass marches over it."""
    source = f"gbuffer{layer}.plane"
    for cell in (4, 16):
        size = tuple(-(-n // cell) for n in setup.size)
        result = f"depth_chain{layer}.bounds_{cell}"
        graph.add(
            PassDecl(
                f"depth_chain{layer}.{cell}",
                {result: TextureDesc("rg32f", (size[0], size[1]), "1/m")},
                partial(_execute, cell, source, result),
                reads=(source,),
                note=f"depth bounds of {cell} x {cell} texels",
            )
        )
        source = result


def _execute(cell: int, source: str, result: str, ctx: PassContext) -> None:
    program = ctx.device.program(f"passes/depth_chain/bounds_{cell}")
    program.set_all({"t_plane" if cell == 4 else "t_bounds_4": ctx.texture(source)})
    ctx.device.draw_fullscreen(program, ctx.target(result))
