"""How a context comes to be: EGL, OSMesa, a hidden glfw window. Each gives a moderngl context or raises DeviceError."""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import moderngl

from glcaustics.errors import DeviceError

#: Order in which "auto" tries. EGL first: it reaches a GPU without a display. A window last: it needs a display.
AUTO_ORDER = ("egl", "osmesa", "glfw")

APT_REMEDY = {
    "egl": "apt-get install libegl1 libgl1 libgl1-mesa-dri",
    "osmesa": "apt-get install libosmesa6 libgl1 libgl1-mesa-dri",
    "glfw": "run it in a desktop session, or: apt-get install xvfb libgl1 libgl1-mesa-dri, then xvfb-run ./run ...",
}


@dataclass
class Opened:
    """A fresh context, the function that gives its platform resources back, and what must stay alive with it."""

    ctx: moderngl.Context
    close: Callable[[], None]
    keep: Any = None


def open_backend(name: str) -> Opened:
    """Open one backend by name.

    Raises:
        DeviceError: it does not work here; the message carries the apt command that may mend it.
    """
    openers = {"egl": _open_egl, "osmesa": _open_osmesa, "glfw": _open_glfw}
    if name not in openers:
        raise DeviceError(f"backend '{name}' is unknown", remedy=f"use one of auto, {', '.join(AUTO_ORDER)}")
    try:
        return openers[name]()
    except DeviceError:
        raise
    except Exception as error:  # moderngl, glcontext and glfw raise bare Exceptions
        raise DeviceError(f"backend '{name}' gave no context: {error}", remedy=APT_REMEDY[name]) from error


def _open_egl() -> Opened:
    settings: dict[str, Any] = {"backend": "egl"}
    ctx = moderngl.create_context(require=330, standalone=True, **settings)
    return Opened(ctx, ctx.release)


def _open_glfw() -> Opened:
    import glfw

    with warnings.catch_warnings(record=True) as caught:  # glfw reports its errors as warnings
        warnings.simplefilter("always")
        ready = glfw.init()
    if not ready:
        reason = "; ".join(str(w.message) for w in caught) or "no reason given"
        raise DeviceError(f"glfw does not start: {reason}", remedy=APT_REMEDY["glfw"])
    glfw.default_window_hints()
    glfw.window_hint(glfw.VISIBLE, False)
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
    window = glfw.create_window(16, 16, "glcaustics", None, None)
    glfw.default_window_hints()
    if not window:
        raise DeviceError("glfw could open no window with OpenGL 3.3 core", remedy=APT_REMEDY["glfw"])
    glfw.make_context_current(window)
    ctx = moderngl.create_context(require=330)

    def close() -> None:
        ctx.release()
        glfw.destroy_window(window)

    return Opened(ctx, close, window)


_OSMESA_FORMAT, _OSMESA_RGBA = 0x22, 0x1908
_OSMESA_DEPTH_BITS, _OSMESA_STENCIL_BITS = 0x30, 0x31
_OSMESA_PROFILE, _OSMESA_CORE_PROFILE = 0x33, 0x34
_OSMESA_MAJOR, _OSMESA_MINOR = 0x36, 0x37
_GL_UNSIGNED_BYTE = 0x1401


class OSMesaLoader:
    """Mesa's off-screen interface, in the shape that moderngl asks of a context provider.

    Rendering goes to framebuffer objects; the 16 x 16 buffer exists because OSMesa wants one to be current.
    """

    def __init__(self) -> None:
        self._lib = _load_osmesa()
        self.standalone = True
        self._context = None
        for major, minor in ((4, 5), (4, 3), (3, 3)):
            attributes = (ctypes.c_int * 13)(
                _OSMESA_FORMAT,
                _OSMESA_RGBA,
                _OSMESA_DEPTH_BITS,
                24,
                _OSMESA_STENCIL_BITS,
                8,
                _OSMESA_PROFILE,
                _OSMESA_CORE_PROFILE,
                _OSMESA_MAJOR,
                major,
                _OSMESA_MINOR,
                minor,
                0,
            )
            self._context = self._lib.OSMesaCreateContextAttribs(attributes, None)
            if self._context:
                break
        if not self._context:
            raise DeviceError("OSMesa offers no OpenGL 3.3 core context", remedy=APT_REMEDY["osmesa"])
        self._buffer = (ctypes.c_ubyte * (16 * 16 * 4))()
        self.make_current()

    def make_current(self) -> None:
        """Direct this thread's OpenGL calls to this context."""
        if not self._lib.OSMesaMakeCurrent(self._context, self._buffer, _GL_UNSIGNED_BYTE, 16, 16):
            raise DeviceError("OSMesa could not make its context current", remedy=APT_REMEDY["osmesa"])

    def load_opengl_function(self, name: str) -> int:
        """Address of an OpenGL entry point, 0 when there is none."""
        return self._lib.OSMesaGetProcAddress(name.encode()) or 0

    def __enter__(self) -> OSMesaLoader:
        self.make_current()
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def release(self) -> None:
        """Destroy the context."""
        if self._context:
            self._lib.OSMesaMakeCurrent(None, None, 0, 0, 0)
            self._lib.OSMesaDestroyContext(self._context)
            self._context = None


def osmesa_library() -> str | None:
    """File name of libOSMesa as the loader knows it, None when it is not installed."""
    for name in (os.environ.get("GLC_OSMESA"), ctypes.util.find_library("OSMesa"), "libOSMesa.so.8", "libOSMesa.so.6"):
        if name:
            try:
                ctypes.CDLL(name)
            except OSError:
                continue
            return name
    return None


def _load_osmesa() -> ctypes.CDLL:
    name = osmesa_library()
    if name is None:
        what = "libOSMesa is not installed (Mesa 25.1 and later no longer has it)"
        raise DeviceError(what, remedy=APT_REMEDY["osmesa"])
    lib = ctypes.CDLL(name, mode=ctypes.RTLD_GLOBAL)
    lib.OSMesaCreateContextAttribs.restype = ctypes.c_void_p
    lib.OSMesaCreateContextAttribs.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
    lib.OSMesaMakeCurrent.restype = ctypes.c_ubyte
    lib.OSMesaMakeCurrent.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_int]
    lib.OSMesaDestroyContext.restype = None
    lib.OSMesaDestroyContext.argtypes = [ctypes.c_void_p]
    lib.OSMesaGetProcAddress.restype = ctypes.c_void_p
    lib.OSMesaGetProcAddress.argtypes = [ctypes.c_char_p]
    return lib


def _open_osmesa() -> Opened:
    loader = OSMesaLoader()
    settings: dict[str, Any] = {"context": loader}
    ctx = moderngl.create_context(require=330, **settings)

    def close() -> None:
        ctx.release()
        loader.release()

    return Opened(ctx, close, loader)
