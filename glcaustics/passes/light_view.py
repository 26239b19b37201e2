"""What a light sees: the casters (specular surfaces), their back faces, and the receivers (Shah et al. 2007, passes 1
and 2).
"""

from __future__ import annotations

import moderngl

from glcaustics.gpu import Program
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup, LightSetup
from glcaustics.passes.geometry import DrawItem
from glcaustics.passes.light_views import LightView
from glcaustics.passes.receiver_views import BELOW, BESIDE, ReceiverView
from glcaustics.scene.model import OpticalKind

SHADER = "passes/light_view/light_view"


def declare_caster(graph: FrameGraph, setup: FrameSetup, light: LightSetup) -> None:
    """Position and normal of the first specular surface; opaque geometry in front of it hides it."""
    assert light.caster is not None
    size = light.caster.size
    position, normal, depth = (light.resource(f"caster.{n}") for n in ("position_ws", "normal_ws", "depth"))
    graph.add(
        PassDecl(
            f"caster_view{light.resource('')}",
            {
                position: TextureDesc("rgba32f", size, "m"),
                normal: TextureDesc("rgba32f", size, filter="linear"),
                depth: TextureDesc("depth24", size),
            },
            lambda ctx: _draw_caster(ctx, light, position, normal, depth),
            always_writes=(depth,),
            note="specular surfaces seen from the light",
        )
    )


def _draw_caster(ctx: PassContext, light: LightSetup, position: str, normal: str, depth: str) -> None:
    assert light.caster is not None
    target = ctx.target(position, normal, depth=depth)
    target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    outputs = {**ctx.locations(POSITION=position, NORMAL=normal), "HAS_PLANE": 0, "BACK": 0, "CLIP": 0}
    occluder = ctx.device.program(SHADER, {**outputs, "OCCLUDER": 1})
    shown = ctx.device.program(SHADER, {**outputs, "OCCLUDER": 0})
    gpu = ctx.frame.gpu
    for matrix, viewport in zip(light.caster.matrices, light.caster.viewports(), strict=True):
        occluder.set(u_clip_from_world=matrix)
        gpu.draw(occluder, target, gpu.select(OpticalKind.DIFFUSE), viewport=viewport)
        shown.set(u_clip_from_world=matrix)
        gpu.draw(shown, target, gpu.select(OpticalKind.MIRROR, OpticalKind.INTERFACE), viewport=viewport)
        gpu.draw(shown, target, gpu.select(OpticalKind.SOLID), viewport=viewport, cull="back")


def declare_caster_back(graph: FrameGraph, setup: FrameSetup, light: LightSetup) -> None:
    """The first back face behind each solid's front (Wyman 2005), for its second interface."""
    assert light.caster is not None
    _declare_behind(graph, light, "back", "caster.position_ws", "front", "back faces of solids seen from the light")


def declare_caster_layers(graph: FrameGraph, light: LightSetup) -> None:
    """The second front face behind the first back face, and the back face behind that (depth peeling, Everitt 2001):
    what a solid with folds or handles shows the light a second time, and other solids behind it."""
    note = "solids behind the first layer of solids"
    _declare_behind(graph, light, "front2", "caster.back_position_ws", "back", note, any_object=True)
    _declare_behind(graph, light, "back2", "caster.front2_position_ws", "front", "where that layer ends")


def _declare_behind(
    graph: FrameGraph, light: LightSetup, name: str, before: str, cull: str, note: str, *, any_object: bool = False
) -> None:
    """The first faces behind what is in `before`, of the same solid or of any; `cull`: the faces that do not count."""
    assert light.caster is not None
    size = light.caster.size
    front = light.resource(before)
    position, normal, depth = (light.resource(f"caster.{name}_{n}") for n in ("position_ws", "normal_ws", "depth"))
    graph.add(
        PassDecl(
            f"caster_{name}{light.resource('')}",
            {
                position: TextureDesc("rgba32f", size, "m"),
                normal: TextureDesc("rgba32f", size, filter="linear"),
                depth: TextureDesc("depth24", size),
            },
            lambda ctx: _draw_behind(ctx, light, front, (position, normal, depth), cull, any_object),
            reads=(front,),
            always_writes=(depth,),
            note=note,
        )
    )


def _draw_behind(
    ctx: PassContext, light: LightSetup, front: str, names: tuple[str, str, str], cull: str, any_object: bool
) -> None:
    assert light.caster is not None
    position, normal, depth = names
    target = ctx.target(position, normal, depth=depth)
    target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    outputs = {**ctx.locations(POSITION=position, NORMAL=normal), "HAS_PLANE": 0}
    program = ctx.device.program(SHADER, {**outputs, "BACK": 1 + any_object, "OCCLUDER": 0, "CLIP": 0})
    program.set(t_front_position=ctx.texture(front), u_light=light.caster.light_vec4)
    _draw_kind(ctx, light.caster, program, target, ctx.frame.gpu.select(OpticalKind.SOLID), cull=cull)


def declare_receiver(graph: FrameGraph, setup: FrameSetup, light: LightSetup, receiver: ReceiverView) -> None:
    """The first opaque surface, as if there were no specular ones: position, normal, tangent plane in raster space."""
    size = receiver.view.size
    names = ("position_ws", "normal_ws", "plane", "depth")
    position, normal, plane, depth = (light.resource(f"receiver.{receiver.name}.{n}") for n in names)
    graph.add(
        PassDecl(
            f"receiver_view.{receiver.name}{light.resource('')}",
            {
                position: TextureDesc("rgba32f", size, "m"),
                normal: TextureDesc("rgba32f", size),
                plane: TextureDesc("rgba32f", size, "1/m"),
                depth: TextureDesc("depth24", size),
            },
            lambda ctx: _draw_receiver(ctx, receiver, (position, normal, plane), depth),
            always_writes=(depth,),
            note=f"opaque surfaces where caustics can land, seen from {RECEIVER_WORDS[receiver.base]}",
        )
    )


RECEIVER_WORDS = {BESIDE: "the light", BELOW: "the light as refracted"}


def _draw_receiver(ctx: PassContext, receiver: ReceiverView, colors: tuple[str, str, str], depth: str) -> None:
    target = ctx.target(*colors, depth=depth)
    target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    outputs = ctx.locations(**dict(zip(("POSITION", "NORMAL", "PLANE"), colors, strict=True)))
    clip = receiver.clip_plane is not None
    program = ctx.device.program(SHADER, {**outputs, "BACK": 0, "OCCLUDER": 0, "CLIP": int(clip)})
    if receiver.clip_plane is not None:
        program.set(u_clip_plane=receiver.clip_plane)
    items = ctx.frame.gpu.select(OpticalKind.DIFFUSE)
    _draw_kind(ctx, receiver.view, program, target, items, planes=bool(outputs["HAS_PLANE"]))


def _draw_kind(
    ctx: PassContext,
    view: LightView,
    program: Program,
    target: moderngl.Framebuffer,
    items: list[DrawItem],
    *,
    cull: str | None = None,
    planes: bool = False,
) -> None:
    for face, (matrix, viewport) in enumerate(zip(view.matrices, view.viewports(), strict=True)):
        program.set(u_clip_from_world=matrix)
        if planes:
            program.set(u_raster_from_world=view.raster_from_world(face))
        ctx.frame.gpu.draw(program, target, items, viewport=viewport, cull=cull)
