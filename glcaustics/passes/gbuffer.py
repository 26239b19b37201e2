"""The camera's G-buffer: the opaque layer, the specular layer in front of it, and the specular layer's back faces."""

from __future__ import annotations

from typing import Any

from glcaustics.gpu import Program
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.frame import FrameSetup, PassContext
from glcaustics.passes.geometry import SPECULAR_KINDS, DrawItem
from glcaustics.scene.model import OpticalKind

SHADER = "passes/gbuffer/gbuffer"
NOTHING = {"HAS_ALBEDO": 0, "HAS_MATERIAL": 0, "HAS_EMISSIVE": 0, "HAS_MOTION": 0, "HAS_PLANE": 0}


def declare_opaque(graph: FrameGraph, setup: FrameSetup) -> None:
    """Depth, normal, base colour, roughness, emission and motion of the nearest opaque surface."""
    size = setup.size
    writes = {
        "gbuffer.depth_m": TextureDesc("r32f", size, "m"),
        "gbuffer.normal_ws": TextureDesc("rgba16f", size),
        "gbuffer.albedo": TextureDesc("rgba16f", size),
        "gbuffer.material": TextureDesc("rg16f", size),
        "gbuffer.emissive": TextureDesc("rgba16f", size, "cd/m^2"),
        "gbuffer.motion": TextureDesc("rg16f", size, "uv"),
        "gbuffer.plane": TextureDesc("rgba32f", size),
        "gbuffer.depth": TextureDesc("depth24", size),
    }
    graph.add(
        PassDecl(
            "gbuffer",
            writes,
            _draw_opaque,
            always_writes=("gbuffer.depth",),
            note="opaque surfaces seen by the eye",
            view_dependent=True,
        )
    )


def _draw_opaque(ctx: PassContext) -> None:
    names = ("depth_m", "normal_ws", "albedo", "material", "emissive", "motion", "plane")
    target = ctx.target(*(f"gbuffer.{n}" for n in names), depth="gbuffer.depth")
    target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    live = ctx.locations(**{n.upper(): f"gbuffer.{n}" for n in names})
    _draw(ctx, target, ctx.frame.gpu.select(OpticalKind.DIFFUSE), {**live, "LAYER_SPECULAR": 0, "BACK": 0}, {})


def declare_specular(graph: FrameGraph, setup: FrameSetup) -> None:
    """Depth and normal of the nearest specular surface, where it stands in front of the opaque layer."""
    graph.add(
        PassDecl(
            "gbuffer.specular",
            {
                "specular.depth_m": TextureDesc("r32f", setup.size, "m"),
                "specular.normal_ws": TextureDesc("rgba32f", setup.size),
                "specular.plane": TextureDesc("rgba32f", setup.size),
                "specular.motion": TextureDesc("rg16f", setup.size, "uv"),
                "specular.depth": TextureDesc("depth24", setup.size),
            },
            _draw_specular,
            reads=("gbuffer.depth_m",),
            always_writes=("specular.depth",),
            note="water, glass and mirrors seen by the eye",
            view_dependent=True,
        )
    )


def _draw_specular(ctx: PassContext) -> None:
    names = ("depth_m", "normal_ws", "plane", "motion")
    target = ctx.target(*(f"specular.{n}" for n in names), depth="specular.depth")
    target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    live = ctx.locations(**{n.upper(): f"specular.{n}" for n in names})
    defines = {**NOTHING, **live, "LAYER_SPECULAR": 1, "BACK": 0}
    _draw(
        ctx,
        target,
        ctx.frame.gpu.select(*SPECULAR_KINDS),
        defines,
        {"t_opaque_depth_m": ctx.texture("gbuffer.depth_m")},
    )


def declare_back(graph: FrameGraph, setup: FrameSetup) -> None:
    """Depth and normal of the first back face behind the front of the same solid."""
    graph.add(
        PassDecl(
            "gbuffer.specular_back",
            {
                "specular.back_normal_ws": TextureDesc("rgba32f", setup.size, filter="linear"),
                "specular.back_plane": TextureDesc("rgba32f", setup.size),
                "specular.back_depth": TextureDesc("depth24", setup.size),
            },
            _draw_back,
            reads=("specular.depth_m", "specular.normal_ws"),
            always_writes=("specular.back_depth",),
            note="back faces of solids seen by the eye",
            view_dependent=True,
        )
    )


def _draw_back(ctx: PassContext) -> None:
    target = ctx.target("specular.back_normal_ws", "specular.back_plane", depth="specular.back_depth")
    target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    live = ctx.locations(NORMAL_WS="specular.back_normal_ws", PLANE="specular.back_plane")
    defines = {**NOTHING, "HAS_DEPTH_M": 0, **live, "LAYER_SPECULAR": 0, "BACK": 1}
    fronts = {"t_front_depth_m": ctx.texture("specular.depth_m"), "t_front_normal": ctx.texture("specular.normal_ws")}
    _draw(ctx, target, ctx.frame.gpu.select(OpticalKind.SOLID), defines, fronts, cull="front")


def _draw(
    ctx: PassContext,
    target: Any,
    items: list[DrawItem],
    defines: dict[str, int],
    textures: dict[str, Any],
    cull: str | None = None,
) -> None:
    camera = ctx.frame.camera

    def program(item: DrawItem) -> Program:
        material = item.instance.material
        colors = defines["HAS_ALBEDO"] or defines["HAS_MATERIAL"]
        maps = {
            "HAS_BASE_COLOR_MAP": int(bool(colors) and material.base_color_image is not None),
            "HAS_METALLIC_ROUGHNESS_MAP": int(bool(colors) and material.metallic_roughness_image is not None),
            "HAS_EMISSIVE_MAP": int(bool(defines["HAS_EMISSIVE"]) and material.emissive_image is not None),
        }
        normals = {"HAS_NORMAL": defines["HAS_NORMAL_WS"], "HAS_UV": int(any(maps.values()))}
        motion = {"HAS_PREVIOUS_POSITION": int(bool(defines["HAS_MOTION"]) and item.mesh.changed)}
        made = ctx.device.program(SHADER, {**defines, **maps, **motion, **normals})
        made.set_all({**camera.uniforms(), "u_clip_from_world": camera.clip_from_world, **textures})
        if made.declares("t_objects"):
            made.set(t_objects=ctx.frame.gpu.objects)
        return made

    def per_item(made: Program, item: DrawItem) -> None:
        material, gpu = item.instance.material, ctx.frame.gpu
        if made.declares("t_base_color") and material.base_color_image is not None:
            made.set_all({"t_base_color": gpu.image(material.base_color_image)})
        if made.declares("t_metallic_roughness") and material.metallic_roughness_image is not None:
            made.set_all({"t_metallic_roughness": gpu.image(material.metallic_roughness_image)})
        if made.declares("t_emissive") and material.emissive_image is not None:
            made.set_all({"t_emissive": gpu.image(material.emissive_image)})
        if defines["HAS_MOTION"]:
            before = ctx.frame.previous_transforms.get(item.instance.name, item.world_from_object)
            made.set(u_previous_clip_from_object=ctx.frame.previous_camera.clip_from_world @ before)

    ctx.frame.gpu.draw(program, target, items, per_item=per_item, cull=cull)
