"""The one-way rule over imports and includes: who may know whom."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import glcaustics

PACKAGE = Path(glcaustics.__file__).resolve().parent
GLSL = PACKAGE.parent / "glsl"
BASE = {"errors", "quality"}
DATA = {"graph", "gpu", "scene"}
TECHNIQUES = {"passes", "caustics", "denoise"}

# part of the package -> the other parts that it may import
MAY_IMPORT = {
    "errors": set[str](),
    "quality": set[str](),
    "graph": BASE,
    "gpu": BASE,
    "scene": BASE,
    "optics": BASE,
    "metrics": BASE,
    "passes": BASE | DATA,
    "denoise": BASE | DATA | {"passes"},
    "caustics": BASE | DATA | {"passes"},
    "output": BASE,
    "renderer": BASE | DATA | TECHNIQUES | {"output"},
    "bench": BASE | DATA | TECHNIQUES | {"output", "renderer", "optics", "metrics"},
    "cli": BASE | DATA | TECHNIQUES | {"output", "renderer", "bench", "metrics"},
    "__init__": BASE | {"renderer", "scene"},
    "__main__": {"cli"},
}


def part_of(module: str) -> str:
    """`glcaustics.gpu.device` -> `gpu`; `glcaustics` itself, which everybody may import for its version -> ``."""
    names = module.split(".")
    return names[1] if len(names) > 1 else ""


def imported(path: Path) -> Iterator[str]:
    """Full names of the project's modules that a file imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] == "glcaustics")
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide the direction; write the full name"
            if node.module == "glcaustics":
                yield from (f"glcaustics.{alias.name}" for alias in node.names)
            elif node.module and node.module.startswith("glcaustics."):
                yield node.module


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_one_way(path: Path) -> None:
    own = path.relative_to(PACKAGE).with_suffix("").parts[0]
    assert own in MAY_IMPORT, f"a new part of the package: say in this test what {own} may import"
    found = {part_of(module) for module in imported(path)} - {own, ""}
    assert found <= MAY_IMPORT[own], f"{own} must not import {sorted(found - MAY_IMPORT[own])}"


def method_names(path: Path) -> set[str]:
    """What a file imports from caustics/: `glcaustics.caustics.caustic_map` -> `caustic_map`."""
    return {name.split(".")[2] for name in imported(path) if name.startswith("glcaustics.caustics.")}


def test_methods_do_not_know_each_other() -> None:
    """The methods are what the registry imports; each may use the protocol and helpers, but no other method."""
    folder = PACKAGE / "caustics"
    methods = method_names(folder / "registry.py") - {"method"}
    assert methods
    for path in folder.rglob("*.py"):
        own = path.relative_to(folder).with_suffix("").parts[0]
        if own in methods:
            strangers = method_names(path) & (methods | {"registry"}) - {own}
            assert not strangers, f"{path.relative_to(PACKAGE)} imports {sorted(strangers)}"


@pytest.mark.parametrize(
    "path", sorted(p for p in GLSL.rglob("*") if p.suffix in {".glsl", ".vert", ".frag", ".geom"}), ids=str
)
def test_shader_includes_go_one_way(path: Path) -> None:
    """technique -> interface -> common; a technique may include files of its own folder, a caustics method also what
    the methods share.
    """
    folder = path.relative_to(GLSL).parent.as_posix()
    allowed = {"common": ("common/",), "interface": ("interface/", "common/")}.get(
        folder.split("/")[0], (f"{folder}/", "interface/", "common/")
    )
    if folder.startswith("caustics/"):
        allowed += ("caustics/shared/",)
    for include in re.findall(r'^\s*#include\s+"([^"]+)"', path.read_text(), re.MULTILINE):
        assert include.startswith(allowed), f"{path.relative_to(GLSL)} must not include {include}"
