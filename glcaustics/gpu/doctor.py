"""What each backend offers on this machine, what it lacks, and the command that mends it."""

from __future__ import annotations

import ctypes.util
from typing import Any

from glcaustics.errors import DeviceError
from glcaustics.gpu.backends import APT_REMEDY, osmesa_library
from glcaustics.gpu.device import Device
from glcaustics.gpu.open_device import create_device


def system_libraries() -> dict[str, dict[str, Any]]:
    """Shared libraries that the backends load: {"libEGL": {"found": file or None, "remedy": apt command or ""}}."""
    found = {
        "libGL": ctypes.util.find_library("GL"),
        "libEGL": ctypes.util.find_library("EGL"),
        "libOSMesa": osmesa_library(),
    }
    backend = {"libGL": "egl", "libEGL": "egl", "libOSMesa": "osmesa"}
    return {name: {"found": file, "remedy": "" if file else APT_REMEDY[backend[name]]} for name, file in found.items()}


def probe_backend(backend: str) -> dict[str, Any]:
    """Open one backend in this process and try what the renderer stands on.

    Returns:
        {"works": True, "software": bool, "info": device.info, "float_blend_measured": bool} or
        {"works": False, "error": one line with the remedy}.
    """
    try:
        device = create_device(backend)
    except DeviceError as error:
        return {"works": False, "error": str(error)}
    with device:
        return {
            "works": True,
            "software": device.is_software,
            "info": dict(device.info),
            "float_blend_measured": adds_in_float(device),
        }


def adds_in_float(device: Device) -> bool:
    """Whether additive blending into 32-bit float really adds: draws 0.75 three times and reads 2.25."""
    texture = device.texture((4, 4), "rgba32f", label="doctor")
    framebuffer = device.framebuffer([texture], label="doctor")
    program = device.ctx.program(
        vertex_shader="#version 330 core\n"
        "void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }",
        fragment_shader="#version 330 core\nout vec4 color;\nvoid main() { color = vec4(0.75); }",
    )
    array = device.ctx.vertex_array(program, [])
    with device.guard_state():
        framebuffer.use()
        framebuffer.clear()
        device.ctx.enable_only(device.ctx.BLEND)
        device.ctx.blend_func = device.ctx.ONE, device.ctx.ONE
        for _ in range(3):
            array.render(vertices=3)
        values = device.read(texture)
    for thing in (array, program, framebuffer, texture):
        thing.release()
    return bool((values == 2.25).all())
