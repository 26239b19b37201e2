"""The few raw OpenGL entry points that moderngl does not offer, taken from the context's own loader.

Needed for what a guest must restore in its host's context, for 32-bit float depth and for limits. Used in `gpu/` alone.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import moderngl

from glcaustics.errors import DeviceError

_INT = ctypes.c_int
_UINT = ctypes.c_uint
_FLOAT = ctypes.c_float
_DOUBLE = ctypes.c_double
_BOOL = ctypes.c_ubyte
_PTR = ctypes.c_void_p

#: name -> (result, arguments); all of OpenGL 3.3 core.
_SIGNATURES: dict[str, tuple[Any, ...]] = {
    "glGetIntegerv": (None, _UINT, _PTR),
    "glGetFloatv": (None, _UINT, _PTR),
    "glGetDoublev": (None, _UINT, _PTR),
    "glGetBooleani_v": (None, _UINT, _UINT, _PTR),
    "glIsEnabled": (_BOOL, _UINT),
    "glEnable": (None, _UINT),
    "glDisable": (None, _UINT),
    "glBindFramebuffer": (None, _UINT, _UINT),
    "glBindRenderbuffer": (None, _UINT, _UINT),
    "glBindBuffer": (None, _UINT, _UINT),
    "glBindVertexArray": (None, _UINT),
    "glUseProgram": (None, _UINT),
    "glActiveTexture": (None, _UINT),
    "glBindTexture": (None, _UINT, _UINT),
    "glBindSampler": (None, _UINT, _UINT),
    "glViewport": (None, _INT, _INT, _INT, _INT),
    "glScissor": (None, _INT, _INT, _INT, _INT),
    "glBlendFuncSeparate": (None, _UINT, _UINT, _UINT, _UINT),
    "glBlendEquationSeparate": (None, _UINT, _UINT),
    "glBlendColor": (None, _FLOAT, _FLOAT, _FLOAT, _FLOAT),
    "glDepthFunc": (None, _UINT),
    "glDepthMask": (None, _BOOL),
    "glDepthRange": (None, _DOUBLE, _DOUBLE),
    "glCullFace": (None, _UINT),
    "glFrontFace": (None, _UINT),
    "glPolygonMode": (None, _UINT, _UINT),
    "glPolygonOffset": (None, _FLOAT, _FLOAT),
    "glPointSize": (None, _FLOAT),
    "glLineWidth": (None, _FLOAT),
    "glColorMask": (None, _BOOL, _BOOL, _BOOL, _BOOL),
    "glColorMaski": (None, _UINT, _BOOL, _BOOL, _BOOL, _BOOL),
    "glClearColor": (None, _FLOAT, _FLOAT, _FLOAT, _FLOAT),
    "glClearDepth": (None, _DOUBLE),
    "glPixelStorei": (None, _UINT, _INT),
    "glTexImage2D": (None, _UINT, _INT, _INT, _INT, _INT, _INT, _UINT, _UINT, _PTR),
    "glClipControl": (None, _UINT, _UINT),
    "glGenQueries": (None, _INT, _PTR),
    "glDeleteQueries": (None, _INT, _PTR),
    "glQueryCounter": (None, _UINT, _UINT),
    "glGetQueryObjectui64v": (None, _UINT, _UINT, _PTR),
}


class RawGL:
    """Calls OpenGL by name: `raw.glEnable(gl_enums.BLEND)`. Entry points are looked up once, when first used.

    Args:
        ctx: a moderngl context, current.

    Raises:
        DeviceError: the context offers no loader, or the driver lacks the entry point.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        loader = getattr(ctx.mglo, "_context", None)
        load = getattr(loader, "load_opengl_function", None) or getattr(loader, "load", None)
        if load is None:
            raise DeviceError(
                "the moderngl context does not show its OpenGL loader", remedy="use moderngl 5.12 or later"
            )
        self._load: Callable[[str], int] = load

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name not in _SIGNATURES:
            raise AttributeError(name)
        address = self._load(name)
        if not address:
            raise DeviceError(f"the OpenGL driver has no {name}", remedy="update it to OpenGL 3.3 core or later")
        function: Callable[..., Any] = ctypes.CFUNCTYPE(*_SIGNATURES[name])(address)
        setattr(self, name, function)
        return function

    def integers(self, enum: int, count: int = 1) -> tuple[int, ...]:
        """glGetIntegerv of `count` values."""
        values = (_INT * count)()
        self.glGetIntegerv(enum, values)
        return tuple(values)

    def integer(self, enum: int) -> int:
        """glGetIntegerv of one value."""
        return self.integers(enum)[0]

    def floats(self, enum: int, count: int = 1) -> tuple[float, ...]:
        """glGetFloatv of `count` values."""
        values = (_FLOAT * count)()
        self.glGetFloatv(enum, values)
        return tuple(values)

    def doubles(self, enum: int, count: int = 1) -> tuple[float, ...]:
        """glGetDoublev of `count` values."""
        values = (_DOUBLE * count)()
        self.glGetDoublev(enum, values)
        return tuple(values)

    def booleans_indexed(self, enum: int, index: int, count: int) -> tuple[int, ...]:
        """glGetBooleani_v of `count` values."""
        values = (_BOOL * count)()
        self.glGetBooleani_v(enum, index, values)
        return tuple(values)

    def gen_query(self) -> int:
        """A new query object."""
        name = _UINT()
        self.glGenQueries(1, ctypes.byref(name))
        return name.value

    def delete_query(self, query: int) -> None:
        """Delete a query object."""
        name = _UINT(query)
        self.glDeleteQueries(1, ctypes.byref(name))

    def query_value(self, query: int, enum: int) -> int:
        """glGetQueryObjectui64v of one value."""
        value = ctypes.c_uint64()
        self.glGetQueryObjectui64v(query, enum, ctypes.byref(value))
        return value.value
