"""Bounds of the opaque layer's depth over 4 x 4 and 16 x 16 texels: what hierarchical marching skips by."""

from __future__ import annotations

from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.frame import FrameSetup, PassContext


def declare(graph: FrameGraph, setup: FrameSetup) -> None:
    """Two passes, one a level; culled where no pass marches hierarchically."""
    fine, coarse = ((-(-setup.size[0] // k), -(-setup.size[1] // k)) for k in (4, 16))
    graph.add(
        PassDecl(
            "depth_chain.4",
            {"depth_chain.bounds_4": TextureDesc("rg32f", fine, "1/m")},
            _execute_4,
            reads=("gbuffer.plane",),
            note="depth bounds of 4 x 4 texels",
        )
    )
    graph.add(
        PassDecl(
            "depth_chain.16",
            {"depth_chain.bounds_16": TextureDesc("rg32f", coarse, "1/m")},
            _execute_16,
            reads=("depth_chain.bounds_4",),
            note="depth bounds of 16 x 16 texels",
        )
    )


def _execute_4(ctx: PassContext) -> None:
    program = ctx.device.program("passes/depth_chain/bounds_4")
    program.set(t_plane=ctx.texture("gbuffer.plane"))
    ctx.device.draw_fullscreen(program, ctx.target("depth_chain.bounds_4"))


def _execute_16(ctx: PassContext) -> None:
    program = ctx.device.program("passes/depth_chain/bounds_16")
    program.set(t_bounds_4=ctx.texture("depth_chain.bounds_4"))
    ctx.device.draw_fullscreen(program, ctx.target("depth_chain.bounds_16"))
