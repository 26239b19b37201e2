"""Cascaded image-space photon tracing (Meenrattanakorn, Lambers 2022): photons go from what the light sees of specular
surfaces through the light's view, then through the camera's, and are added up as irradiance at the camera's pixels.

Beyond the paper: photons are stratified and carry the exact flux of their stratum; ends are exact on tangent planes;
hierarchical marching; irradiance over the receiver's own area, so that energy holds on slanted receivers; refraction
and reflection weighted by Fresnel's equations instead of by chance (which is an option); solids, dispersion and
absorption; every loss counted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from glcaustics.caustics.branches import BRANCH_CODE, REFLECT, SOLID, Branch, branches_of, read_rgba32f
from glcaustics.caustics.method import IRRADIANCE, NOISY_IRRADIANCE, CausticsMethod
from glcaustics.errors import UsageError
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes import depth_chain, light_view
from glcaustics.passes.frame import FrameSetup, LightSetup, PassContext
from glcaustics.passes.light_views import LightView, light_uniforms
from glcaustics.passes.raster import raster_uniforms
from glcaustics.passes.runner import PlanRunner
from glcaustics.scene.model import Instance, OpticalKind

SHADERS = "caustics/photon_trace"
LANDED = {1: "by_light_view", 2: "by_eye_view"}
UNSEEN = {-9: "hidden_from_the_eye", -10: "outside_of_the_picture"}  # landed, but not where the picture shows it
LEFT = -8
LOST = {
    -1: "total_internal_reflection",
    -2: "hidden_from_the_light_and_the_eye",
    -3: "unresolved",
    -4: "no_exit_found",
    -5: "absorbed",
    -6: "normal_faces_away",
    -7: "met_another_specular_surface",
    -11: "scattered_between_facets",
}
CHOICES = {"fresnel": ("split", "chance"), "march": ("hierarchical", "dda")}
GOLDEN_3D = 1.2207440846057596  # root of x^4 = x + 1: the R3 sequence (Roberts 2018)


class PhotonTrace(CausticsMethod):
    """See the module."""

    name = "photon_trace"
    summary = (
        "photons marched through the light's view, then the camera's: reflective caustics that the light does not see"
    )
    paper = "Meenrattanakorn, Lambers 2022: Real-Time Caustics Using Cascaded Image-Space Photon Tracing"
    noisy = True
    noise_share = 0.4
    follows_size_and_roughness = True
    unbiased_options: ClassVar[Mapping[str, Any]] = {"denoise": False}
    ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        quality: {
            "photons": photons,
            "caster_size": caster,
            "map_size": receiver,
            "max_iterations": iterations,
            "march_steps": steps,
            "view_steps": view_steps,
            "internal_bounces": bounces,
            "denoise_passes": passes,
        }
        for quality, photons, caster, receiver, iterations, steps, view_steps, bounces, passes in (
            ("draft", 1 << 16, 192, 256, 6, 16, 64, 0, 4),
            ("low", 1 << 18, 384, 512, 8, 24, 96, 1, 4),
            ("medium", 1 << 19, 768, 768, 10, 32, 160, 2, 5),
            ("high", 1 << 20, 1024, 1024, 12, 48, 256, 4, 5),
            ("reference", 1 << 22, 2048, 2048, 16, 96, 1024, 8, 5),
        )
    }
    ranges: ClassVar[Mapping[str, tuple[int, int]]] = {
        "photons": (64, 1 << 24),
        "caster_size": (8, 8192),
        "map_size": (8, 8192),
        "max_iterations": (1, 64),
        "march_steps": (1, 512),
        "view_steps": (8, 16384),
        "internal_bounces": (0, 32),
        "denoise_passes": (1, 8),
        "history_frames": (1, 1024),
    }
    flags: ClassVar[tuple[str, ...]] = ("reflect", "dispersion", "denoise")
    option_help: ClassVar[Mapping[str, str]] = {
        "photons": "about this many start a frame, a light and kind of path (64..16777216)",
        "caster_size": "the casters' light view has about this^2 texels (8..8192)",
        "map_size": "the receivers' light view has about this^2 texels (8..8192)",
        "max_iterations": "of the intersection estimate in the light's view (1..64)",
        "march_steps": "of the march in the light's view where the estimate fails, and of reflected photons (1..512)",
        "view_steps": "of the march in the camera's view (8..16384)",
        "march": "in the camera's view: hierarchical, or dda: pixel by pixel, the paper's, as a baseline",
        "internal_bounces": "total reflections followed inside a solid (0..32)",
        "fresnel": "split: every photon is refracted and reflected, weighted; chance: one of both, drawn",
        "reflect": "follow light that water and glass throw back (true, false)",
        "dispersion": "refract red, green and blue apart where a material disperses (true, false)",
        "denoise": "filter over time and space (true, false); without, the estimate is unbiased and noisy",
        "denoise_passes": "a-trous passes of the filter (1..8)",
        "history_frames": "longest memory of the filter (1..1024)",
    }
    defaults: ClassVar[Mapping[str, Any]] = {
        "fresnel": "split",
        "march": "hierarchical",
        "reflect": True,
        "dispersion": True,
        "denoise": True,
        "history_frames": 64,
    }

    def __init__(self) -> None:
        self._traced: list[tuple[LightSetup, Branch]] = []

    @classmethod
    def validate(cls, options: Mapping[str, Any]) -> None:
        for name, (low, high) in cls.ranges.items():
            value = options[name]
            if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
                remedy = f"give a whole number from {low} to {high}"
                raise UsageError(f"option {name} is {value!r}", where=cls.name, remedy=remedy)
        for name, words in CHOICES.items():
            if options[name] not in words:
                remedy = f"use one of {', '.join(words)}"
                raise UsageError(f"option {name} is {options[name]!r}", where=cls.name, remedy=remedy)
        for name in cls.flags:
            if not isinstance(options[name], bool):
                raise UsageError(f"option {name} is {options[name]!r}", where=cls.name, remedy="use true or false")

    # -- declaration --------------------------------------------------------------------------------------------------

    def leave_out(self, graph: FrameGraph, setup: FrameSetup, because: str) -> None:
        for light in setup.lights:
            for name in ("caster_view", "receiver_view", "photon_trace.trace"):
                graph.leave_out(f"{name}{light.resource('')}", because)
        graph.leave_out("photon_trace.scatter", because)

    def declare(self, graph: FrameGraph, setup: FrameSetup) -> None:
        self._traced = []
        for light in setup.lights:
            branches = branches_of(setup, light, self.name) if light.caster is not None else []
            if not branches:
                graph.leave_out(f"photon_trace{light.resource('')}", "its light reaches no specular surface")
                continue
            self._declare_views(graph, setup, light, branches)
            for branch in branches:
                self._declare_trace(graph, setup, light, branch)
                self._traced.append((light, branch))
        output = NOISY_IRRADIANCE if setup.options["denoise"] else IRRADIANCE
        graph.add(
            PassDecl(
                "photon_trace.scatter",
                {output: self.irradiance_desc(setup)},
                lambda ctx: self._scatter(ctx, output),
                reads=tuple(r for _, b in self._traced for r in (landing_of(b), b.flux)),
                note="the photons added up at the camera's pixels",
                view_dependent=True,
            )
        )

    def _declare_views(self, graph: FrameGraph, setup: FrameSetup, light: LightSetup, branches: list[Branch]) -> None:
        light_view.declare_caster(graph, setup, light)
        for receiver in light.receivers.values():
            if any(branch.view == receiver.name for branch in branches):
                light_view.declare_receiver(graph, setup, light, receiver)
            if any(branch.view == receiver.name and branch.kind == REFLECT for branch in branches):
                plane = light.resource(f"receiver.{receiver.name}.plane")
                depth_chain.declare_over(
                    graph, f"depth_chain.{receiver.name}", plane, receiver.view.size, light.resource("")
                )
        if any(branch.kind == SOLID for branch in branches):
            light_view.declare_caster_back(graph, setup, light)
        else:
            graph.leave_out(f"caster_back{light.resource('')}", "nothing in the scene is a solid with two interfaces")

    def _declare_trace(self, graph: FrameGraph, setup: FrameSetup, light: LightSetup, branch: Branch) -> None:
        assert light.caster is not None
        size = photon_grid(int(setup.options["photons"]), light.caster)
        back = (light.resource("caster.back_position_ws"), light.resource("caster.back_normal_ws"))
        graph.add(
            PassDecl(
                branch.pass_name("trace"),
                {
                    landing_of(branch): TextureDesc("rgba32f", size, "px"),
                    branch.flux: TextureDesc("rgba32f", size, "lm"),
                },
                lambda ctx: self._trace(ctx, light, branch),
                reads=(
                    light.resource("caster.position_ws"),
                    light.resource("caster.normal_ws"),
                    *_light_reads(light, branch).values(),
                    "gbuffer.plane",
                    *_march_reads(setup).values(),
                    *(back if branch.kind == SOLID else ()),
                ),
                note=f"where {branch.words} photons land",
                view_dependent=True,
            )
        )

    # -- execution ----------------------------------------------------------------------------------------------------

    def _trace(self, ctx: PassContext, light: LightSetup, branch: Branch) -> None:
        assert light.caster is not None
        view = light.receivers[branch.view].view
        options = ctx.setup.options
        defines = {
            "CASTER_FACES": light.caster.faces,
            "RECEIVER_FACES": view.faces,
            "BRANCH": BRANCH_CODE[branch.kind],
            "CHANCE": int(options["fresnel"] == "chance"),
            "DDA": int(options["march"] == "dda"),
            "SIZED": int(light.light.has_size),
            "ROUGH": int(has_rough_casters(ctx.setup.instances())),
            "HAS_MIRROR": int(branch.kind == REFLECT and OpticalKind.MIRROR in ctx.setup.kinds()),
        }
        program = ctx.device.program(f"{SHADERS}/trace", defines)
        if branch.kind == SOLID:
            program.set_all(self._solid_uniforms(ctx, light))
        if branch.kind == REFLECT:
            program.set(u_receiver_raster_from_world=view.raster_from_world())
        low, high = ctx.setup.bounds_ws
        program.set_all(
            {
                **ctx.frame.camera.uniforms(),
                **raster_uniforms(ctx.frame.camera, ctx.setup.size),
                **light.caster.uniforms("caster"),
                **view.uniforms("receiver"),
                **light_uniforms(light.light),
                "t_caster_position": ctx.texture(light.resource("caster.position_ws")),
                "t_caster_normal": ctx.texture(light.resource("caster.normal_ws")),
                "t_plane": ctx.texture("gbuffer.plane"),
                **{name: ctx.texture(resource) for name, resource in _march_reads(ctx.setup).items()},
                **{name: ctx.texture(resource) for name, resource in _light_reads(light, branch).items()},
                "t_objects": ctx.frame.gpu.objects,
                "u_photon_grid": photon_grid(int(options["photons"]), light.caster),
                "u_sequence": sequence(ctx.frame.index),
                "u_frame": ctx.frame.index % (1 << 31),
                "u_seed": (ctx.setup.seed * 31 + light.index) % (1 << 31),
                "u_bounds_min_ws": tuple(low),
                "u_bounds_max_ws": tuple(high),
                "u_channels": branch.channels,
                "u_channel": branch.channel,
                "u_max_iterations": int(options["max_iterations"]),
                "u_march_steps": int(options["march_steps"]),
                "u_view_steps": int(options["view_steps"]),
            }
        )
        ctx.device.draw_fullscreen(program, ctx.target(landing_of(branch), branch.flux))

    @staticmethod
    def _solid_uniforms(ctx: PassContext, light: LightSetup) -> dict[str, Any]:
        solids = [item.bounds_ws for item in ctx.frame.gpu.select(OpticalKind.SOLID)]
        return {
            "t_back_position": ctx.texture(light.resource("caster.back_position_ws")),
            "t_back_normal": ctx.texture(light.resource("caster.back_normal_ws")),
            "u_caster_min_ws": tuple(np.min([b[0] for b in solids], axis=0)),
            "u_caster_max_ws": tuple(np.max([b[1] for b in solids], axis=0)),
            "u_internal_bounces": int(ctx.setup.options["internal_bounces"]),
        }

    def _scatter(self, ctx: PassContext, output: str) -> None:
        target = ctx.target(output)
        target.clear(0.0, 0.0, 0.0, 0.0)
        program = ctx.device.program(f"{SHADERS}/scatter")
        for _, branch in self._traced:
            landing = ctx.texture(landing_of(branch))
            program.set_all(
                {
                    "t_landing": landing,
                    "t_flux": ctx.texture(branch.flux),
                    "u_width": landing.width,
                    "u_view_size": (float(ctx.setup.size[0]), float(ctx.setup.size[1])),
                }
            )
            ctx.device.draw_points(program, target, landing.width * landing.height, blend="add")

    # -- statistics ---------------------------------------------------------------------------------------------------

    def stats_resources(self) -> tuple[str, ...]:
        return tuple(r for _, b in self._traced for r in (landing_of(b), b.flux))

    def solve_stats(self, runner: PlanRunner) -> list[dict[str, Any]]:
        return [photon_statistics(branch, runner) for _, branch in self._traced]


def _march_reads(setup: FrameSetup) -> dict[str, str]:
    """Samplers and resources of the march in the camera's view, besides the planes."""
    if setup.options["march"] == "dda":
        return {"t_depth_m": "gbuffer.depth_m"}
    return {"t_bounds": "depth_chain.bounds"}


