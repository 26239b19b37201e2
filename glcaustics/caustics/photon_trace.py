"""Cascaded image-space photon tracing (Meenrattanakorn, Lambers 2022): photons go from what the light sees of specular
surfaces through the light's view, then through the camera's, and are added up as irradiance at the camera's pixels.

Beyond the paper: photons are stratified, carry the exact flux of their stratum, and start where the last frames' showed
in the picture; ends are exact on tangent planes; hierarchical marching in both views; irradiance over the receiver's
own area, so that energy holds on slanted receivers; refraction and reflection weighted by Fresnel's equations instead
of by chance (which is an option); solids, dispersion and absorption; every loss counted.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, ClassVar

from glcaustics.caustics import photon_options, photon_strata
from glcaustics.caustics.branches import BRANCH_CODE, INTERFACE, REFLECT, Branch, branches_of
from glcaustics.caustics.coarse_light import CoarseLight
from glcaustics.caustics.landing import fit_layers
from glcaustics.caustics.method import IRRADIANCE, NOISY_IRRADIANCE, CausticsMethod
from glcaustics.caustics.photon_stats import landing_of, photon_statistics
from glcaustics.caustics.photon_strata import photon_grid, sequence
from glcaustics.caustics.solid_views import SolidViews, receivers_inside_solids
from glcaustics.gpu import Device, Program
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes import depth_chain, light_view
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup, FrameState, LightSetup
from glcaustics.passes.light_views import light_uniforms
from glcaustics.passes.raster import raster_uniforms
from glcaustics.passes.receiver_views import ReceiverView
from glcaustics.passes.runner import PlanRunner
from glcaustics.scene.model import Instance, OpticalKind

SHADERS = "caustics/photon_trace"


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
    ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = photon_options.LADDER
    option_help: ClassVar[Mapping[str, str]] = photon_options.HELP
    defaults: ClassVar[Mapping[str, Any]] = photon_options.DEFAULTS

    def __init__(self) -> None:
        self._traced: list[tuple[LightSetup, Branch]] = []
        self._solids = SolidViews()

    @classmethod
    def validate(cls, options: Mapping[str, Any]) -> None:
        photon_options.check(options, cls.name)

    def prepare(self, device: Device, setup: FrameSetup, frame: FrameState) -> None:
        """Send the light maps' coarse light through solids once, to decide how many pairs of their faces are drawn."""
        if OpticalKind.SOLID not in setup.kinds():
            return
        self._solids.receivers_inside = receivers_inside_solids(setup.instances())
        solver = CoarseLight()
        solver.solids = self._solids
        solve_setup = replace(setup, options={**solver.defaults, **setup.options})
        for light in setup.lights:
            if light.caster is not None:
                fit_layers(solver, device, solve_setup, light, frame)

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
                if photon_strata.is_adaptive(setup.options):
                    photon_strata.declare(graph, branch, landing_of(branch))
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
                if setup.options["march"] == "dda":
                    _declare_light_depth(graph, light, receiver, plane)
                    continue
                depth_chain.declare_over(
                    graph, f"depth_chain.{receiver.name}", plane, receiver.view.size, light.resource("")
                )
        self._solids.declare(graph, setup, light)

    def _declare_trace(self, graph: FrameGraph, setup: FrameSetup, light: LightSetup, branch: Branch) -> None:
        assert light.caster is not None
        size = photon_grid(int(setup.options["photons"]), light.caster)
        mask = [branch.resource("landing_mask")] if in_stages(setup, branch) else []
        graph.add(
            PassDecl(
                branch.pass_name("trace"),
                {
                    landing_of(branch): TextureDesc("rgba32f", size, "px"),
                    branch.flux: TextureDesc("rgba32f", size, "lm"),
                    **{name: TextureDesc("depth24", size) for name in mask},
                },
                lambda ctx: self._trace(ctx, light, branch),
                reads=(
                    light.resource("caster.position_ws"),
                    light.resource("caster.normal_ws"),
                    *_light_reads(light, branch, setup.options["march"]).values(),
                    "gbuffer.plane",
                    *_march_reads(setup).values(),
                    *self._solids.reads(light, branch).values(),
                    *((photon_strata.strata_of(branch),) if photon_strata.is_adaptive(setup.options) else ()),
                ),
                always_writes=tuple(mask),
                note=f"where {branch.words} photons land",
                view_dependent=True,
            )
        )

    # -- execution ----------------------------------------------------------------------------------------------------

    def _trace(self, ctx: PassContext, light: LightSetup, branch: Branch) -> None:
        """In one stage, or in two: few refracted photons are marched, and where lanes wait, all would pay for them."""
        outputs = (landing_of(branch), branch.flux)
        if not in_stages(ctx.setup, branch):
            ctx.device.draw_fullscreen(self._program(ctx, light, branch, first=False), ctx.target(*outputs))
            return
        target = ctx.target(*outputs, depth=branch.resource("landing_mask"))
        first = self._program(ctx, light, branch, first=True)
        ctx.device.draw_fullscreen(first, target, depth_func="1", depth_write=True)
        ctx.device.draw_fullscreen(self._program(ctx, light, branch, first=False), target, depth_func="<")

    def _program(self, ctx: PassContext, light: LightSetup, branch: Branch, first: bool) -> Program:
        assert light.caster is not None
        view = light.receivers[branch.view].view
        options = ctx.setup.options
        defines = {
            "CASTER_FACES": light.caster.faces,
            "RECEIVER_FACES": view.faces,
            "BRANCH": BRANCH_CODE[branch.kind],
            "FIRST": int(first),
            "CHANCE": int(options["fresnel"] == "chance"),
            "ADAPTIVE": int(photon_strata.is_adaptive(options)),
            "BLOCKS": photon_strata.BLOCKS,
            "DDA": int(options["march"] == "dda"),
            "SIZED": int(light.light.has_size),
            "ROUGH": int(has_rough_casters(ctx.setup.instances())),
            **self._solids.defines(light, branch),
            "REFLECTION_FOLLOWED": int(any(at is light and b.kind == REFLECT for at, b in self._traced)),
            "HAS_MIRROR": int(branch.kind == REFLECT and OpticalKind.MIRROR in ctx.setup.kinds()),
        }
        program = ctx.device.program(f"{SHADERS}/trace", defines)
        program.set_all(self._solids.uniforms(ctx, light, branch))
        if branch.kind == REFLECT:
            program.set(u_receiver_raster_from_world=view.raster_from_world())
        if photon_strata.is_adaptive(options):
            program.set(t_strata=ctx.texture(photon_strata.strata_of(branch)))
        low, high = ctx.setup.bounds_ws
        light_reads = _light_reads(light, branch, options["march"])
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
                **{name: ctx.texture(resource) for name, resource in light_reads.items()},
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
                "u_luminance_cutoff": float(options["luminance_cutoff"]),
                "u_roughness_cutoff": float(options["roughness_cutoff"]),
            }
        )
        return program

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


