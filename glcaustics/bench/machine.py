"""What a measurement belongs to: the machine, the code, the versions."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path
from typing import Any

import glcaustics
from glcaustics.bench.store import digest
from glcaustics.gpu import glsl_root

PACKAGES = (
    "glcaustics",
    "numpy",
    "moderngl",
    "mitsuba",
    "drjit",
    "embreex",
    "flip-evaluator",
    "pyoidn",
    "pyluxcore",
    "matplotlib",
)


def versions() -> dict[str, str | None]:
    """Installed versions; None for what is not installed."""
    found: dict[str, str | None] = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = None
    return found


def machine() -> dict[str, Any]:
    """Processor, cores and system; the OpenGL part is added by the first renderer."""
    return {
        "cpu": _cpu_name(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "system": f"{platform.system()} {platform.release()}",
        "load_average": round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None,
    }


def _cpu_name() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def commit() -> dict[str, Any]:
    """The checkout's commit and whether files differ from it; None for an installed wheel."""
    root = Path(glcaustics.__file__).resolve().parents[1]

    def git(*arguments: str) -> str | None:
        try:
            done = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=True)
        except (OSError, subprocess.CalledProcessError):
            return None
        return done.stdout.strip()

    if not (root / ".git").exists():
        return {"commit": None, "dirty": None}
    status = git("status", "--porcelain", "--untracked-files=no", "--", "glcaustics", "glsl", "scenes")
    return {"commit": git("rev-parse", "HEAD"), "dirty": None if status is None else bool(status)}


def instrument_key(*modules: str) -> str:
    """A key of modules of the bench, by name: for measurements that change with their instrument."""
    return digest(*(Path(__file__).with_name(f"{name}.py").read_bytes() for name in modules))


def code_key() -> str:
    """A key of the renderer's code: what is measured again when it changes. The bench itself does not count."""
    package = Path(glcaustics.__file__).resolve().parent
    files = [p for p in package.rglob("*.py") if p.relative_to(package).parts[0] not in ("bench", "cli")]
    files += [p for p in glsl_root().rglob("*") if p.is_file()]
    return digest(*(part for p in sorted(files) for part in (p.name, p.read_bytes())))
