"""The part of a device that makes checked and labelled resources."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import moderngl
import numpy as np

from glcaustics.errors import ResourceLimitError, UsageError
from glcaustics.gpu.info import device_info
from glcaustics.gpu.rawgl import RawGL
from glcaustics.gpu.texture import make_framebuffer, make_texture, read_texture


class Resources:
    """Textures, framebuffers and buffers of a context; `Device` adds programs, draws, timers and the state guard.

    Attributes:
        ctx: the moderngl context.
        raw: raw OpenGL entry points; for `gpu/` alone.
        info: renderer, vendor, version, limits and features, JSON-able.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self.raw = RawGL(ctx)
        self.info = device_info(ctx, self.raw)
        self._max_label = max((ctx.max_label_length or 0) - 1, 0)

    def _make_resting_framebuffer(self) -> None:
        """moderngl binds the last used framebuffer again after making one, though it be released: give it another."""
        self._resting_texture = self.ctx.texture((1, 1), 4)
        self._resting = self.ctx.framebuffer([self._resting_texture])

    def _release_resting_framebuffer(self) -> None:
        self._resting.release()
        self._resting_texture.release()

    def texture(
        self,
        size: tuple[int, int],
        format: str,
        *,
        filter: str = "nearest",
        compare: bool = False,
        label: str = "",
        data: Any = None,
        repeat: bool = False,
        mipmaps: bool = False,
    ) -> moderngl.Texture:
        """A 2-D texture, clamped to its edge unless `repeat`.

        Args:
            size: (width, height) in texels.
            format: a key of `gpu.texture.FORMATS`; "depth24" and "depth32f" are depth textures.
            filter: "nearest" or "linear".
            compare: depth comparison (<=) for `sampler2DShadow`.
            label: name in messages and graphics debuggers.
            data: bytes, or array (H, W) or (H, W, C); the first row is the lowest (v = 0).
            mipmaps: build the mip chain of `data` and filter by it.

        Raises:
            ResourceLimitError: larger than the driver allows, or the driver has no memory for it.
            UsageError: unknown format, or data that does not fit.
        """
        limit = self.info["max_texture_size"]
        texture = make_texture(
            self.ctx, self.raw, limit, size, format, filter=filter, compare=compare, label=label, data=data,
            repeat=repeat, mipmaps=mipmaps,
        )  # fmt: skip
        self._label(texture, label)
        return texture

    def read(self, texture: moderngl.Texture) -> np.ndarray:
        """Texels of a texture made here: (H, W, C), or (H, W) with one component; float32 or uint8; row 0 is v = 0."""
        return read_texture(texture)

    def framebuffer(
        self, colors: Sequence[moderngl.Texture] = (), depth: moderngl.Texture | None = None, label: str = ""
    ) -> moderngl.Framebuffer:
        """A complete framebuffer of the given attachments. Raises DeviceError when the driver calls it incomplete."""
        limit = self.info["max_draw_buffers"]
        if len(colors) > limit:
            raise ResourceLimitError(f"framebuffer '{label}': {len(colors)} colour attachments, allowed are {limit}")
        if self.ctx.fbo is not None and isinstance(self.ctx.fbo.mglo, moderngl.InvalidObject):
            self._resting.use()
        framebuffer = make_framebuffer(self.ctx, colors, depth, label)
        self._label(framebuffer, label)
        return framebuffer

    def release_framebuffers(self, framebuffers: Iterable[moderngl.Framebuffer]) -> None:
        """Release framebuffers of which one may be bound: moderngl rebinds the bound one later, released or not."""
        for framebuffer in framebuffers:
            if self.ctx.fbo is framebuffer:
                self._resting.use()
            framebuffer.release()

    def buffer(self, data: Any = None, label: str = "", *, reserve: int = 0, dynamic: bool = False) -> moderngl.Buffer:
        """A buffer of bytes or a NumPy array, or of `reserve` bytes. Raises ResourceLimitError when memory is out."""
        if data is None and reserve < 1:
            raise UsageError(f"buffer '{label}' has neither data nor a size")
        payload = np.ascontiguousarray(data).tobytes() if isinstance(data, np.ndarray) else data
        if payload is not None and len(payload) == 0:
            raise UsageError(f"buffer '{label}' has no data", remedy="leave out what is empty")
        self.ctx.clear_errors()
        buffer = self.ctx.buffer(payload, reserve=reserve, dynamic=dynamic)
        if self.ctx.error != "GL_NO_ERROR":
            megabytes = (reserve if payload is None else len(payload)) / 1e6
            buffer.release()
            raise ResourceLimitError(
                f"buffer '{label}': the driver refused {megabytes:.0f} MB", remedy="use a smaller mesh or fewer samples"
            )
        buffer.extra = label
        self._label(buffer, label)
        return buffer

    def _label(self, thing: Any, label: str) -> None:
        if label and self.ctx.supports_labels:
            thing.label = label[: self._max_label]
