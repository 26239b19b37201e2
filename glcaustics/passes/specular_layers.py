"""The second specular layer: water, glass and mirrors behind other water and glass, seen from the camera.

Peeled by object (Everitt 2001 peels by depth): of all objects but the one in front, the nearest. A solid's own far side
is its exit, not another layer. Where nothing stands behind the first surface this layer is the first one, since a ray
that leaves a glass meets what stands beside it, too. `refraction` goes on where its rays meet it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from glcaustics.gpu import Program
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes import depth_chain
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup, FrameState
from glcaustics.passes.gbuffer import NOTHING, draw_layer
from glcaustics.passes.geometry import SPECULAR_KINDS, TRANSMISSIVE_KINDS, DrawItem, screen_boxes_px
from glcaustics.scene.model import FloatArray, OpticalKind

MAX_LAYERS = 2
CHAIN = "specular2.chain.bounds"
READS = ("specular.plane", "specular2.plane", "specular2.normal_ws", CHAIN)
TURNED, TURNED_CHAIN = "specular2.turned_plane", "specular2.turned_chain.bounds"
BACK_READS = ("specular2.back_plane", "specular2.back_normal_ws", TURNED, TURNED_CHAIN)
MASK = "view.second_depth"
CANDIDATES = {"BEHIND": "view.behind"}
STATE = {"POINT": "view.second_point", "WAY": "view.second_way", "SHARE": "view.second_share"}


def why_not(setup: FrameSetup) -> str | None:
    """Why no view of the scene has one specular surface behind another, in words; None: some may."""
    if int(setup.options.get("specular_layers", 1)) < MAX_LAYERS:
        return "one specular layer is asked for; --set specular_layers=2 shows what stands behind it"
    waters = {water.name: water for water in setup.sampled_instances}
    kinds = [i.optical_kind for i in (*setup.static_instances, *waters.values()) if i.optical_kind in SPECULAR_KINDS]
    if len(kinds) < 2:
        return "a single specular object has no other one behind it"
    return None if set(kinds) & set(TRANSMISSIVE_KINDS) else "nothing is seen through mirrors"


def declare(graph: FrameGraph, setup: FrameSetup) -> None:
    """The layer's depth, planes and normals, its solids' back faces, and a chain to march over it."""
    because = why_not(setup)
    solids = OpticalKind.SOLID in setup.kinds()
    if because is not None:
        graph.leave_out("gbuffer.specular2", because)
        return
    plane = TextureDesc("rgba32f", setup.size)
    graph.add(
        PassDecl(
            "gbuffer.specular2",
            {
                "specular2.depth_m": TextureDesc("r32f", setup.size, "m"),
                "specular2.normal_ws": plane,
                "specular2.plane": plane,
                "specular2.depth": TextureDesc("depth24", setup.size),
            },
            _draw_second,
            reads=("gbuffer.depth_m", "specular.depth_m", "specular.normal_ws", "specular.plane"),
            always_writes=("specular2.depth",),
            note="water, glass and mirrors behind other ones",
            view_dependent=True,
        )
    )
    depth_chain.declare_over(graph, "specular2.chain", "specular2.plane", setup.size)
    if solids:
        graph.add(
            PassDecl(
                "gbuffer.specular2_back",
                {
                    "specular2.back_normal_ws": TextureDesc("rgba32f", setup.size, filter="linear"),
                    "specular2.back_plane": plane,
                    "specular2.back_depth": TextureDesc("depth24", setup.size),
                },
                _draw_back,
                reads=("specular2.depth_m", "specular2.normal_ws"),
                always_writes=("specular2.back_depth",),
                note="back faces of solids behind other specular surfaces",
                view_dependent=True,
            )
        )
        _declare_turned(graph, setup)


def _declare_turned(graph: FrameGraph, setup: FrameSetup) -> None:
    """The solids' far sides as met from behind, for rays that come down on what the eye does not see of them."""
    graph.add(
        PassDecl(
            "gbuffer.specular2_turned",
            {TURNED: TextureDesc("rgba32f", setup.size)},
            _turn,
            reads=("specular2.back_plane",),
            note="the same, as met from behind",
        )
    )
    depth_chain.declare_over(graph, "specular2.turned_chain", TURNED, setup.size)


def _turn(ctx: PassContext) -> None:
    if in_view(ctx.frame, ctx.setup.size):
        turn = ctx.device.program("passes/gbuffer/turned_plane").set(t_plane=ctx.texture("specular2.back_plane"))
        ctx.device.draw_fullscreen(turn, ctx.target(TURNED))


