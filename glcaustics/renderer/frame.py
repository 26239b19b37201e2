"""What a caller gets of one rendered frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.output import save_frame


@dataclass(eq=False)
class Frame:
    """One rendered frame; arrays with row 0 on top.

    `image`: (H, W, 3) float32 linear radiance. `ldr`: (H, W, 3) uint8 sRGB. `aov`: name -> (H, W) or (H, W, 3) float32.
    `stats`: numbers for machines: per pass milliseconds and bytes, per solve iterations, converged, failed, lost flux.
    """

    image: npt.NDArray[np.float32]
    ldr: npt.NDArray[np.uint8]
    aov: dict[str, npt.NDArray[np.float32]]
    stats: dict[str, Any]

    def save(self, path: str | Path) -> None:
        """Write .png, .npz or .exr; see `glcaustics.output`."""
        save_frame(path, image=self.image, ldr=self.ldr, aov=self.aov)
