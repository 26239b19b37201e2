"""Textures, framebuffers and buffers, each checked: a refused allocation is an error, not a black image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from glcaustics.errors import DeviceError, ResourceLimitError, UsageError
from glcaustics.gpu import gl_enums as gl
from glcaustics.gpu.rawgl import RawGL


@dataclass(frozen=True)
class Format:
    """How moderngl names a texture format, and its bytes per texel."""

    components: int
    dtype: str
    bytes_per_texel: int
    internal_format: int | None = None


FORMATS: dict[str, Format] = {
    "rgba32f": Format(4, "f4", 16),
    "rg32f": Format(2, "f4", 8),
    "r32f": Format(1, "f4", 4),
    "rgba16f": Format(4, "f2", 8),
    "rg16f": Format(2, "f2", 4),
    "r16f": Format(1, "f2", 2),
    "rgba8": Format(4, "f1", 4),
    "srgba8": Format(4, "f1", 4, gl.SRGB8_ALPHA8),
    "r8": Format(1, "f1", 1),
    "depth24": Format(1, "f4", 4),
    "depth32f": Format(1, "f4", 4),
}

_NUMPY_TYPES = {"f1": np.uint8, "f2": np.float16, "f4": np.float32}


@dataclass(frozen=True)
class TextureInfo:
    """Kept in `texture.extra` of every texture made here: what moderngl does not remember."""

    label: str
    format: str
    compare: bool
    bytes: int


@dataclass(frozen=True)
class FramebufferInfo:
    """Kept in `framebuffer.extra` of every framebuffer made here; its absence marks one of the host's."""

    label: str


#: name -> filter within a level, and across levels of a mip chain
_FILTERS = {
    "nearest": (moderngl.NEAREST, moderngl.NEAREST_MIPMAP_NEAREST),
    "linear": (moderngl.LINEAR, moderngl.LINEAR_MIPMAP_LINEAR),
}


def make_texture(
    ctx: moderngl.Context,
    raw: RawGL,
    max_size: int,
    size: tuple[int, int],
    format: str,
    *,
    filter: str,
    compare: bool,
    label: str,
    data: Any,
    repeat: bool,
    mipmaps: bool,
) -> moderngl.Texture:
    """See `Device.texture`."""
    name = f"texture '{label}'" if label else "texture"
    if filter not in _FILTERS:
        raise UsageError(f"{name}: filter '{filter}' is unknown", remedy=f"use {' or '.join(_FILTERS)}")
    size = (int(size[0]), int(size[1]))
    _check_request(name, size, format, compare, max_size)
    kind = FORMATS[format]
    payload = None if data is None else _pixels(name, data, size, kind)
    texture = _allocate(ctx, raw, name, size, format, payload)
    texture.repeat_x = texture.repeat_y = repeat
    magnify, minify_mipmap = _FILTERS[filter]
    texture.filter = (magnify, magnify)
    if format.startswith("depth"):
        texture.compare_func = "<=" if compare else ""
    if mipmaps:
        texture.build_mipmaps()
        texture.filter = (minify_mipmap, magnify)
    texture.extra = TextureInfo(label, format, compare, size[0] * size[1] * kind.bytes_per_texel)
    _check_allocation(ctx, name, size, format, texture)
    return texture


def _check_request(name: str, size: tuple[int, int], format: str, compare: bool, max_size: int) -> None:
    if format not in FORMATS:
        raise UsageError(f"{name}: format '{format}' is unknown", remedy=f"use one of {', '.join(FORMATS)}")
    if compare and not format.startswith("depth"):
        raise UsageError(f"{name}: depth compare asked of the colour format {format}", remedy="use depth24")
    if min(size) < 1 or max(size) > max_size:
        raise ResourceLimitError(
            f"{name}: {size[0]} x {size[1]} texels, allowed are 1 to {max_size} a side",
            remedy="ask for a smaller image or map size" if max(size) > max_size else "give a size of at least 1 x 1",
        )


