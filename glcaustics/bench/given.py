"""The frame with a given caustic irradiance in place of a method's: what the picture would be with the truth in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from glcaustics.caustics.method import IRRADIANCE, CausticsMethod
from glcaustics.caustics.registry import METHODS
from glcaustics.errors import UsageError
from glcaustics.graph import FrameGraph, PassDecl
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup
from glcaustics.quality import QUALITIES

NAME = "given irradiance"


class _GivenIrradiance(CausticsMethod):
    """Uploads `image` as E_c; `given_irradiance` makes a subclass for each image."""

    name = NAME
    summary = "an image in place of a method"
    paper = "none"
    ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {quality: {} for quality in QUALITIES}
    image: ClassVar[npt.NDArray[np.floating]]

    @classmethod
    def validate(cls, options: Mapping[str, Any]) -> None:
        """There is nothing to choose."""

    def declare(self, graph: FrameGraph, setup: FrameSetup) -> None:
        height, width = self.image.shape[:2]
        if setup.size != (width, height):
            given, wanted = f"{width}x{height}", "x".join(map(str, setup.size))
            raise UsageError(f"the irradiance is {given}, the frame {wanted}", where=NAME, remedy="give equal sizes")
        graph.add(PassDecl(NAME, {IRRADIANCE: self.irradiance_desc(setup)}, self._upload, note=self.summary))

    def _upload(self, ctx: PassContext) -> None:
        height, width = self.image.shape[:2]
        pixels = np.zeros((height, width, 4), np.float32)
        pixels[..., :3] = self.image[::-1]  # OpenGL's first row is the lowest
        texture: Any = ctx.target(IRRADIANCE).color_attachments[0]
        texture.write(pixels.tobytes())

    def leave_out(self, graph: FrameGraph, setup: FrameSetup, because: str) -> None:
        graph.leave_out(NAME, because)


@contextmanager
def given_irradiance(image: npt.NDArray[np.floating]) -> Iterator[str]:
    """Within: the name of a method that gives this irradiance (H, W, 3), row 0 on top, in the scene's units."""
    METHODS[NAME] = type("GivenIrradiance", (_GivenIrradiance,), {"image": image})
    try:
        yield NAME
    finally:
        del METHODS[NAME]
