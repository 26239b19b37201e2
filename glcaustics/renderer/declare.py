"""The whole frame as declarations, before the graph leaves out what nothing reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from glcaustics.caustics.method import IRRADIANCE, NOISY_IRRADIANCE, CausticsMethod
from glcaustics.caustics.registry import AUTO, pick
from glcaustics.denoise import svgf
from glcaustics.graph import FrameGraph, Plan
from glcaustics.passes import depth_chain, gbuffer, lighting, refraction, rsm, shadow_map, specular_layers, taa, tonemap
from glcaustics.passes.frame import FrameSetup
from glcaustics.quality import DEFAULT_QUALITY
from glcaustics.renderer.aov import aov_resources
from glcaustics.renderer.options import resolve_options
from glcaustics.scene.model import OpticalKind, Scene


@dataclass(frozen=True, eq=False)
class DeclaredFrame:
    """Every pass that might run, and what is asked of them.

    `radiance`: the resource that `Frame.image` is read from. `specular`: the eye sees specular surfaces.
    """

    graph: FrameGraph
    outputs: tuple[str, ...]
    radiance: str
    specular: bool

    def compile(self, also: tuple[str, ...] = ()) -> Plan:
        """The plan that writes the outputs, those of `also`, and what a still scene can keep from frame to frame."""
        outputs = tuple(dict.fromkeys((*self.outputs, *also)))
        _, kept = self.graph.compile(outputs=outputs).kept()
        return self.graph.compile(outputs=tuple(dict.fromkeys((*outputs, *kept))))


def declare_frame(
    setup: FrameSetup,
    method: CausticsMethod | None,
    method_name: str,
    *,
    aovs: tuple[str, ...] = (),
    specular_view: bool = True,
    antialias: bool = False,
) -> DeclaredFrame:
    """Declare every pass of a frame.

    Args:
        method: None for direct light alone; `method_name` is what the user called it.
        aovs: names of `AOVS`. specular_view, antialias: see `Renderer` (there: taa).

    Raises:
        UsageError: unknown AOV.
    """
    graph = FrameGraph()
    for light in setup.lights:
        shadow_map.declare(graph, setup, light)
        for with_specular in (False, True):
            rsm.declare(graph, setup, light, with_specular=with_specular)
    gbuffer.declare_opaque(graph, setup)
    depth_chain.declare(graph, setup)
    lighting.declare_lighting(graph, setup)
    caustics = _declare_caustics(graph, setup, method, method_name)
    lighting.declare_shade(graph, setup)
    specular = _declare_view(graph, setup, method, specular_view=specular_view)
    radiance = "view.radiance" if specular else "shade.radiance"
    if antialias:
        taa.declare(graph, setup, radiance, specular=specular)
        radiance = taa.RADIANCE
    else:
        graph.leave_out("taa", taa.OFF)
    tonemap.declare(graph, setup, radiance)
    outputs = ("present.ldr", radiance, *aov_resources(aovs, specular=specular, caustics=caustics))
    return DeclaredFrame(graph, tuple(dict.fromkeys(outputs)), radiance, specular)


def _declare_caustics(graph: FrameGraph, setup: FrameSetup, method: CausticsMethod | None, method_name: str) -> bool:
    """Whether there will be caustics."""
    if method is None:
        graph.leave_out("caustics", f"method {method_name}: light passes straight through water and glass")
        return False
    because = method.why_not(setup.scene)
    if because is None:
        method.declare(graph, setup)
        if method.noisy and setup.options["denoise"]:
            svgf.declare(graph, setup, NOISY_IRRADIANCE, IRRADIANCE, method.irradiance_desc(setup))
        return True
    method.leave_out(graph, setup, because)
    return False


def _declare_view(graph: FrameGraph, setup: FrameSetup, method: CausticsMethod | None, *, specular_view: bool) -> bool:
    """What the eye sees in and through specular surfaces; whether it sees any."""
    if not (setup.has_specular and specular_view):
        why = "nothing in the scene is specular" if specular_view else "the eye is asked to look past specular surfaces"
        for name in ("gbuffer2", "gbuffer.specular", "gbuffer.specular_back", "gbuffer.specular2", "refraction"):
            graph.leave_out(name, why)
        return False
    gbuffer.declare_specular(graph, setup)
    if OpticalKind.SOLID in setup.kinds():
        gbuffer.declare_back(graph, setup)
    else:
        graph.leave_out("gbuffer.specular_back", "nothing in the scene is a solid with two interfaces")
    specular_layers.declare(graph, setup)
    _declare_second_layer(graph, setup, method)
    refraction.declare(graph, setup)
    return True


def _declare_second_layer(graph: FrameGraph, setup: FrameSetup, method: CausticsMethod | None) -> None:
    """What stands behind the first opaque surfaces, shaded like these, for eye rays that end behind something."""
    if int(setup.options["depth_layers"]) < 2:
        graph.leave_out("gbuffer2", "one depth layer is asked for; --set depth_layers=2 shows what the first one hides")
        return
    gbuffer.declare_second(graph, setup)
    depth_chain.declare(graph, setup, gbuffer.SECOND)
    lighting.declare_lighting(graph, setup, gbuffer.SECOND)
    lighting.declare_shade(graph, setup, gbuffer.SECOND)
    if method is not None and not method.lights_second_layer and method.why_not(setup.scene) is None:
        graph.leave_out("caustics2", f"{method.name} brings caustics to the first depth layer alone")


def plan_frame(
    scene: Scene,
    size: tuple[int, int] = (1280, 720),
    method: str = AUTO,
    quality: str = DEFAULT_QUALITY,
    aovs: tuple[str, ...] = (),
    *,
    specular_view: bool = True,
    options: Mapping[str, Any] | None = None,
) -> Plan:
    """The frame's plan without any GPU. The receivers' light views are then fitted to the receivers, not yet to the
    landing light.

    Raises:
        UsageError: unknown method, quality, AOV or option.
    """
    chosen = pick(named_method(scene, method))
    resolved = resolve_options(chosen, quality, options or {})
    setup = FrameSetup.analyse(scene, size, resolved, transmissive_shadows=chosen is not None)
    return declare_frame(
        setup, chosen() if chosen else None, method, aovs=tuple(aovs), specular_view=specular_view
    ).compile()


def named_method(scene: Scene, method: str) -> str:
    """The method asked for; of "auto", the one that the scene names, if it does."""
    return scene.method if method == AUTO and scene.method else method
