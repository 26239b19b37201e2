"""Faces of solids seen from each light, and how many: what shaders of a way through solids (solid_way.glsl) read."""

from __future__ import annotations

from typing import Any

import numpy as np

from glcaustics.caustics.branches import SOLID, Branch
from glcaustics.graph import FrameGraph
from glcaustics.passes import light_view
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup, LightSetup
from glcaustics.passes.geometry import boxes_of
from glcaustics.passes.solid_contents import reach_into, triangle_boxes
from glcaustics.scene.model import Instance, OpticalKind

ONE_PAIR, TWO_PAIRS = ("back",), ("back", "front2", "back2")


class SolidViews:
    """Faces of solids behind the first, a light.

    Attributes:
        receivers_inside: opaque surfaces reach into solids, and light may end on them.
    """

    def __init__(self) -> None:
        self.receivers_inside = False
        self._layers: dict[int, int] = {}
        self._why_one_pair: dict[int, str] = {}

    def layers(self, light: LightSetup) -> int:
        """Pairs of front and back faces by which this light's way through solids is followed: 1, or 2."""
        return self._layers.get(light.index, 1)

    def set_layers(self, light: LightSetup, layers: int, because: str = "") -> None:
        """`because`: why one pair is enough."""
        self._layers[light.index] = layers
        self._why_one_pair[light.index] = because

    def declare(self, graph: FrameGraph, setup: FrameSetup, light: LightSetup) -> None:
        """The passes that draw the faces, or why there are none."""
        if OpticalKind.SOLID not in setup.kinds():
            graph.leave_out(f"caster_back{light.resource('')}", "nothing in the scene is a solid with two interfaces")
            return
        light_view.declare_caster_back(graph, setup, light)
        if self.layers(light) == 2:
            light_view.declare_caster_layers(graph, light)
        else:
            because = self._why_one_pair.get(light.index) or "a coarse light decides before the first frame"
            graph.leave_out(f"caster_front2{light.resource('')}", because)

    def reads(self, light: LightSetup, branch: Branch) -> dict[str, str]:
        """Samplers and resources of the way through solids, empty for other branches."""
        if branch.kind != SOLID:
            return {}
        faces = TWO_PAIRS if self.layers(light) == 2 else ONE_PAIR
        whats = ("position", "normal")
        return {f"t_{face}_{what}": light.resource(f"caster.{face}_{what}_ws") for face in faces for what in whats}

    def defines(self, light: LightSetup, branch: Branch) -> dict[str, int]:
        """LAYERS and RECEIVERS_INSIDE."""
        is_solid = branch.kind == SOLID
        return {
            "LAYERS": self.layers(light) if is_solid else 1,
            "RECEIVERS_INSIDE": int(is_solid and self.receivers_inside),
        }

    def uniforms(self, ctx: PassContext, light: LightSetup, branch: Branch) -> dict[str, Any]:
        """Textures of the faces, the box around the solids, and the option `internal_bounces`."""
        if branch.kind != SOLID:
            return {}
        boxes = [item.bounds_ws for item in ctx.frame.gpu.select(OpticalKind.SOLID)]
        return {
            **{name: ctx.texture(resource) for name, resource in self.reads(light, branch).items()},
            "u_caster_min_ws": tuple(np.min([b[0] for b in boxes], axis=0)),
            "u_caster_max_ws": tuple(np.max([b[1] for b in boxes], axis=0)),
            "u_internal_bounces": int(ctx.setup.options["internal_bounces"]),
        }


def receivers_inside_solids(everything: tuple[Instance, ...]) -> bool:
    """Whether a triangle of an opaque surface reaches into the box of a solid: light may end in there."""
    boxes = boxes_of(i for i in everything if i.optical_kind is OpticalKind.SOLID)
    if len(boxes) == 0:
        return False
    for instance in everything:
        if instance.optical_kind is OpticalKind.DIFFUSE:
            least, most = triangle_boxes(instance)
            for low, high in boxes:
                air = 1e-4 * (high - low)  # what stands on a floor, or is cut from the same grid, touches
                if reach_into(least, most, low, high, air):
                    return True
    return False