def _light_reads(light: LightSetup, branch: Branch, march: str) -> dict[str, str]:
    """Samplers and resources of the way through the light's view."""
    receiver = f"receiver.{branch.view}"
    if branch.kind == REFLECT and march == "dda":
        depth = light.resource(f"{receiver}.depth_m")
        return {"t_light_plane": light.resource(f"{receiver}.plane"), "t_light_depth_m": depth}
    if branch.kind == REFLECT:
        bounds = light.resource(f"depth_chain.{branch.view}.bounds")
        return {"t_light_plane": light.resource(f"{receiver}.plane"), "t_light_bounds": bounds}
    position, normal = (light.resource(f"{receiver}.{name}") for name in ("position_ws", "normal_ws"))
    return {"t_receiver_position": position, "t_receiver_normal": normal}


def in_stages(setup: FrameSetup, branch: Branch) -> bool:
    """Whether photons that the first estimate does not settle have a pass of their own: where these are few."""
    return branch.kind == INTERFACE and not has_rough_casters(setup.instances())


def _declare_light_depth(graph: FrameGraph, light: LightSetup, receiver: ReceiverView, plane: str) -> None:
    """A texture of depths beside that of planes, which the march pixel by pixel would read four times as much of."""
    depth = light.resource(f"receiver.{receiver.name}.depth_m")
    graph.add(
        PassDecl(
            f"receiver_view.depth_m.{receiver.name}{light.resource('')}",
            {depth: TextureDesc("r32f", receiver.view.size, "m")},
            lambda ctx: _draw_light_depth(ctx, plane, depth),
            reads=(plane,),
            note="depth of the light's view, for the march pixel by pixel",
        )
    )


def _draw_light_depth(ctx: PassContext, plane: str, depth: str) -> None:
    program = ctx.device.program(f"{SHADERS}/light_depth").set(t_plane=ctx.texture(plane))
    ctx.device.draw_fullscreen(program, ctx.target(depth))


def has_rough_casters(instances: Iterable[Instance]) -> bool:
    """Whether a specular surface scatters light."""
    return any(i.optical_kind is not OpticalKind.DIFFUSE and i.material.roughness > 0.0 for i in instances)