def _pixels(name: str, data: Any, size: tuple[int, int], kind: Format) -> bytes:
    """Bytes of the data, rows from v = 0 upwards; arrays are (H, W), (H, W, C) and are cast among float types only."""
    if isinstance(data, (bytes, bytearray, memoryview)):
        payload = bytes(data)
    else:
        array = np.asarray(data)
        wanted = _NUMPY_TYPES[kind.dtype]
        if (array.dtype == np.uint8) != (wanted is np.uint8):
            raise UsageError(f"{name}: data is {array.dtype}, the format {np.dtype(wanted)}", remedy="convert it first")
        payload = np.ascontiguousarray(array, dtype=wanted).tobytes()
    expected = size[0] * size[1] * kind.components * np.dtype(_NUMPY_TYPES[kind.dtype]).itemsize
    if len(payload) != expected:
        raise UsageError(
            f"{name}: {len(payload)} bytes of data for {size[0]} x {size[1]} texels of {kind.components} components, "
            f"which need {expected}",
            remedy="give an array of shape (height, width, components)",
        )
    return payload


def _allocate(
    ctx: moderngl.Context, raw: RawGL, name: str, size: tuple[int, int], format: str, payload: bytes | None
) -> moderngl.Texture:
    ctx.clear_errors()
    kind = FORMATS[format]
    try:
        if format == "depth24":
            return ctx.depth_texture(size, payload)
        if format == "depth32f":
            # moderngl knows 24-bit depth only: take its texture and give it other storage.
            texture = ctx.depth_texture(size)
            raw.glActiveTexture(gl.TEXTURE0 + ctx.default_texture_unit)
            raw.glBindTexture(gl.TEXTURE_2D, texture.glo)
            raw.glTexImage2D(gl.TEXTURE_2D, 0, gl.DEPTH_COMPONENT32F, *size, 0, gl.DEPTH_COMPONENT, gl.FLOAT, payload)
            return texture
        return ctx.texture(size, kind.components, payload, dtype=kind.dtype, internal_format=kind.internal_format)
    except moderngl.Error as error:
        raise ResourceLimitError(f"{name}: {size[0]} x {size[1]} {format}: {error}") from error


def _check_allocation(
    ctx: moderngl.Context, name: str, size: tuple[int, int], format: str, texture: moderngl.Texture
) -> None:
    error = ctx.error
    if error == "GL_NO_ERROR":
        return
    megabytes = size[0] * size[1] * FORMATS[format].bytes_per_texel / 1e6
    texture.release()
    raise ResourceLimitError(
        f"{name}: the driver refused {size[0]} x {size[1]} {format}, {megabytes:.0f} MB ({error})",
        remedy="ask for a smaller image or map size, or a lower quality",
    )


def make_framebuffer(
    ctx: moderngl.Context, colors: Sequence[moderngl.Texture], depth: moderngl.Texture | None, label: str
) -> moderngl.Framebuffer:
    """See `Device.framebuffer`."""
    name = f"framebuffer '{label}'" if label else "framebuffer"
    attachments = [*colors, *([depth] if depth is not None else [])]
    if not attachments:
        raise DeviceError(f"{name} has no attachment")
    sizes = {attachment.size for attachment in attachments}
    if len(sizes) > 1:
        listed = ", ".join(f"{a.extra.label if a.extra else a.glo} {a.size[0]} x {a.size[1]}" for a in attachments)
        raise DeviceError(f"{name}: attachments differ in size: {listed}", remedy="give them one size")
    try:
        framebuffer = ctx.framebuffer(list(colors), depth)
    except moderngl.Error as error:
        raise DeviceError(f"{name}: {error}", remedy="the driver cannot render to one of these formats") from error
    if ctx.error != "GL_NO_ERROR":
        framebuffer.release()
        raise DeviceError(f"{name} could not be made")
    framebuffer.extra = FramebufferInfo(label)
    return framebuffer


def read_texture(texture: moderngl.Texture) -> np.ndarray:
    """See `Device.read`."""
    array = np.frombuffer(texture.read(), _NUMPY_TYPES[texture.dtype])
    width, height = texture.size
    shape = (height, width) if texture.components == 1 else (height, width, texture.components)
    return array.reshape(shape).astype(np.float32 if texture.dtype == "f2" else array.dtype)
