"""Direct lighting of the opaque layer, and its outgoing radiance."""

from __future__ import annotations

from typing import Any

from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.frame import FrameSetup, LightSetup, PassContext
from glcaustics.passes.light_views import light_uniforms
from glcaustics.scene.model import OpticalKind


def declare_lighting(graph: FrameGraph, setup: FrameSetup) -> None:
    """Irradiance and highlights of all lights, added up, each with its shadow map."""
    graph.add(
        PassDecl(
            "lighting",
            {
                "lighting.irradiance": TextureDesc("rgba32f", setup.size, "lux"),
                "lighting.highlight": TextureDesc("rgba32f", setup.size, "cd/m^2"),
            },
            _execute_lighting,
            reads=("gbuffer.depth_m", "gbuffer.normal_ws"),
            optional=(
                *(light.resource("shadow.depth") for light in setup.lights if light.shadow is not None),
                *(("gbuffer.albedo", "gbuffer.material") if has_highlights(setup) else ()),
            ),
            note="direct light with shadows",
        )
    )


def has_highlights(setup: FrameSetup) -> bool:
    """Whether some receiver is smooth or metallic enough to show a highlight."""
    materials = [i.material for i in setup.instances() if i.optical_kind is OpticalKind.DIFFUSE]
    return any(m.roughness < 0.95 or m.metallic > 0.05 or m.metallic_roughness_image is not None for m in materials)


def _execute_lighting(ctx: PassContext) -> None:
    highlight = ctx.live("lighting.highlight") and ctx.has("gbuffer.material")
    target = ctx.target("lighting.irradiance", "lighting.highlight")
    target.clear(0.0, 0.0, 0.0, 0.0)
    textures: dict[str, Any] = {
        "t_depth_m": ctx.texture("gbuffer.depth_m"),
        "t_normal_ws": ctx.texture("gbuffer.normal_ws"),
    }
    if highlight:
        textures |= {"t_albedo": ctx.texture("gbuffer.albedo"), "t_material": ctx.texture("gbuffer.material")}
    for light in ctx.setup.lights:
        _draw_light(ctx, light, target, textures, highlight)


def _draw_light(ctx: PassContext, light: LightSetup, target: Any, textures: dict[str, Any], highlight: bool) -> None:
    defines = {"HAS_HIGHLIGHT": int(highlight), "HAS_SHADOW": int(light.shadow is not None)}
    values = {**ctx.frame.uniforms(), **light_uniforms(light.light), **textures}
    if light.shadow is not None:
        defines["SHADOW_FACES"] = light.shadow.faces
        values |= {
            **light.shadow.uniforms("shadow"),
            "u_shadow_depth_range": (light.shadow.near_m, light.shadow.far_m),
            "t_shadow": ctx.texture(light.resource("shadow.depth")),
        }
    program = ctx.device.program("passes/lighting/lighting", defines)
    program.set_all(values)
    ctx.device.draw_fullscreen(program, target, blend="add")


def declare_shade(graph: FrameGraph, setup: FrameSetup) -> None:
    """Radiance of the opaque layer: direct, caustic and sky light on its base colour, highlights, emission; the sky
    behind.
    """
    emits = any(any(c > 0.0 for c in i.material.emissive) for i in setup.instances())
    graph.add(
        PassDecl(
            "shade",
            {"shade.radiance": TextureDesc("rgba32f", setup.size, "cd/m^2", filter="linear")},
            _execute_shade,
            reads=("gbuffer.depth_m", "gbuffer.normal_ws", "gbuffer.albedo", "lighting.irradiance"),
            optional=(
                "caustics.irradiance",
                *(("lighting.highlight",) if has_highlights(setup) else ()),
                *(("gbuffer.emissive",) if emits else ()),
            ),
            note="light on the opaque surfaces' colours, and the sky",
        )
    )


def _execute_shade(ctx: PassContext) -> None:
    optional = {
        "HIGHLIGHT": ("t_highlight", "lighting.highlight"),
        "EMISSIVE": ("t_emissive", "gbuffer.emissive"),
        "CAUSTICS": ("t_caustics", "caustics.irradiance"),
    }
    program = ctx.device.program("passes/shade/shade", {f"HAS_{k}": int(ctx.has(r)) for k, (_, r) in optional.items()})
    textures = {name: ctx.texture(resource) for name, resource in optional.values() if ctx.has(resource)}
    program.set_all(
        {
            **ctx.frame.uniforms(),
            **sky_uniforms(ctx.setup),
            **textures,
            "t_depth_m": ctx.texture("gbuffer.depth_m"),
            "t_normal_ws": ctx.texture("gbuffer.normal_ws"),
            "t_albedo": ctx.texture("gbuffer.albedo"),
            "t_irradiance": ctx.texture("lighting.irradiance"),
        }
    )
    ctx.device.draw_fullscreen(program, ctx.target("shade.radiance"))


def sky_uniforms(setup: FrameSetup) -> dict[str, Any]:
    """Uniforms of `interface/sky.glsl`."""
    sky = setup.scene.sky
    return {"u_sky_zenith": sky.zenith, "u_sky_horizon": sky.horizon, "u_sky_ground": sky.ground}
