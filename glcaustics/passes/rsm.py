"""Reflective shadow maps (Dachsbacher, Stamminger 2005): depth, normal, flux and roughness from a light, opaque alone
or with specular.
"""

from __future__ import annotations

from glcaustics.gpu import Program
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.fit_view import fit_view
from glcaustics.passes.frame import FrameSetup, LightSetup
from glcaustics.passes.geometry import DrawItem, boxes_of, points_of
from glcaustics.passes.light_views import light_uniforms
from glcaustics.scene.model import OpticalKind

SHADER = "passes/rsm/rsm"
ATTACHMENTS = {
    "depth_m": ("r32f", "m"),
    "normal_ws": ("rgba32f", ""),
    "flux": ("rgba32f", "lm"),
    "material": ("rg16f", ""),
}


def declare(graph: FrameGraph, setup: FrameSetup, light: LightSetup, *, with_specular: bool) -> None:
    """Resources `rsm.<attachment>@i`, or `rsm_specular.<attachment>@i` with specular surfaces too."""
    layer = "rsm_specular" if with_specular else "rsm"
    name = f"{layer}{light.resource('')}"
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
    writes = {light.resource(f"{layer}.{n}"): TextureDesc(f, view.size, u) for n, (f, u) in ATTACHMENTS.items()}
    depth = light.resource(f"{layer}.depth")
    writes[depth] = TextureDesc("depth24", view.size)

    def execute(ctx: PassContext) -> None:
        names = [light.resource(f"{layer}.{n}") for n in ATTACHMENTS]
        target = ctx.target(*names, depth=depth)
        target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
        outputs = ctx.locations(**{n.upper(): light.resource(f"{layer}.{n}") for n in ATTACHMENTS})

        def program(item: DrawItem) -> Program:
            image = item.instance.material.base_color_image
            made = ctx.device.program(SHADER, {**outputs, "HAS_UV": int(image is not None and outputs["HAS_FLUX"])})
            made.set_all(
                {**light_uniforms(light.light), "u_rsm_texel_measure": view.texel_measure, "u_near_m": view.near_m}
            )
            made.set_all({"t_objects": ctx.frame.gpu.objects})
            if image is not None:
                made.set_all({"t_base_color": ctx.frame.gpu.image(image)})
            return made

        for face, (matrix, viewport) in enumerate(zip(view.matrices, view.viewports(), strict=True)):
            forward = view.forward_of(face)

            def per_item(made: Program, item: DrawItem, m=matrix, f=forward) -> None:  # type: ignore[no-untyped-def]
                made.set_all({"u_clip_from_world": m, "u_rsm_forward_ws": tuple(f)})

            ctx.frame.gpu.draw(program, target, ctx.frame.gpu.select(*kinds), viewport=viewport, per_item=per_item)

    graph.add(PassDecl(name, writes, execute, always_writes=(depth,), note="what the light sees, with its flux"))