def _light_reads(light: LightSetup, branch: Branch) -> dict[str, str]:
    """Samplers and resources of the way through the light's view."""
    receiver = f"receiver.{branch.view}"
    if branch.kind == REFLECT:
        bounds = light.resource(f"depth_chain.{branch.view}.bounds")
        return {"t_light_plane": light.resource(f"{receiver}.plane"), "t_light_bounds": bounds}
    position, normal = (light.resource(f"{receiver}.{name}") for name in ("position_ws", "normal_ws"))
    return {"t_receiver_position": position, "t_receiver_normal": normal}


def has_rough_casters(instances: Iterable[Instance]) -> bool:
    """Whether a specular surface scatters light."""
    return any(i.optical_kind is not OpticalKind.DIFFUSE and i.material.roughness > 0.0 for i in instances)


def landing_of(branch: Branch) -> str:
    """Where the photons of a branch land: pixel, 1 / area of the receiver within it, status."""
    return branch.resource("landing_px")


def photon_grid(photons: int, view: LightView) -> tuple[int, int]:
    """Columns and rows of strata over a light view: about `photons` in all, nearly square on the view."""
    step = (3, 2) if view.faces == 6 else (1, 1)
    columns = max(1, round(math.sqrt(photons * view.size[0] / view.size[1]) / step[0])) * step[0]
    return columns, max(1, round(photons / columns / step[1])) * step[1]


