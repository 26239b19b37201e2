"""Direct lighting of an opaque layer, and its outgoing radiance."""

from __future__ import annotations

from typing import Any

import moderngl

from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup, LightSetup
from glcaustics.passes.light_views import light_uniforms
from glcaustics.scene.model import OpticalKind

OPTIONAL_LIGHT = ("HIGHLIGHT", "EMISSIVE", "CAUSTICS", "FIRST", "FIRST_CAUSTICS")  # textures that `shade` may lack


def declare_lighting(graph: FrameGraph, setup: FrameSetup, layer: str = "") -> None:
    """Irradiance and highlights of all lights, added up, each with its shadow map; layer: "" or `gbuffer.SECOND`."""
    surface = f"gbuffer{layer}"
    graph.add(
        PassDecl(
            f"lighting{layer}",
            {
                f"lighting{layer}.irradiance": TextureDesc("rgba32f", setup.size, "lux"),
                f"lighting{layer}.highlight": TextureDesc("rgba32f", setup.size, "cd/m^2"),
            },
            lambda ctx: _execute_lighting(ctx, layer),
            reads=(f"{surface}.depth_m", f"{surface}.normal_ws", *((f"{surface}.depth",) if layer else ())),
            optional=(
                *(light.resource("shadow.depth") for light in setup.lights if light.shadow is not None),
                *((f"{surface}.albedo", f"{surface}.material") if has_highlights(setup) else ()),
            ),
            note="direct light with shadows",
        )
    )


def has_highlights(setup: FrameSetup) -> bool:
    """Whether some receiver is smooth or metallic enough to show a highlight."""
    materials = [i.material for i in setup.instances() if i.optical_kind is OpticalKind.DIFFUSE]
    return any(m.roughness < 0.95 or m.metallic > 0.05 or m.metallic_roughness_image is not None for m in materials)


def _execute_lighting(ctx: PassContext, layer: str) -> None:
    surface = f"gbuffer{layer}"
    outputs = (f"lighting{layer}.irradiance", f"lighting{layer}.highlight")
    highlight = ctx.live(outputs[1]) and ctx.has(f"{surface}.material")
    ctx.target(*outputs).clear(0.0, 0.0, 0.0, 0.0)
    # The second layer is mostly empty: its depth buffer keeps the shader from running there.
    target = ctx.target(*outputs, depth=f"{surface}.depth" if layer else None)
    textures: dict[str, Any] = {
        "t_depth_m": ctx.texture(f"{surface}.depth_m"),
        "t_normal_ws": ctx.texture(f"{surface}.normal_ws"),
    }
    if highlight:
        textures |= {"t_albedo": ctx.texture(f"{surface}.albedo"), "t_material": ctx.texture(f"{surface}.material")}
    for light in ctx.setup.lights:
        _draw_light(ctx, light, target, textures, highlight, masked=bool(layer))


def _draw_light(
    ctx: PassContext,
    light: LightSetup,
    target: moderngl.Framebuffer,
    textures: dict[str, Any],
    highlight: bool,
    *,
    masked: bool,
) -> None:
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
    ctx.device.draw_fullscreen(program, target, blend="add", depth_func=">" if masked else None)


def declare_shade(graph: FrameGraph, setup: FrameSetup, layer: str = "") -> None:
    """Radiance of an opaque layer: direct, caustic and sky light on its base colour, highlights, emission; the sky
    behind. The second layer's picture (and its caustic irradiance) is the first one's where it holds nothing.
    """
    emits = any(any(c > 0.0 for c in i.material.emissive) for i in setup.instances())
    surface, caustics = f"gbuffer{layer}", TextureDesc("rgba32f", setup.size, "lux", filter="linear")
    graph.add(
        PassDecl(
            f"shade{layer}",
            {
                f"shade{layer}.radiance": TextureDesc("rgba32f", setup.size, "cd/m^2", filter="linear"),
                **({f"shade{layer}.caustic_irradiance": caustics} if layer else {}),
            },
            lambda ctx: _execute_shade(ctx, layer),
            reads=(
                *(f"{surface}.{name}" for name in ("depth_m", "normal_ws", "albedo")),
                f"lighting{layer}.irradiance",
                *(("shade.radiance",) if layer else ()),
            ),
            optional=(
                f"caustics{layer}.irradiance",
                *((f"lighting{layer}.highlight",) if has_highlights(setup) else ()),
                *((f"{surface}.emissive",) if emits else ()),
                *(("caustics.irradiance",) if layer else ()),
            ),
            note="light on the opaque surfaces' colours, " + ("the first layer elsewhere" if layer else "and the sky"),
        )
    )


def _execute_shade(ctx: PassContext, layer: str) -> None:
    resources = {
        "t_depth_m": f"gbuffer{layer}.depth_m",
        "t_normal_ws": f"gbuffer{layer}.normal_ws",
        "t_albedo": f"gbuffer{layer}.albedo",
        "t_irradiance": f"lighting{layer}.irradiance",
        "t_highlight": f"lighting{layer}.highlight",
        "t_emissive": f"gbuffer{layer}.emissive",
        "t_caustics": f"caustics{layer}.irradiance",
        **({"t_first": "shade.radiance", "t_first_caustics": "caustics.irradiance"} if layer else {}),
    }
    textures = {name: ctx.texture(resource) for name, resource in resources.items() if ctx.has(resource)}
    outputs = [f"shade{layer}.radiance", *([f"shade{layer}.caustic_irradiance"] if layer else [])]
    defines = {f"HAS_{name}": int(f"t_{name.lower()}" in textures) for name in OPTIONAL_LIGHT}
    defines["HAS_CAUSTICS_OUT"] = int(bool(layer) and ctx.live(outputs[1]))
    program = ctx.device.program("passes/shade/shade", defines)
    program.set_all({**ctx.frame.uniforms(), **sky_uniforms(ctx.setup), **textures})
    ctx.device.draw_fullscreen(program, ctx.target(*outputs))


def sky_uniforms(setup: FrameSetup) -> dict[str, Any]:
    """Uniforms of `interface/sky.glsl`."""
    sky = setup.scene.sky
    return {"u_sky_zenith": sky.zenith, "u_sky_horizon": sky.horizon, "u_sky_ground": sky.ground}
