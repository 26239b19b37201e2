"""What the eye sees through water and glass and in mirrors: the specular layer composed over the shaded opaque layer."""

from __future__ import annotations

from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.frame import FrameSetup, PassContext
from glcaustics.passes.lighting import sky_uniforms


def declare(graph: FrameGraph, setup: FrameSetup) -> None:
    """Fresnel, refraction with (n/n')^2, absorption, reflection; see `refraction.frag`."""
    graph.add(
        PassDecl(
            "refraction",
            {
                "view.radiance": TextureDesc("rgba32f", setup.size, "cd/m^2"),
                "view.caustic_irradiance": TextureDesc("rgba32f", setup.size, "lux"),
                "view.solve_status": TextureDesc("r32f", setup.size),
            },
            _execute,
            reads=("shade.radiance", "gbuffer.depth_m", "specular.depth_m", "specular.normal_ws"),
            optional=("specular.back_depth_m", "specular.back_normal_ws", "caustics.irradiance"),
            note="what water, glass and mirrors show",
        )
    )


def _execute(ctx: PassContext) -> None:
    outputs = ctx.locations(
        RADIANCE="view.radiance", CAUSTICS_VIEW="view.caustic_irradiance", STATUS="view.solve_status"
    )
    back = ctx.has("specular.back_depth_m")
    caustics = bool(outputs["HAS_CAUSTICS_VIEW"])
    target = ctx.target("view.radiance", "view.caustic_irradiance", "view.solve_status")
    program = ctx.device.program("passes/refraction/refraction", {**outputs, "HAS_BACK": int(back)})
    textures = {
        "t_radiance": ctx.texture("shade.radiance"),
        "t_opaque_depth_m": ctx.texture("gbuffer.depth_m"),
        "t_specular_depth_m": ctx.texture("specular.depth_m"),
        "t_specular_normal": ctx.texture("specular.normal_ws"),
        "t_objects": ctx.frame.gpu.objects,
    }
    if back:
        textures |= {
            "t_back_depth_m": ctx.texture("specular.back_depth_m"),
            "t_back_normal": ctx.texture("specular.back_normal_ws"),
        }
    if caustics:
        textures["t_caustics"] = ctx.texture("caustics.irradiance")
    low, high = ctx.setup.scene_bounds_ws
    program.set_all(
        {
            **ctx.frame.uniforms(),
            **sky_uniforms(ctx.setup),
            **textures,
            "u_bounds_min_ws": tuple(low),
            "u_bounds_max_ws": tuple(high),
            "u_refraction_iterations": int(ctx.setup.options["refraction_iterations"]),
            "u_reflection_steps": int(ctx.setup.options["reflection_steps"]),
        }
    )
    ctx.device.draw_fullscreen(program, target)