def reads(setup: FrameSetup) -> tuple[str, ...]:
    """What the refraction pass reads of this layer: nothing where it is left out."""
    if why_not(setup) is not None:
        return ()
    return (*READS, *(BACK_READS if OpticalKind.SOLID in setup.kinds() else ()))


def states(setup: FrameSetup) -> dict[str, TextureDesc]:
    """What the refraction pass keeps of rays that go on behind this layer."""
    if why_not(setup) is not None:
        return {}
    wide = TextureDesc("rgba32f", setup.size)
    return {
        STATE["POINT"]: wide,
        STATE["WAY"]: wide,
        STATE["SHARE"]: TextureDesc("rgba16f", setup.size),
        CANDIDATES["BEHIND"]: TextureDesc("r8", setup.size),
        MASK: TextureDesc("depth24", setup.size),
    }


def _draw_second(ctx: PassContext) -> None:
    names = {"DEPTH_M": "specular2.depth_m", "NORMAL_WS": "specular2.normal_ws", "PLANE": "specular2.plane"}
    target = ctx.target(*names.values(), depth="specular2.depth")
    view = in_view(ctx.frame, ctx.setup.size)
    if view is None:
        return
    live = ctx.locations(**names)
    first = {"t_normal": "specular.normal_ws", "t_depth_m": "specular.depth_m", "t_plane": "specular.plane"}
    copy = ctx.device.program("passes/gbuffer/copy_specular", live)
    copy.set_all(
        {name: ctx.texture(resource) for name, resource in first.items()} | {"t_objects": ctx.frame.gpu.objects}
    )
    ctx.device.draw_fullscreen(copy, target, depth_func="1", depth_write=True)
    items = ctx.frame.gpu.select(*SPECULAR_KINDS)
    _peel(ctx, target, live, [item for item in items if item.index != view.widest])
    # The widest object covers most of what it is in front of itself: there early depth testing spares its shading.
    cover = ctx.device.program("passes/gbuffer/cover").set(t_normal=ctx.texture("specular.normal_ws"))
    cover.set(u_widest=float(view.widest + 1))
    ctx.device.draw_fullscreen(cover, ctx.target(depth="specular2.depth"), depth_func="1", depth_write=True)
    _peel(ctx, target, live, [item for item in items if item.index == view.widest])


def _peel(ctx: PassContext, target: Any, live: dict[str, int], items: list[DrawItem]) -> None:
    textures = {"t_opaque_depth_m": ctx.texture("gbuffer.depth_m"), "t_front_normal": ctx.texture("specular.normal_ws")}
    defines = {**NOTHING, **live, "LAYER_SPECULAR": 1, "OTHER": 1}
    closed = [item for item in items if _shows_fronts_only(item, ctx.frame)]
    draw_layer(ctx, target, closed, defines, textures, cull="back")
    draw_layer(ctx, target, [item for item in items if item not in closed], defines, textures)


def _shows_fronts_only(item: DrawItem, frame: FrameState) -> bool:
    """A solid's far side, unless the eye is inside. Not where mirroring swaps front and back."""
    if item.kind is not OpticalKind.SOLID:
        return False
    inside = frame.eye_medium is not None and frame.eye_medium.solid == item.index
    return not inside and float(np.linalg.det(item.world_from_object[:3, :3])) > 0.0


def _draw_back(ctx: PassContext) -> None:
    target = ctx.target("specular2.back_normal_ws", "specular2.back_plane", depth="specular2.back_depth")
    if not in_view(ctx.frame, ctx.setup.size):
        return
    target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    live = ctx.locations(NORMAL_WS="specular2.back_normal_ws", PLANE="specular2.back_plane")
    defines = {**NOTHING, "HAS_DEPTH_M": 0, **live, "BACK": 1}
    fronts = {"t_front_depth_m": ctx.texture("specular2.depth_m"), "t_front_normal": ctx.texture("specular2.normal_ws")}
    draw_layer(ctx, target, ctx.frame.gpu.select(OpticalKind.SOLID), defines, fronts, cull="front")


@dataclass(frozen=True, eq=False)
class InView:
    """What of the scene's specular objects is in the picture.

    `widest`: object-table row. `others_px`: (4,) least x, least y, most x, most y of the rest.
    """

    widest: int
    others_px: FloatArray

    def uniforms(self) -> dict[str, Any]:
        """For the first stage of `refraction.frag`, which tells the pixels whose rays may meet another object."""
        return {"u_widest": float(self.widest + 1), "u_others_px": tuple(self.others_px)}


