"""Textures as arrays; OpenGL's row 0 is at the bottom, an array's on top."""

from __future__ import annotations

import moderngl
import numpy as np
import numpy.typing as npt


def read_floats(texture: moderngl.Texture, components: int) -> npt.NDArray[np.float32]:
    """(H, W, components) of a texture of 16- or 32-bit floats, its first components; (H, W) of one."""
    kind = {"f4": np.float32, "f2": np.float16}[texture.dtype]
    data = np.frombuffer(texture.read(), kind).reshape(texture.height, texture.width, texture.components)
    flipped = np.ascontiguousarray(data[::-1, :, :components], np.float32)
    return flipped[..., 0] if components == 1 else flipped


def read_rgb8(texture: moderngl.Texture) -> npt.NDArray[np.uint8]:
    """(H, W, 3) of an rgba8 texture."""
    data = np.frombuffer(texture.read(), np.uint8).reshape(texture.height, texture.width, 4)
    return np.ascontiguousarray(data[::-1, :, :3])
