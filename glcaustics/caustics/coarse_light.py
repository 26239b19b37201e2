"""The light maps' solve without a map: where a coarse light lands, for methods that draw no map of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from glcaustics.caustics.branches import Branch
from glcaustics.caustics.light_solve import LightMapMethod
from glcaustics.graph import FrameGraph
from glcaustics.passes.frame import FrameSetup, LightSetup
from glcaustics.passes.receiver_views import ReceiverView


class CoarseLight(LightMapMethod):
    """What `landing.fit_layers` solves by. Not in the registry: it shows nothing."""

    name = "coarse_light"
    summary = "where light lands"
    paper = ""
    ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {}

    def declare_map(
        self, graph: FrameGraph, setup: FrameSetup, light: LightSetup, receiver: ReceiverView, branches: list[Branch]
    ) -> None:
        """Nothing: the landing points are all that is asked for."""
