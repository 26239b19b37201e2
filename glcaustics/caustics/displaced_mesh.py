"""Displaced caustic mesh (Mayer, Assarsson, Sintorn 2026): a grid over the casters' view, drawn where its light lands.

Beyond the paper: any caster mesh, solids and mirrors; exact areas; sheets that overlap are summed; the signed
determinant of the light map, interpolated, not one area ratio a triangle; what triangles cannot show (edges, slivers,
the last texel before a fold) is splatted with its flux: none is dropped; cube maps; every loss of the solve counted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from glcaustics.caustics.branches import REFLECT, Branch, read_rgba32f
from glcaustics.caustics.light_solve import SPLAT_SIGMA, LightMapMethod
from glcaustics.gpu import Program
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup, LightSetup
from glcaustics.passes.receiver_views import ReceiverView
from glcaustics.passes.runner import PlanRunner

SHADERS = "caustics/displaced_mesh"
FACED_STAGES = ("vertex", "cell", "mesh")  # which carry vertices over to another face of a cube
WARPED_STAGES = ("vertex", "cell", "leftover")


class DisplacedMesh(LightMapMethod):
    """See the module."""

    name = "displaced_mesh"
    warps = True
    boxed_splats = True
    summary = "a mesh over water, glass and mirrors as the light sees them, drawn where its light lands"
    paper = "Mayer, Assarsson, Sintorn 2026: Ultrafast Screen-Space Refractions and Caustics via Newton's Method"
    ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        quality: {
            "caster_size": caster, "map_size": map_size, "max_iterations": iterations, "march_steps": steps,
            "gather_taps": taps, "internal_bounces": bounces, "max_radius": radius,
        }
        for quality, caster, map_size, iterations, steps, taps, bounces, radius in (
            ("draft", 96, 256, 6, 12, 1, 2, 16.0),
            ("low", 160, 384, 8, 16, 1, 4, 24.0),
            ("medium", 256, 768, 10, 24, 2, 16, 32.0),
            ("high", 512, 1024, 12, 48, 4, 24, 48.0),
            ("reference", 1536, 2048, 16, 96, 6, 32, 48.0),
        )
    }  # fmt: skip
    option_help: ClassVar[Mapping[str, str]] = {
        **LightMapMethod.option_help,
        "caster_size": "the mesh over the casters' light view has about this^2 vertices (8..8192)",
        "fold_width": "cells wider than this are drawn as triangles even beside a fold, texels of the map (0..16)",
        "change": "beside a fold, relative change of the density over a texel that triangles may show (0..100)",
        "sharpen": "make up for the blur of the bilinear look-up (true, false)",
    }
    defaults: ClassVar[Mapping[str, Any]] = {
        **LightMapMethod.defaults,
        "fold_width": 2.0,
        "change": 0.3,
        "sharpen": True,
    }
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {
        **LightMapMethod.ranges,
        "fold_width": (0, 16),
        "change": (0, 100),
    }

    flags: ClassVar[tuple[str, ...]] = (*LightMapMethod.flags, "sharpen")

    # -- declaration --------------------------------------------------------------------------------------------------

    def declare_map(
        self, graph: FrameGraph, setup: FrameSetup, light: LightSetup, receiver: ReceiverView, branches: list[Branch]
    ) -> None:
        for branch in branches:
            self._declare_grid(graph, light, receiver, branch)
        textures = [b.resource(n) for b in branches for n in ("projected", "vertex", "cell", "drawn", "splat", "conic")]
        desc = self.map_desc(light, receiver)
        final = self.map_resource(light, receiver)
        raw = light.resource(f"{self.name}.{receiver.name}.raw") if setup.options["sharpen"] else final
        graph.add(
            PassDecl(
                f"{self.name}.draw.{receiver.name}{light.resource('')}",
                {raw: desc},
                lambda ctx: self._draw(ctx, light, receiver, branches, raw),
                reads=(
                    *textures,
                    *(b.flux for b in branches),
                    *(b.landing for b in branches),
                    *self.warp_reads(light, receiver),
                ),
                note="the displaced meshes added up in the caustic map",
            )
        )
        if raw != final:
            graph.add(
                PassDecl(
                    f"{self.name}.sharpen.{receiver.name}{light.resource('')}",
                    {final: desc},
                    lambda ctx: self._sharpen(ctx, receiver, raw, final),
                    reads=(raw,),
                    note="what the bilinear look-up will blur",
                )
            )

    def _declare_grid(self, graph: FrameGraph, light: LightSetup, receiver: ReceiverView, branch: Branch) -> None:
        """Five small passes over the grid of vertices."""
        assert light.caster is not None
        size = light.caster.size
        projected, exact, vertex, axes, cell, weight, drawn = (
            branch.resource(n) for n in ("projected", "exact", "vertex", "axes", "cell", "weight", "drawn")
        )

        def add(stage: str, writes: tuple[str, ...], reads: tuple[str, ...], unit: str, note: str) -> None:
            graph.add(
                PassDecl(
                    branch.pass_name(stage),
                    {name: TextureDesc("rgba32f", size, unit) for name in writes},
                    lambda ctx: self._grid_pass(ctx, light, receiver, branch, stage, writes),
                    reads=reads,
                    note=note,
                )
            )

        caster = (light.resource("caster.position_ws"), light.resource("caster.normal_ws"))
        landing, warp = branch.landing, self.warp_reads(light, receiver)
        add("project", (projected,), (landing, *caster), "texel", "landing points in texels of the map")
        add("vertex", (exact, axes), (projected, landing, *warp), "texel", "signed determinant of the light map")
        add("interpolant", (vertex,), (exact,), "texel", "determinant made fit to be interpolated")
        add(
            "cell",
            (cell, weight),
            (projected, vertex, landing, *warp),
            "1/texel^2",
            "which cells are drawn, and their densities",
        )
        add(
            "leftover",
            (branch.splat, branch.conic, drawn),
            (projected, vertex, axes, weight, branch.flux, *warp),
            "texel",
            "flux that is not drawn",
        )

    # -- execution ----------------------------------------------------------------------------------------------------

    def _grid_pass(
        self,
        ctx: PassContext,
        light: LightSetup,
        receiver: ReceiverView,
        branch: Branch,
        stage: str,
        writes: tuple[str, ...],
    ) -> None:
        program = self._program(ctx, light, receiver, branch, stage)
        textures: dict[str, tuple[str, ...]] = {
            "project": (),
            "vertex": ("projected",),
            "interpolant": ("exact",),
            "cell": ("projected", "vertex"),
            "leftover": ("projected", "vertex", "axes", "weight"),
        }
        program.set_all({f"t_{name}": ctx.texture(branch.resource(name)) for name in textures[stage]})
        if stage == "project":
            program.set(
                t_landing=ctx.texture(branch.landing),
                t_caster_position=ctx.texture(light.resource("caster.position_ws")),
                t_caster_normal=ctx.texture(light.resource("caster.normal_ws")),
                u_turn=2.0 if branch.kind == REFLECT else 0.5,
            )
        elif stage == "vertex":
            program.set(u_unit=_unit(light, branch))
        elif stage == "cell":
            program.set(
                u_fold_width=float(ctx.setup.options["fold_width"]), u_change=float(ctx.setup.options["change"])
            )
        elif stage == "leftover":
            program.set(
                t_flux=ctx.texture(branch.flux),
                u_sigma=SPLAT_SIGMA,
                u_max_radius=float(ctx.setup.options["max_radius"]),
            )
            if receiver.view.faces == 1:
                size = self.map_desc(light, receiver).size
                program.set(u_map_size=(float(size[0]), float(size[1])))
        ctx.device.draw_fullscreen(program, ctx.target(*writes))

    def _program(
        self, ctx: PassContext, light: LightSetup, receiver: ReceiverView, branch: Branch, stage: str
    ) -> Program:
        """The program of a stage, with what it needs of the views."""
        assert light.caster is not None
        view = receiver.view
        defines = {"RECEIVER_FACES": view.faces}
        if stage in ("vertex", "leftover"):
            defines["CASTER_FACES"] = light.caster.faces
        if stage in WARPED_STAGES:
            defines["WARP"] = self.warp_define(light, receiver)
        program = ctx.device.program(f"{SHADERS}/{stage}", defines)
        if stage in WARPED_STAGES:
            self.set_warp(program, ctx, light, receiver)
        program.set_all(view.uniforms("receiver"))
        if view.faces == 6 and stage in FACED_STAGES:
            program.set(t_landing=ctx.texture(branch.landing))
        return program

    def _draw(
        self, ctx: PassContext, light: LightSetup, receiver: ReceiverView, branches: list[Branch], raw: str
    ) -> None:
        assert light.caster is not None
        target = ctx.target(raw)
        target.clear(0.0, 0.0, 0.0, 0.0)
        width, height = light.caster.size
        view, size = receiver.view, self.map_desc(light, receiver).size
        for branch in branches:
            program = self._program(ctx, light, receiver, branch, "mesh")
            program.set_all({f"t_{name}": ctx.texture(branch.resource(name)) for name in ("vertex", "cell", "drawn")})
            program.set(u_width=width, u_map_size=(float(size[0]), float(size[1])))
            for face, viewport in enumerate(view.viewports() if view.faces == 6 else [(0, 0, *size)]):
                if view.faces == 6:
                    program.set(u_face=face, t_projected=ctx.texture(branch.resource("projected")))
                count = 2 * (width - 1) * (height - 1)
                ctx.device.draw_triangles(program, target, count, blend="add", viewport=viewport)
            self.draw_splats(ctx, light, receiver, branch, target)

    @staticmethod
    def _sharpen(ctx: PassContext, receiver: ReceiverView, raw: str, final: str) -> None:
        program = ctx.device.program(f"{SHADERS}/sharpen", {"RECEIVER_FACES": receiver.view.faces})
        program.set(t_raw=ctx.texture(raw))
        ctx.device.draw_fullscreen(program, ctx.target(final))

    # -- statistics ---------------------------------------------------------------------------------------------------

    def stats_resources(self) -> tuple[str, ...]:
        cells = tuple(
            b.resource(n) for branches in self._branches.values() for b in branches for n in ("cell", "splat")
        )
        return (*super().stats_resources(), *cells)

    def solve_stats(self, runner: PlanRunner) -> list[dict[str, Any]]:
        """As of every light map; also how much was drawn as triangles and as splats."""
        rows = super().solve_stats(runner)
        branches = [b for of_light in self._branches.values() for b in of_light]
        for row, branch in zip(rows, branches, strict=True):
            row.update(_drawn_statistics(branch, runner))
        return rows


def _unit(light: LightSetup, branch: Branch) -> float:
    """Texels of the map that a texel of the casters' view covers where light goes straight on."""
    assert light.caster is not None
    return math.sqrt(light.caster.texel_measure / light.receivers[branch.map_view].view.texel_measure)


def _drawn_statistics(branch: Branch, runner: PlanRunner) -> dict[str, Any]:
    """How the landed flux was drawn."""
    drawn = read_rgba32f(runner, branch.resource("cell"))[..., 0]
    splats = read_rgba32f(runner, branch.splat)[..., 2] > 0.0
    return {"triangles": int(2 * (drawn > 0.0).sum()), "splats": int(splats.sum())}
