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
from glcaustics.errors import GlcError

EXTRAS = {"exr": "OpenEXR", "demo": "imgui_bundle", "bench": "mitsuba"}
PACKAGES = ("moderngl", "glcontext", "glfw", "numpy", "pyrr", "trimesh", "Pillow")
PROBE_TIMEOUT_S = 60.0

# OpenGL 3.3 core alone is required; without these something small is missing.
USEFUL_EXTENSIONS = {
    "debug labels": ("GL_KHR_debug", "graphics debuggers show numbers for names"),
    "timer queries": ("GL_ARB_timer_query", "passes are timed by the wall clock"),
}


def doctor_command(args: argparse.Namespace) -> int:
    """Prints the report; exit code 0 when at least one of the backends looked at works, else 2."""
    if args.backend:
        backends = {args.backend: probe(args.backend)}
    else:
        backends = {name: _probe_apart(name) for name in BACKENDS[1:]}
    report = {"machine": machine(), "data": data_folders(), "extras": extras(), "backends": backends}
    print(json.dumps(report, indent=2) if args.json else _text(report))
    return 0 if any(found["works"] for found in backends.values()) else 2


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


def probe(backend: str) -> dict[str, Any]:
    """Opens a context in this process: {"works": True, "info": {...}} or {"works": False, "error": ...}."""
    try:
        from glcaustics.gpu import create_device

        device = create_device(backend)
    except GlcError as error:
        return {"works": False, "error": str(error)}
    try:
        extensions = sorted(device.ctx.extensions)
        return {"works": True, "software": device.is_software, "info": dict(device.info), "extensions": extensions}
    finally:
        device.close()


def _probe_apart(backend: str) -> dict[str, Any]:
    """`probe` in its own process: two Mesa front ends in one can crash, and a crash must not end the report."""
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
    for name, found in report["backends"].items():
        if not found["works"]:
            lines += [f"backend {name}: does not work", f"  {found['error']}"]
            continue
        lines.append(f"backend {name}: works, {'software' if found['software'] else 'hardware'}")
        lines += [f"  {key:<32} {_short(value)}" for key, value in found["info"].items()]
        for key, (extension, effect) in USEFUL_EXTENSIONS.items():
            state = "yes" if extension in found["extensions"] else f"no: {effect}"
            lines.append(f"  {key:<32} {state}")
        lines.append(f"  {'extensions':<32} {len(found['extensions'])}, all of them with --json")
    lines.append(_verdict(report["backends"]))
    return "\n".join(lines)


def _verdict(backends: dict[str, Any]) -> str:
    working = [name for name, found in backends.items() if found["works"]]
    if working:
        return f"ready: rendering works with --backend {' or '.join(working)}"
    return "not ready: no backend gives OpenGL 3.3 core; the commands above mend it"


def _short(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
