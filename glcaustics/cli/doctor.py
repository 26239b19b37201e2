"""`glcaustics doctor`: what this machine offers, what is missing, and the command that mends it."""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import json
import platform
import subprocess
import sys
from typing import Any

import glcaustics
from glcaustics.cli.parser import BACKENDS

EXTRAS = {"exr": "OpenEXR", "demo": "imgui_bundle", "bench": "mitsuba"}
PACKAGES = ("moderngl", "glcontext", "glfw", "numpy", "pyrr", "trimesh", "Pillow")
PROBE_TIMEOUT_S = 60.0


def doctor_command(args: argparse.Namespace) -> int:
    """Prints the report; exit code 0 when at least one of the backends looked at works, else 2."""
    from glcaustics.gpu.doctor import probe_backend, system_libraries

    if args.backend:
        backends = {args.backend: probe_backend(args.backend)}
    else:
        backends = {name: _probe_apart(name) for name in BACKENDS[1:]}
    report = {"machine": machine(), "data": data_folders(), "extras": extras()}
    report |= {"libraries": system_libraries(), "backends": backends}
    print(json.dumps(report, indent=2) if args.json else _text(report))
    return 0 if any(map(_usable, backends.values())) else 2


def machine() -> dict[str, str]:
    """Versions of the interpreter and of the packages that the renderer stands on."""
    versions = {
        "glcaustics": glcaustics.__version__,
        "python": platform.python_version(),
        "system": platform.platform(),
    }
    return versions | {name: importlib.metadata.version(name) for name in PACKAGES}


def data_folders() -> dict[str, str]:
    """Where the shaders and the built-in scenes are read from."""
    from glcaustics.gpu import glsl_root
    from glcaustics.scene.load import scenes_root

    return {"shaders": str(glsl_root()), "scenes": str(scenes_root())}


def extras() -> dict[str, dict[str, Any]]:
    """Which optional packages are there, and how to get those that are not."""
    found = {}
    for extra, module in EXTRAS.items():
        installed = importlib.util.find_spec(module) is not None
        found[extra] = {"installed": installed, "remedy": "" if installed else f"pip install 'glcaustics[{extra}]'"}
    return found


def _probe_apart(backend: str) -> dict[str, Any]:
    """`probe_backend` in its own process: two Mesa front ends in one can crash, and a crash must not end the report."""
    command = [sys.executable, "-m", "glcaustics", "doctor", "--backend", backend, "--json"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PROBE_TIMEOUT_S, check=False)
        found: dict[str, Any] = json.loads(done.stdout)["backends"][backend]
        return found
    except subprocess.TimeoutExpired:
        return {"works": False, "error": f"no answer within {PROBE_TIMEOUT_S:.0f} s"}
    except (json.JSONDecodeError, KeyError):
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return {"works": False, "error": f"the probe ended with code {done.returncode}: {last}"}


def _text(report: dict[str, Any]) -> str:
    lines = ["machine"]
    lines += [f"  {name:<12} {value}" for name, value in report["machine"].items()]
    lines.append("data")
    lines += [f"  {name:<12} {folder}" for name, folder in report["data"].items()]
    lines.append("extras")
    for name, extra in report["extras"].items():
        lines.append(f"  {name:<12} " + ("installed" if extra["installed"] else f"not installed; {extra['remedy']}"))
    lines.append("system libraries")
    for name, library in report["libraries"].items():
        lines.append(f"  {name:<12} {library['found'] or 'missing; ' + library['remedy']}")
    for name, found in report["backends"].items():
        lines += _backend_lines(name, found)
    lines.append(_verdict(report["backends"]))
    return "\n".join(lines)


def _backend_lines(name: str, found: dict[str, Any]) -> list[str]:
    if not found["works"]:
        return [f"backend {name}: does not work", f"  {found['error']}"]
    rows = {"additive 32-bit float blending": _yes(found["float_blend_measured"])}
    for key, value in found["info"].items():
        rows |= {k: _yes(v) for k, v in value.items()} if key == "features" else {key: _short(value)}
    head = f"backend {name}: works, {'software' if found['software'] else 'hardware'}"
    return [head, *(f"  {key:<32} {value}" for key, value in rows.items())]


def _usable(found: dict[str, Any]) -> bool:
    return bool(found["works"] and found["float_blend_measured"])


def _verdict(backends: dict[str, Any]) -> str:
    usable = [name for name, found in backends.items() if _usable(found)]
    if usable:
        return f"ready: rendering works with --backend {' or '.join(usable)}"
    return "not ready: no backend gives OpenGL 3.3 core with float blending; the commands above mend it"


def _yes(there: bool) -> str:
    return "yes" if there else "no"


def _short(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
