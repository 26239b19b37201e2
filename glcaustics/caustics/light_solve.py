"""What the methods share that displace light samples in light space: where the light of each texel of the casters' view
lands, the caustic maps that it is collected in, their look-up at the camera's pixels, and the statistics of the
solves."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import moderngl

from glcaustics.caustics.branches import BRANCH_CODE, INTERFACE, REFLECT, Branch, branches_of, solve_statistics
from glcaustics.caustics.landing import fit_receivers
from glcaustics.caustics.map_warp import SEGMENTS, TABLE_ROWS, MapWarp
from glcaustics.caustics.method import CausticsMethod, irradiance_of
from glcaustics.caustics.solid_views import SolidViews, receivers_inside_solids
from glcaustics.gpu import Device, Program
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes import light_view
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup, FrameState, LightSetup
from glcaustics.passes.gbuffer import LAYERS
from glcaustics.passes.light_views import light_uniforms
from glcaustics.passes.options import check_options
from glcaustics.passes.receiver_views import ReceiverView
from glcaustics.passes.runner import PlanRunner
from glcaustics.scene.model import OpticalKind

SHADERS = "caustics/shared"
ESTIMATES = {"fixed_point": 0, "newton_fd": 1, "hybrid": 2}
NEGLIGIBLE_SHARE = 5e-4  # a branch that brings less of a light's flux to the receivers is left out, and said so
CORE_TAPS = 32  # on each side of a pixel: few pixels see a core, and those few may each see many of its texels
SPLAT_SIGMA = 0.62  # of the distance to the neighbour: least blur at which a regular grid of splats is flat to 0.2 %


class LightMapMethod(CausticsMethod):
    """A method that collects displaced light samples in caustic maps, one a light and receiver view: flux per texel.

    A method adds `declare_map`, which turns landing points and fluxes into the map.
    """

    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {
        "caster_size": (8, 8192),
        "map_size": (8, 8192),
        "max_iterations": (1, 64),
        "march_steps": (0, 512),
        "gather_taps": (1, 16),
        "internal_bounces": (0, 32),
        "max_radius": (2, 64),
    }
    flags: ClassVar[tuple[str, ...]] = ("reflect", "dispersion")
    lights_second_layer = True
    boxed_splats: ClassVar[bool] = False  # True: splats are few and long, and drawn as turned boxes, not as points
    warps: ClassVar[bool] = False  # True: one warped map a view; False: nested cores, each sample drawn in one of them
    option_help: ClassVar[Mapping[str, str]] = {
        "caster_size": "the casters' light view has about this^2 texels, one light sample each (8..8192)",
        "map_size": "the caustic map has about this^2 texels (8..8192)",
        "estimate": "where a ray lands: fixed_point, newton_fd or hybrid",
        "max_iterations": "of that estimate (1..64)",
        "march_steps": "of the bracketing fallback and of reflected rays (0..512; 0 = off)",
        "reflect": "follow reflected light too (true, false)",
        "dispersion": "refract red, green and blue apart where a material disperses (true, false)",
        "internal_bounces": "total reflections followed inside a solid (0..32)",
        "gather_taps": "of the look-up on each side of a pixel that covers several texels (1..16)",
        "max_radius": "largest splat, texels of the map (2..64)",
    }
    defaults: ClassVar[Mapping[str, Any]] = {
        "estimate": "hybrid",
        "reflect": True,
        "dispersion": True,
        "max_radius": 48.0,
    }

    def __init__(self) -> None:
        self._branches: dict[int, list[Branch]] = {}
        self._warps: dict[tuple[int, str], MapWarp] = {}
        self.solids = SolidViews()
        self._left_out: list[tuple[str, str]] = []

    @classmethod
    def validate(cls, options: Mapping[str, Any]) -> None:
        check_options(options, cls.name, numbers=cls.ranges, choices={"estimate": ESTIMATES}, flags=cls.flags)

    # -- declaration --------------------------------------------------------------------------------------------------

    @abstractmethod
    def declare_map(
        self, graph: FrameGraph, setup: FrameSetup, light: LightSetup, receiver: ReceiverView, branches: list[Branch]
    ) -> None:
        """Add the passes that write `map_resource(light, receiver)` from these branches, which land in that view."""

    def map_resource(self, light: LightSetup, receiver: ReceiverView) -> str:
        """The caustic map of one light and receiver view: flux per texel."""
        return light.resource(f"{self.name}.{receiver.name}.flux")

    def warp_of(self, light: LightSetup, receiver: ReceiverView) -> MapWarp | None:
        """How the map of a view is warped; None: its texels are the view's."""
        return self._warps.get((light.index, receiver.name))

    def map_desc(self, light: LightSetup, receiver: ReceiverView) -> TextureDesc:
        """The texture of a caustic map."""
        warp = self.warp_of(light, receiver)
        return TextureDesc("rgba32f", receiver.view.size if warp is None else warp.size, "lm")

    def warp_reads(self, light: LightSetup, receiver: ReceiverView) -> tuple[str, ...]:
        """What a pass reads that uses `set_warp`."""
        return () if self.warp_of(light, receiver) is None else (self._warp_resource(light, receiver),)

    def warp_define(self, light: LightSetup, receiver: ReceiverView) -> int:
        """The define WARP of shaders that include `interface/map_warp.glsl`."""
        return 0 if self.warp_of(light, receiver) is None else SEGMENTS

    def set_warp(self, program: Program, ctx: PassContext, light: LightSetup, receiver: ReceiverView) -> None:
        """The table of `interface/map_warp.glsl`, where there is one."""
        if self.warp_of(light, receiver) is not None:
            program.set(t_warp=ctx.texture(self._warp_resource(light, receiver)))

    def _warp_resource(self, light: LightSetup, receiver: ReceiverView) -> str:
        return light.resource(f"{self.name}.{receiver.name}.warp")

    def _declare_warp(self, graph: FrameGraph, light: LightSetup, receiver: ReceiverView) -> None:
        warp = self.warp_of(light, receiver)
        if warp is None:
            return
        resource, table = self._warp_resource(light, receiver), warp.table()
        graph.add(
            PassDecl(
                f"{self.name}.warp.{receiver.name}{light.resource('')}",
                {resource: TextureDesc("rgba32f", (warp.table_width, TABLE_ROWS), "texel")},
                lambda ctx: ctx.texture(resource).write(table.tobytes()),
                note="where the map's texels crowd",
            )
        )

    def prepare(self, device: Device, setup: FrameSetup, frame: FrameState) -> None:
        """Send a coarse light through the scene once, and fit each light's receiver views to where it lands."""
        self.solids.receivers_inside = receivers_inside_solids(setup.instances())
        for light in setup.lights:
            if light.caster is not None:
                shares, warps = fit_receivers(self, device, setup, light, frame)
                self._warps |= {(light.index, name): warp for name, warp in warps.items()}
                self._keep_branches(setup, light, shares)

    def _keep_branches(self, setup: FrameSetup, light: LightSetup, shares: Mapping[str, float]) -> None:
        """Leave out the branches of which next to no light lands."""
        kept = []
        for branch in branches_of(setup, light, self.name):
            share = shares.get(branch.kind, 1.0)
            if share > NEGLIGIBLE_SHARE:
                kept.append(branch)
            else:
                because = f"{100.0 * share:.2g} % of the light is {branch.words} and lands on a receiver"
                self._left_out.append((branch.pass_name("solve"), because))
        self._branches[light.index] = kept

    def branches(self, setup: FrameSetup, light: LightSetup) -> list[Branch]:
        """The branches that this light needs."""
        return self._branches.get(light.index, branches_of(setup, light, self.name))

    def leave_out(self, graph: FrameGraph, setup: FrameSetup, because: str) -> None:
        for light in setup.lights:
            for name in ("caster_view", "receiver_view", f"{self.name}.solve", f"{self.name}.map"):
                graph.leave_out(f"{name}{light.resource('')}", because)
        graph.leave_out(f"{self.name}.gather", because)

    def declare(self, graph: FrameGraph, setup: FrameSetup) -> None:
        maps: list[tuple[LightSetup, ReceiverView]] = []
        for light in setup.lights:
            if light.caster is None or not self.branches(setup, light):
                because = "its light reaches no specular surface, or none of it lands"
                graph.leave_out(f"{self.name}{light.resource('')}", because)
                continue
            self.declare_solves(graph, setup, light, self.branches(setup, light))
            for receiver in self._views(setup, light):
                zone = receiver.name.removeprefix(receiver.base)
                branches = [replace(b, zone=zone) for b in self.branches(setup, light) if b.view == receiver.base]
                self._declare_warp(graph, light, receiver)
                self.declare_map(graph, setup, light, receiver, branches)
                maps.append((light, receiver))
        for name, because in self._left_out:
            graph.leave_out(name, because)
        for layer in LAYERS[: int(setup.options.get("depth_layers", 1))]:
            self._declare_gather(graph, setup, maps, layer)

    def _declare_gather(
        self, graph: FrameGraph, setup: FrameSetup, maps: list[tuple[LightSetup, ReceiverView]], layer: str
    ) -> None:
        graph.add(
            PassDecl(
                f"{self.name}.gather{layer}",
                {irradiance_of(layer): self.irradiance_desc(setup)},
                lambda ctx: self._gather(ctx, maps, layer),
                reads=(
                    f"gbuffer{layer}.depth_m",
                    f"gbuffer{layer}.normal_ws",
                    *((f"gbuffer{layer}.depth",) if layer else ()),
                    *(self.map_resource(light, receiver) for light, receiver in maps),
                    *(light.resource(f"receiver.{receiver.name}.position_ws") for light, receiver in maps),
                    *(r for light, receiver in maps for r in self.warp_reads(light, receiver)),
                ),
                note="look-up in the caustic maps at the camera's pixels",
            )
        )

    def _views(self, setup: FrameSetup, light: LightSetup) -> list[ReceiverView]:
        """The receiver views in which some branch of this light lands."""
        used = {branch.view for branch in self.branches(setup, light)}
        return [receiver for receiver in light.receivers.values() if receiver.base in used]

    def declare_solves(self, graph: FrameGraph, setup: FrameSetup, light: LightSetup, branches: list[Branch]) -> None:
        """Light views and landing points of one light; also what the coarse fit runs."""
        light_view.declare_caster(graph, setup, light)
        for receiver in light.receivers.values():
            if any(branch.view == receiver.base for branch in branches):
                light_view.declare_receiver(graph, setup, light, receiver)
        self.solids.declare(graph, setup, light)
        for branch in branches:
            self._declare_solve(graph, setup, light, branch)

    def _declare_solve(self, graph: FrameGraph, setup: FrameSetup, light: LightSetup, branch: Branch) -> None:
        assert light.caster is not None
        size = light.caster.size
        graph.add(
            PassDecl(
                branch.pass_name("solve"),
                {branch.landing: TextureDesc("rgba32f", size, "m"), branch.flux: TextureDesc("rgba32f", size, "lm")},
                lambda ctx: self._solve(ctx, light, branch),
                reads=(
                    light.resource("caster.position_ws"),
                    light.resource("caster.normal_ws"),
                    light.resource(f"receiver.{branch.view}.position_ws"),
                    light.resource(f"receiver.{branch.view}.normal_ws"),
                    *self.solids.reads(light, branch).values(),
                ),
                note=f"where {branch.words} light lands",
            )
        )

    # -- execution ----------------------------------------------------------------------------------------------------

    def _solve(self, ctx: PassContext, light: LightSetup, branch: Branch) -> None:
        assert light.caster is not None
        view = light.receivers[branch.view].view
        options = ctx.setup.options
        program = ctx.device.program(
            f"{SHADERS}/solve",
            {
                "CASTER_FACES": light.caster.faces,
                "RECEIVER_FACES": view.faces,
                "BRANCH": BRANCH_CODE[branch.kind],
                **self.solids.defines(light, branch),
                "HAS_MIRROR": int(branch.kind == REFLECT and OpticalKind.MIRROR in ctx.setup.kinds()),
                "REFLECTION_FOLLOWED": int(any(b.kind == REFLECT for b in self.branches(ctx.setup, light))),
                "NAIVE_FLUX": int(options.get("naive_flux", False)),
                "ESTIMATE": ESTIMATES[options["estimate"]],
            },
        )
        textures = {
            "t_caster_position": "caster.position_ws",
            "t_caster_normal": "caster.normal_ws",
            "t_receiver_position": f"receiver.{branch.view}.position_ws",
            "t_receiver_normal": f"receiver.{branch.view}.normal_ws",
        }
        low, high = ctx.setup.scene_bounds_ws
        program.set_all(
            {
                **{name: ctx.texture(light.resource(r)) for name, r in textures.items()},
                **self.solids.uniforms(ctx, light, branch),
                **light.caster.uniforms("caster"),
                **view.uniforms("receiver"),
                **light_uniforms(light.light),
                "t_objects": ctx.frame.gpu.objects,
                "u_bounds_min_ws": tuple(low),
                "u_bounds_max_ws": tuple(high),
                "u_channels": branch.channels,
                "u_channel": branch.channel,
                "u_max_iterations": int(options["max_iterations"]),
                "u_march_steps": int(options["march_steps"]),
            }
        )
        if options.get("naive_flux", False):
            self._set_naive(program, ctx, light)
        ctx.device.draw_fullscreen(program, ctx.target(branch.landing, branch.flux))

    @staticmethod
    def _set_naive(program: Any, ctx: PassContext, light: LightSetup) -> None:
        """Their eq. 6 divides by V, the covered texels, from an occlusion query; here the whole view stands for it."""
        assert light.caster is not None
        texels = light.caster.size[0] * light.caster.size[1]
        program.set_all({"u_inverse_texels": 1.0 / texels, "u_caster_area_m2": light.caster.texel_measure * texels})

    def draw_splats(
        self, ctx: PassContext, light: LightSetup, receiver: ReceiverView, branch: Branch, target: moderngl.Framebuffer
    ) -> None:
        """Add the splats of a branch (textures `splat` and `conic`, see splat.vert) to a caustic map."""
        assert light.caster is not None
        width, height = light.caster.size
        copies = 3 if receiver.view.faces == 6 else 1  # a splat can reach three faces of a cube
        warp = self.warp_define(light, receiver)
        boxed = self.boxed_splats and branch.kind != INTERFACE  # water leaves few and small ones
        program = ctx.device.program(
            f"{SHADERS}/splat", {"RECEIVER_FACES": receiver.view.faces, "WARP": warp, "BOX": int(boxed)}
        )
        self.set_warp(program, ctx, light, receiver)
        size = self.map_desc(light, receiver).size
        program.set_all(
            {
                "t_splat": ctx.texture(branch.splat),
                "t_conic": ctx.texture(branch.conic),
                "t_flux": ctx.texture(branch.flux),
                "u_width": width,
                "u_count": width * height,
                "u_map_size": (float(size[0]), float(size[1])),
            }
        )
        count = copies * width * height
        if boxed:
            ctx.device.draw_triangles(program, target, 2 * count, blend="add")
        else:
            ctx.device.draw_points(program, target, count, blend="add")

    def _gather(self, ctx: PassContext, maps: list[tuple[LightSetup, ReceiverView]], layer: str) -> None:
        ctx.target(irradiance_of(layer)).clear(0.0, 0.0, 0.0, 0.0)
        # The second layer is mostly empty: its depth buffer keeps the shader from running there.
        target = ctx.target(irradiance_of(layer), depth=f"gbuffer{layer}.depth" if layer else None)
        for light, receiver in maps:
            warp = self.warp_define(light, receiver)
            program = ctx.device.program(f"{SHADERS}/gather", {"RECEIVER_FACES": receiver.view.faces, "WARP": warp})
            self.set_warp(program, ctx, light, receiver)
            program.set_all(
                {
                    **ctx.frame.uniforms(),
                    **receiver.view.uniforms("receiver"),
                    "t_depth_m": ctx.texture(f"gbuffer{layer}.depth_m"),
                    "t_normal_ws": ctx.texture(f"gbuffer{layer}.normal_ws"),
                    "t_receiver_position": ctx.texture(light.resource(f"receiver.{receiver.name}.position_ws")),
                    "t_flux": ctx.texture(self.map_resource(light, receiver)),
                    "u_max_taps": int(ctx.setup.options["gather_taps"]) if receiver.inner_ndc is None else CORE_TAPS,
                }
            )
            ctx.device.draw_fullscreen(program, target, blend="add", depth_func=">" if layer else None)

    # -- statistics ---------------------------------------------------------------------------------------------------

    def stats_resources(self) -> tuple[str, ...]:
        return tuple(r for branches in self._branches.values() for b in branches for r in (b.landing, b.flux))

    def solve_stats(self, runner: PlanRunner) -> list[dict[str, Any]]:
        return [solve_statistics(b, runner) for branches in self._branches.values() for b in branches]
