"""Choosing a backend, and saying which one it was."""

from __future__ import annotations

from pathlib import Path

import moderngl

from glcaustics.errors import DeviceError
from glcaustics.gpu.backends import APT_REMEDY, AUTO_ORDER, Opened, open_backend
from glcaustics.gpu.device import Device


def create_device(
    backend: str = "auto", context: moderngl.Context | None = None, *, shader_root: Path | None = None
) -> Device:
    """Open a device, or wrap a host's context.

    Args:
        backend: "egl", "osmesa", "glfw" (a hidden window), or "auto", which tries them in that order and announces
            the one it took and why the others failed.
        context: a host's moderngl context, current; `backend` is then not used, and `close` leaves it alive.
        shader_root: another folder of shaders than the project's own; for tests.

    Raises:
        DeviceError: nothing works; one line with the command that mends it.
    """
    if context is not None:
        if context.version_code < 330:
            raise DeviceError(f"the host's context has OpenGL {context.version_code / 100:.1f}, needed is 3.3 core")
        return Device(Opened(context, lambda: None), "host", ["using the host's context"], shader_root)
    if backend != "auto":
        return Device(open_backend(backend), backend, [f"backend {backend}"], shader_root)
    failures = []
    for name in AUTO_ORDER:
        try:
            opened = open_backend(name)
        except DeviceError as error:
            failures.append(f"{name} failed: {error.what}")
            continue
        return Device(opened, name, [*failures, f"backend auto took {name}"], shader_root)
    raise DeviceError(
        f"no backend gives OpenGL 3.3 core ({'; '.join(failures)})",
        remedy=f"on Debian or Ubuntu: {APT_REMEDY['egl']} libosmesa6; `glcaustics doctor` tells more",
    )
