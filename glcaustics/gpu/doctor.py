"""What each backend offers on this machine, what it lacks, and the command that mends it."""

from __future__ import annotations

import ctypes.util
from typing import Any

from glcaustics.errors import DeviceError
from glcaustics.gpu.backends import APT_REMEDY, AUTO_ORDER, osmesa_library
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


def doctor_report(backend: str = "auto") -> tuple[str, dict[str, Any]]:
    """The report as text and as a JSON-able dict; "auto" looks at every backend.

    Two Mesa front ends in one process can disturb each other: a caller that wants all of them and must not crash
    runs one process a backend, as `glcaustics doctor` does.
    """
    names = AUTO_ORDER if backend == "auto" else (backend,)
    report: dict[str, Any] = {
        "libraries": system_libraries(),
        "backends": {name: probe_backend(name) for name in names},
    }
    return _text(report), report


def _text(report: dict[str, Any]) -> str:
    lines = []
    for name, library in report["libraries"].items():
        lines.append(f"{name:<10} {library['found'] or 'missing: ' + library['remedy']}")
    for name, found in report["backends"].items():
        if not found["works"]:
            lines += [f"backend {name}: does not work", f"  {found['error']}"]
            continue
        lines.append(f"backend {name}: works, {'software' if found['software'] else 'hardware'}")
        lines.append(f"  additive blending in 32-bit float: {'yes' if found['float_blend_measured'] else 'NO'}")
        lines += [f"  {key:<30} {value}" for key, value in found["info"].items() if key != "features"]
        lines += [f"  {key:<30} {'yes' if there else 'no'}" for key, there in found["info"]["features"].items()]
    return "\n".join(lines)
