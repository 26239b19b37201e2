"""From radiance to an 8-bit sRGB picture: exposure, AgX, sRGB."""

from __future__ import annotations

from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup

LOOK_POWER = 1.25  # AgX "punchy": power and saturation after the base contrast
LOOK_SATURATION = 1.25


def declare(graph: FrameGraph, setup: FrameSetup, radiance: str) -> None:
    """AgX (Sobotka 2022) of `radiance`, the resource to show."""
    graph.add(
        PassDecl(
            "tonemap",
            {"present.ldr": TextureDesc("rgba8", setup.size, "sRGB")},
            lambda ctx: _execute(ctx, radiance),
            reads=(radiance,),
            note="exposure, AgX, sRGB",
        )
    )


def _execute(ctx: PassContext, radiance: str) -> None:
    program = ctx.device.program(
        "passes/tonemap/tonemap", {"LOOK_POWER": LOOK_POWER, "LOOK_SATURATION": LOOK_SATURATION}
    )
    program.set(t_radiance=ctx.texture(radiance), u_exposure=ctx.frame.exposure)
    ctx.device.draw_fullscreen(program, ctx.target("present.ldr"))
