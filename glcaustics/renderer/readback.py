"""Resources of a frame as arrays; OpenGL's row 0 is at the bottom, a picture's on top."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from glcaustics.passes.runner import PlanRunner


def read_floats(runner: PlanRunner, resource: str, components: int) -> npt.NDArray[np.float32]:
    """(H, W, components) of a resource of 16- or 32-bit floats, its first components; (H, W) of one."""
    data = runner.read(resource)[::-1]
    if data.ndim == 3:
        data = data[..., 0] if components == 1 else data[..., :components]
    return np.ascontiguousarray(data, np.float32)


def read_rgb8(runner: PlanRunner, resource: str) -> npt.NDArray[np.uint8]:
    """(H, W, 3) of an rgba8 resource."""
    return np.ascontiguousarray(runner.read(resource)[::-1, :, :3])
