"""Reflective shadow maps (Dachsbacher, Stamminger 2005): depth, normal, flux and roughness from a light, opaque alone
or with specular.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from glcaustics.gpu import Program
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.fit_view import fit_view
from glcaustics.passes.frame import FrameSetup, LightSetup
from glcaustics.passes.geometry import DrawItem, boxes_of, points_of
from glcaustics.passes.light_views import LightView, light_uniforms
from glcaustics.scene.model import OpticalKind

SHADER = "passes/rsm/rsm"
ATTACHMENTS = {
    "depth_m": ("r32f", "m"),
    "normal_ws": ("rgba32f", ""),
    "flux": ("rgba32f", "lm"),
    "material": ("rg16f", ""),
}


@dataclass(frozen=True, eq=False)
class _Layer:
    """A reflective shadow map: of one light, of some optical kinds, seen in `view`."""

    name: str
    light: LightSetup
    kinds: tuple[OpticalKind, ...]
    view: LightView

    def resource(self, attachment: str) -> str:
        return self.light.resource(f"{self.name}.{attachment}")


def declare(graph: FrameGraph, setup: FrameSetup, light: LightSetup, *, with_specular: bool) -> None:
    """Resources `rsm.<attachment>@i`, or `rsm_specular.<attachment>@i` with specular surfaces too."""
    prefix = "rsm_specular" if with_specular else "rsm"
    name = light.resource(prefix)
    if not light.light.shines:
        graph.leave_out(name, "the light reaches nothing")
        return
    kinds = tuple(OpticalKind) if with_specular else (OpticalKind.DIFFUSE,)
    seen = [i for i in setup.instances() if i.optical_kind in kinds]
    points = points_of(seen)
    if len(points) == 0:
        graph.leave_out(name, "nothing opaque in the scene")
        return
    view = fit_view(light.light, points, int(setup.options["rsm_size"]), boxes_ws=boxes_of(seen))
    layer = _Layer(prefix, light, kinds, view)
    writes = {layer.resource(n): TextureDesc(f, view.size, u) for n, (f, u) in ATTACHMENTS.items()}
    depth = layer.resource("depth")
    writes[depth] = TextureDesc("depth24", view.size)
    note = "what the light sees, with its flux"
    graph.add(PassDecl(name, writes, lambda ctx: _draw(ctx, layer), always_writes=(depth,), note=note))


def _draw(ctx: PassContext, layer: _Layer) -> None:
    view, gpu = layer.view, ctx.frame.gpu
    target = ctx.target(*(layer.resource(n) for n in ATTACHMENTS), depth=layer.resource("depth"))
    target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    for face, (matrix, viewport) in enumerate(zip(view.matrices, view.viewports(), strict=True)):
        aim = {"u_clip_from_world": matrix, "u_rsm_forward_ws": tuple(view.forward_of(face))}
        program = partial(_program, ctx, layer, aim)
        gpu.draw(program, target, gpu.select(*layer.kinds), viewport=viewport)


def _program(ctx: PassContext, layer: _Layer, aim: Mapping[str, Any], item: DrawItem) -> Program:
    """The permutation for an item's material, aimed at one face of the view."""
    outputs = ctx.locations(**{n.upper(): layer.resource(n) for n in ATTACHMENTS})
    image = item.instance.material.base_color_image
    program = ctx.device.program(SHADER, {**outputs, "HAS_UV": int(image is not None and outputs["HAS_FLUX"])})
    program.set_all(
        {
            **light_uniforms(layer.light.light),
            **aim,
            "u_rsm_texel_measure": layer.view.texel_measure,
            "u_near_m": layer.view.near_m,
            "t_objects": ctx.frame.gpu.objects,
        }
    )
    if image is not None:
        program.set_all({"t_base_color": ctx.frame.gpu.image(image)})
    return program