def sequence(index: int) -> tuple[float, float, float]:
    """Element of the R3 sequence, each in [0, 1)."""
    a = 1.0 / GOLDEN_3D
    return (index * a) % 1.0, (index * a * a) % 1.0, (index * a * a * a) % 1.0


def photon_statistics(branch: Branch, runner: PlanRunner) -> dict[str, Any]:
    """Photons and their flux by what became of them. Reads two textures back."""
    landing, flux = (read_rgba32f(runner, r) for r in (landing_of(branch), branch.flux))
    status = np.rint(landing[..., 3]).astype(int)
    lumens = flux[..., :3].astype(np.float64).sum(axis=2) / max(sum(branch.channels), 1.0)
    tried = status != 0
    total = float(lumens[tried].sum())

    def by(words: Mapping[int, str]) -> dict[str, float]:
        return {word: float(lumens[status == code].sum()) for code, word in words.items() if (status == code).any()}

    landed, unseen, lost = by(LANDED), by(UNSEEN), by(LOST)
    flux_lost = sum(lost.values())
    lookups = flux[..., 3][tried]
    return {
        "solve": branch.pass_name("trace"),
        "rays": int(tried.sum()),
        "converged": int((status == 1).sum()),
        "bracketed": int((status == 2).sum()),
        "unseen": int(np.isin(status, list(UNSEEN)).sum()),
        "left_the_scene": int((status == LEFT).sum()),
        "failed": int(np.isin(status, list(LOST)).sum()),
        "lookups_mean": float(lookups.mean()) if lookups.size else 0.0,
        "lookups_max": int(lookups.max()) if lookups.size else 0,
        "flux": total,
        "flux_landed": sum(landed.values()),
        "flux_landed_by_view": landed,
        "flux_unseen_by_cause": unseen,
        "flux_left_the_scene": float(lumens[status == LEFT].sum()),
        "flux_lost": float(flux_lost),
        "flux_lost_by_cause": lost,
        "flux_lost_share": float(flux_lost / total) if total > 0.0 else 0.0,
    }
