"""Where photons start: the strata of a light's view, and how these follow what photons brought in the last frames.

The unit square of the strata is warped onto the view by an inverse cumulative distribution over BLOCKS x BLOCKS blocks
(Meenrattanakorn, Lambers 2022, sec. 5, name luminance-driven sampling as future work). A photon's flux is divided by
the density of its block, so that the estimate stays unbiased; the density is never less than FLOOR of the even one.
"""

from __future__ import annotations

import math
from typing import Any

from glcaustics.caustics.branches import Branch
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.light_views import LightView

SHADERS = "caustics/photon_trace"
GOLDEN_3D = 1.2207440846057596  # root of x^4 = x + 1: the R3 sequence (Roberts 2018)
BLOCKS = 32  # a side of the light's view; of the edge of what is lit, blocks are wasted in part
FLOOR = 0.15  # of the even density; a photon's weight is at most 1 / FLOOR
FEWEST = 1 << 14  # photons below which blocks hold too few to tell anything: strata stay even


def photon_grid(photons: int, view: LightView) -> tuple[int, int]:
    """Columns and rows of strata over a light view: about `photons` in all, nearly square on the view."""
    step = (3, 2) if view.faces == 6 else (1, 1)
    columns = max(1, round(math.sqrt(photons * view.size[0] / view.size[1]) / step[0])) * step[0]
    return columns, max(1, round(photons / columns / step[1])) * step[1]


def sequence(index: int) -> tuple[float, float, float]:
    """Element of the R3 sequence, each in [0, 1)."""
    a = 1.0 / GOLDEN_3D
    return (index * a) % 1.0, (index * a * a) % 1.0, (index * a * a * a) % 1.0


def is_adaptive(options: Any) -> bool:
    """Whether strata follow the last frames."""
    return bool(options["adaptive"]) and int(options["photons"]) >= FEWEST


def strata_of(branch: Branch) -> str:
    """Cumulative shares of the photons: columns of each row, and in the last column the rows."""
    return branch.resource("strata")


def _contribution_of(branch: Branch) -> str:
    """Mean square of what a photon brings to the picture, a block, were photons even."""
    return branch.resource("contribution")


def declare(graph: FrameGraph, branch: Branch, landing: str) -> None:
    """The pass before a branch's trace, which turns the last frames' contributions into strata, and the one after."""
    strata, contribution = strata_of(branch), _contribution_of(branch)
    graph.add(
        PassDecl(
            branch.pass_name("strata"),
            {strata: TextureDesc("r32f", (BLOCKS + 1, BLOCKS))},
            lambda ctx: _strata(ctx, contribution, strata),
            history=(contribution,),
            note=f"where {branch.words} photons are wanted",
            view_dependent=True,
        )
    )
    graph.add(
        PassDecl(
            branch.pass_name("contribution"),
            {contribution: TextureDesc("r32f", (BLOCKS, BLOCKS), "lx^2")},
            lambda ctx: _contribution(ctx, landing, branch.flux, strata, contribution),
            reads=(landing, branch.flux, strata),
            history=(contribution,),
            note=f"what {branch.words} photons brought",
            view_dependent=True,
        )
    )


def _strata(ctx: PassContext, contribution: str, strata: str) -> None:
    program = ctx.device.program(f"{SHADERS}/strata", {"BLOCKS": BLOCKS, "FLOOR": FLOOR})
    program.set(t_contribution=ctx.history(contribution))
    ctx.device.draw_fullscreen(program, ctx.target(strata))


def _contribution(ctx: PassContext, landing: str, flux: str, strata: str, contribution: str) -> None:
    program = ctx.device.program(f"{SHADERS}/contribution", {"BLOCKS": BLOCKS})
    program.set(
        t_landing=ctx.texture(landing),
        t_flux=ctx.texture(flux),
        t_strata=ctx.texture(strata),
        t_previous=ctx.history(contribution),
    )
    ctx.device.draw_fullscreen(program, ctx.target(contribution))