def in_view(frame: FrameState, size: tuple[int, int]) -> InView | None:
    """None unless two specular objects are in the picture, one of them transmissive."""
    items = [item for item in frame.gpu.items if item.kind in SPECULAR_KINDS]
    boxes = screen_boxes_px(np.stack([i.bounds_ws for i in items]), frame.camera.clip_from_world, size)
    seen = np.asarray(np.all(boxes[:, 0] < boxes[:, 1], axis=1))
    if seen.sum() < 2 or not any(s and i.kind in TRANSMISSIVE_KINDS for s, i in zip(seen, items, strict=True)):
        return None
    area = np.where(seen, np.prod(boxes[:, 1] - boxes[:, 0], axis=1), -1.0)
    widest = int(np.argmax(area))
    others = boxes[seen & (np.arange(len(items)) != widest)]
    return InView(items[widest].index, np.concatenate((others[:, 0].min(axis=0), others[:, 1].max(axis=0))))


def shown(ctx: PassContext) -> InView | None:
    """`in_view`, where the plan has this layer."""
    return in_view(ctx.frame, ctx.setup.size) if ctx.has(CHAIN) else None


def defines(ctx: PassContext, *, continued: bool, behind: bool) -> dict[str, int]:
    """What the refraction shader has to know: whether solids float in open waters, and in the stages of this layer,
    whether some may hold others."""
    gpu = ctx.frame.gpu
    floats = not continued and gpu.touch(OpticalKind.SOLID, OpticalKind.INTERFACE) and shown(ctx) is not None
    nested = (continued or behind) and gpu.touch(OpticalKind.SOLID, OpticalKind.SOLID, OpticalKind.MIRROR)
    return {"EXITS_UNDER": int(floats), "NESTED": int(nested)}


def clear_candidates(ctx: PassContext) -> dict[str, str]:
    """What the first stage writes besides the view: the pixels to look at."""
    ctx.target(CANDIDATES["BEHIND"]).clear(0.0, 0.0, 0.0, 0.0)
    return CANDIDATES


def look(ctx: PassContext, outputs: dict[str, str], program: Callable[..., Program]) -> None:
    """Where the first layer's rays meet this one; of the first surface, its reflection alone is left in the view.

    Args:
        outputs: X -> resource of the eye's view, X as in `outputs.glsl`.
        program: defines of the outputs -> `behind.frag` with its uniforms.
    """
    ctx.target(STATE["WAY"]).clear(0.0, 0.0, 0.0, 0.0)
    always = {f"HAS_{name}" for name in STATE}
    written = ctx.locations(**outputs, **STATE)
    made = program({name: value for name, value in written.items() if name not in always})
    made.set_all({name: ctx.texture(resource) for name, resource in _BEHIND.items() if ctx.has(resource)})
    mask = ctx.device.program("passes/refraction/todo").set(t_todo=ctx.texture(CANDIDATES["BEHIND"]))
    ctx.device.draw_fullscreen(mask, ctx.target(depth=MASK), depth_func="1", depth_write=True)
    target = ctx.target(*outputs.values(), *STATE.values(), depth=MASK)
    ctx.device.draw_fullscreen(made.set(u_mask_depth=0.75), target, depth_func="<=")


def go_on(ctx: PassContext, outputs: dict[str, str], program: Callable[..., Program]) -> None:
    """Adds what this layer shows there. program: defines of the outputs -> `refraction.frag` with its uniforms."""
    mask = ctx.device.program("passes/refraction/continued_mask").set(t_way=ctx.texture(STATE["WAY"]))
    ctx.device.draw_fullscreen(mask, ctx.target(depth=MASK), depth_func="1", depth_write=True)
    made = program(ctx.locations(**outputs))
    made.set_all({f"t_{name.lower()}": ctx.texture(resource) for name, resource in STATE.items()})
    made.set_all({name: ctx.texture(resource) for name, resource in _SECOND.items() if ctx.has(resource)})
    target = ctx.target(*outputs.values(), depth=MASK)
    ctx.device.draw_fullscreen(made.set(u_mask_depth=0.75), target, depth_func="<=", blend="add")


_BEHIND = {
    "t_behind_bounds": CHAIN,
    "t_behind_back": "specular2.back_plane",
    "t_turned_plane": TURNED,
    "t_turned_bounds": TURNED_CHAIN,
    "t_turned_normal": "specular2.back_normal_ws",
    "t_opaque_plane": "gbuffer.plane",
    "t_opaque_bounds": "depth_chain.bounds",
}
_SECOND = {
    "t_specular_normal": "specular2.normal_ws",
    "t_front_plane": "specular2.plane",
    "t_back_plane": "specular2.back_plane",
    "t_back_normal": "specular2.back_normal_ws",
    "t_first_plane": "specular.plane",
    "t_first_normal": "specular.normal_ws",
    "t_first_back_plane": "specular.back_plane",
    "t_first_back_normal": "specular.back_normal_ws",
}
