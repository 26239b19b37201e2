"""Caustics mapping (Shah, Konttinen, Pattanaik 2007): one sample a light-space texel, splatted where its light lands.

Beyond the paper: exact flux of a texel, exact Fresnel, splats that follow the local stretch, views fitted to where the
light lands, a bracketing fallback for what the fixed point misses, refraction and reflection of the same texel, and
every loss counted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from glcaustics.caustics.branches import REFLECT, Branch
from glcaustics.caustics.light_solve import SPLAT_SIGMA, LightMapMethod
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup, LightSetup
from glcaustics.passes.receiver_views import CORE, ReceiverView

SHADERS = "caustics/caustic_map"


class CausticMap(LightMapMethod):
    """See the module."""

    name = "caustic_map"
    summary = "light-space samples of water, glass and mirrors, splatted where their light lands"
    paper = "Shah, Konttinen, Pattanaik 2007: Caustics Mapping: An Image-space Technique for Real-time Caustics"
    ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "draft": {
            "caster_size": 96,
            "map_size": 192,
            "max_iterations": 6,
            "march_steps": 12,
            "gather_taps": 1,
            "internal_bounces": 2,
            "max_radius": 8.0,
        },
        "low": {
            "caster_size": 160,
            "map_size": 320,
            "max_iterations": 8,
            "march_steps": 16,
            "gather_taps": 1,
            "internal_bounces": 4,
            "max_radius": 12.0,
        },
        "medium": {
            "caster_size": 288,
            "map_size": 512,
            "max_iterations": 10,
            "march_steps": 24,
            "gather_taps": 2,
            "internal_bounces": 16,
            "max_radius": 16.0,
        },
        "high": {
            "caster_size": 768,
            "map_size": 1024,
            "max_iterations": 12,
            "march_steps": 48,
            "gather_taps": 4,
            "internal_bounces": 24,
            "max_radius": 32.0,
        },
        "reference": {
            "caster_size": 2048,
            "map_size": 2048,
            "max_iterations": 16,
            "march_steps": 96,
            "gather_taps": 6,
            "internal_bounces": 32,
            "max_radius": 48.0,
        },
    }
    option_help: ClassVar[Mapping[str, str]] = {
        **LightMapMethod.option_help,
        "naive_flux": "the paper's N.L / V flux instead of the exact one, as a baseline (true, false)",
    }
    defaults: ClassVar[Mapping[str, Any]] = {**LightMapMethod.defaults, "naive_flux": False}
    flags: ClassVar[tuple[str, ...]] = (*LightMapMethod.flags, "naive_flux")

    def declare_map(
        self, graph: FrameGraph, setup: FrameSetup, light: LightSetup, receiver: ReceiverView, branches: list[Branch]
    ) -> None:
        for branch in branches:
            self._declare_footprint(graph, light, branch)
        resource = self.map_resource(light, receiver)
        graph.add(
            PassDecl(
                f"caustic_map.splat.{receiver.name}{light.resource('')}",
                {resource: TextureDesc("rgba32f", receiver.view.size, "lm")},
                lambda ctx: self._splat(ctx, light, receiver, branches),
                reads=tuple(r for b in branches for r in (b.splat, b.conic, b.flux)),
                note="the light added up in the caustic map",
            )
        )

    def _declare_footprint(self, graph: FrameGraph, light: LightSetup, branch: Branch) -> None:
        assert light.caster is not None
        size = light.caster.size
        graph.add(
            PassDecl(
                branch.pass_name("footprint"),
                {branch.splat: TextureDesc("rgba32f", size, "texel"), branch.conic: TextureDesc("rgba32f", size)},
                lambda ctx: self._footprint(ctx, light, branch),
                reads=(
                    branch.landing,
                    light.resource("caster.position_ws"),
                    light.resource("caster.normal_ws"),
                    *((replace(branch, zone="").splat,) if branch.zone else ()),
                ),
                note="how far it is spread there",
            )
        )

    # -- execution ----------------------------------------------------------------------------------------------------

    def _footprint(self, ctx: PassContext, light: LightSetup, branch: Branch) -> None:
        view = light.receivers[branch.map_view].view
        assert light.caster is not None
        turn = 2.0 if branch.kind == REFLECT else 0.5
        tier = branch.zone.count(CORE)
        cores = [r for r in light.receivers.values() if r.base == branch.view and r.name != r.base] if tier == 0 else []
        defines = {
            "RECEIVER_FACES": view.faces,
            "CASTER_FACES": light.caster.faces,
            "CORES": len(cores),
            "TIER": tier,
            "TURN": turn,
        }
        program = ctx.device.program(f"{SHADERS}/footprint", defines)
        if cores:
            texels = [math.sqrt(view.texel_measure / core.view.texel_measure) for core in cores]
            program.set(
                u_core_clip_from_world=np.array([core.view.matrices[0] for core in cores]),
                u_core_texels=np.array(texels),
                u_core_size=np.array([core.view.size for core in cores], np.float64),
            )
        if tier > 0:
            program.set(t_tiers=ctx.texture(replace(branch, zone="").splat))
        program.set_all(
            {
                "t_landing": ctx.texture(branch.landing),
                "t_caster_position": ctx.texture(light.resource("caster.position_ws")),
                "t_caster_normal": ctx.texture(light.resource("caster.normal_ws")),
                **view.uniforms("receiver"),
                "u_sigma": SPLAT_SIGMA,
                "u_max_radius": float(ctx.setup.options["max_radius"]),
            }
        )
        ctx.device.draw_fullscreen(program, ctx.target(branch.splat, branch.conic))

    def _splat(self, ctx: PassContext, light: LightSetup, receiver: ReceiverView, branches: list[Branch]) -> None:
        target = ctx.target(self.map_resource(light, receiver))
        target.clear(0.0, 0.0, 0.0, 0.0)
        for branch in branches:
            self.draw_splats(ctx, light, receiver, branch, target)
