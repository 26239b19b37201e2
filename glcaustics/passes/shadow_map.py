"""Shadow maps: depth from each light of everything that cuts its direct light."""

from __future__ import annotations

from functools import partial

from glcaustics.gpu import Program
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup, LightSetup
from glcaustics.passes.geometry import DrawItem
from glcaustics.scene.model import FloatArray

SHADER = "passes/shadow_map/shadow_map"


def declare(graph: FrameGraph, setup: FrameSetup, light: LightSetup) -> None:
    """One map a light: a frustum, or a cube's atlas."""
    name, resource = f"shadow_map{light.resource('')}", light.resource("shadow.depth")
    if light.shadow is None:
        graph.leave_out(name, "nothing throws a shadow in this light")
        return
    desc = TextureDesc("depth24", light.shadow.size, filter="linear", compare=True)
    graph.add(PassDecl(name, {resource: desc}, lambda ctx: _execute(ctx, light, resource), note="depth from the light"))


def _execute(ctx: PassContext, light: LightSetup, resource: str) -> None:
    assert light.shadow is not None
    target = ctx.target(depth=resource)
    target.clear(depth=1.0)
    program = ctx.device.program(SHADER)
    items = [item for item in ctx.frame.gpu.items if ctx.setup.throws_shadow(item.instance, light)]
    for matrix, viewport in zip(light.shadow.matrices, light.shadow.viewports(), strict=True):
        ctx.frame.gpu.draw(
            program,
            target,
            items,
            viewport=viewport,
            per_item=partial(_place, matrix),
        )


def _place(clip_from_world: FloatArray, program: Program, item: DrawItem) -> None:
    program.set(u_clip_from_object=clip_from_world @ item.world_from_object)
