"""The camera's G-buffer: one or two opaque layers, the specular layer in front of them, its back faces."""

from __future__ import annotations

from typing import Any

import numpy as np

from glcaustics.gpu import Program
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.eye_medium import holds
from glcaustics.passes.frame import FrameSetup
from glcaustics.passes.geometry import SPECULAR_KINDS, DrawItem
from glcaustics.scene.model import FloatArray, OpticalKind

SHADER = "passes/gbuffer/gbuffer"
SECOND = "2"  # suffix of the second layer's passes and resources: gbuffer2, lighting2, shade2, caustics2
LAYERS = ("", SECOND)
NO_LAYER = {"LAYER_SPECULAR": 0, "BACK": 0, "PEEL": 0, "OTHER": 0}
NOTHING = {**NO_LAYER, "HAS_ALBEDO": 0, "HAS_MATERIAL": 0, "HAS_EMISSIVE": 0, "HAS_MOTION": 0, "HAS_PLANE": 0}


def declare_opaque(graph: FrameGraph, setup: FrameSetup) -> None:
    """Depth, normal, base colour, roughness, emission and motion of the nearest opaque surface."""
    graph.add(
        PassDecl(
            "gbuffer",
            {**_layer_writes(setup, ""), "gbuffer.motion": TextureDesc("rg16f", setup.size, "uv")},
            _draw_opaque,
            always_writes=("gbuffer.depth",),
            note="opaque surfaces seen by the eye",
            view_dependent=True,
        )
    )


def declare_second(graph: FrameGraph, setup: FrameSetup) -> None:
    """The same of the next opaque surface behind the nearest one (depth peeling: Everitt 2001). Depth 0 where there is
    none; `gbuffer2.plane` alone holds the first layer's plane there, so that a wall goes on behind what stands before
    it. Back faces of closed meshes are left out unless the eye is inside: nobody can see them.
    """
    graph.add(
        PassDecl(
            "gbuffer2",
            _layer_writes(setup, SECOND),
            _draw_second,
            reads=("gbuffer.plane",),
            always_writes=("gbuffer2.depth",),
            note="opaque surfaces behind the first ones",
            view_dependent=True,
        )
    )


def _layer_writes(setup: FrameSetup, layer: str) -> dict[str, TextureDesc]:
    formats = {
        "depth_m": ("r32f", "m"),
        "normal_ws": ("rgba16f", ""),
        "albedo": ("rgba16f", ""),
        "material": ("rg16f", ""),
        "emissive": ("rgba16f", "cd/m^2"),
        "plane": ("rgba32f", ""),
        "depth": ("depth24", ""),
    }
    return {f"gbuffer{layer}.{name}": TextureDesc(f, setup.size, unit) for name, (f, unit) in formats.items()}


def _draw_opaque(ctx: PassContext) -> None:
    names = ("depth_m", "normal_ws", "albedo", "material", "emissive", "motion", "plane")
    target = ctx.target(*(f"gbuffer.{n}" for n in names), depth="gbuffer.depth")
    target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    live = ctx.locations(**{n.upper(): f"gbuffer.{n}" for n in names})
    draw_layer(ctx, target, ctx.frame.gpu.select(OpticalKind.DIFFUSE), {**NO_LAYER, **live}, {})


def _draw_second(ctx: PassContext) -> None:
    names = ("depth_m", "normal_ws", "albedo", "material", "emissive", "plane")
    target = ctx.target(*(f"gbuffer2.{n}" for n in names), depth="gbuffer2.depth")
    target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    first = ctx.texture("gbuffer.plane")
    if ctx.live("gbuffer2.plane"):
        copy = ctx.device.program("passes/gbuffer/copy_plane").set(t_plane=first)
        ctx.device.draw_fullscreen(copy, ctx.target("gbuffer2.plane"))
    live = ctx.locations(**{n.upper(): f"gbuffer2.{n}" for n in names})
    defines = {**NO_LAYER, **live, "HAS_MOTION": 0, "PEEL": 1}
    eye_ws = ctx.frame.camera.world_from_camera[:3, 3]
    items = ctx.frame.gpu.select(OpticalKind.DIFFUSE)
    one_sided = [item for item in items if _shows_fronts_only(item, eye_ws)]
    draw_layer(ctx, target, one_sided, defines, {"t_first_plane": first}, cull="back")
    draw_layer(ctx, target, [i for i in items if i not in one_sided], defines, {"t_first_plane": first})


def _shows_fronts_only(item: DrawItem, eye_ws: FloatArray) -> bool:
    """Whether an eye there can see no back face: of a closed mesh, from outside. Not where mirroring swaps them."""
    closed = item.instance.mesh.watertight and float(np.linalg.det(item.world_from_object[:3, :3])) > 0.0
    return closed and not holds(item.instance, item.bounds_ws, eye_ws)


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
    defines = {**NOTHING, **live, "LAYER_SPECULAR": 1}
    draw_layer(
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
    defines = {**NOTHING, "HAS_DEPTH_M": 0, **live, "BACK": 1}
    fronts = {"t_front_depth_m": ctx.texture("specular.depth_m"), "t_front_normal": ctx.texture("specular.normal_ws")}
    draw_layer(ctx, target, ctx.frame.gpu.select(OpticalKind.SOLID), defines, fronts, cull="front")


def draw_layer(
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
