"""Who may know the driver: `gpu/` alone. (Which part may import which other part: test_layers.py.)

Passes, methods and the renderer hand moderngl objects on and may name their types in annotations; calling moderngl,
or using its constants, is for `gpu/` and for those who make a host's context or a window.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from glcaustics.gpu.shader_source import glsl_root, strip_comments

PACKAGE = Path(__file__).resolve().parents[2] / "glcaustics"
GL_MODULES = {"moderngl", "glcontext", "glfw"}
MAY_CALL = {"gpu", "cli", "demo"}
MAY_NAME_TYPES = {"passes", "caustics", "denoise", "renderer"}


def named(file: Path) -> str:
    return file.relative_to(PACKAGE).as_posix()


def driver_imports(tree: ast.Module) -> set[str]:
    """Driver modules that the file imports, and what it takes out of them, wherever in the file."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in found if name.split(".")[0] in GL_MODULES}


def uses_outside_annotations(tree: ast.Module) -> list[int]:
    """Lines that mention a driver module anywhere but in an annotation."""
    in_annotations: set[int] = set()
    for node in ast.walk(tree):
        fields = [getattr(node, "annotation", None), getattr(node, "returns", None)]
        for annotation in filter(None, fields):
            in_annotations |= {id(inner) for inner in ast.walk(annotation)}
    return [
        node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.Name) and node.id in GL_MODULES and id(node) not in in_annotations
    ]


def breaches(part: str, tree: ast.Module) -> list[str]:
    """What a file of the given part of the package does that it may not."""
    found = driver_imports(tree)
    if part in MAY_CALL:
        return []
    if part not in MAY_NAME_TYPES:
        return [f"imports {name}" for name in sorted(found)]
    wrong = [f"imports {name}" for name in sorted(found) if name != "moderngl"]
    return wrong + [f"uses the driver in line {line}" for line in uses_outside_annotations(tree)]


@pytest.mark.parametrize("file", sorted(PACKAGE.rglob("*.py")), ids=named)
def test_only_the_gpu_part_knows_the_driver(file: Path) -> None:
    part = file.relative_to(PACKAGE).with_suffix("").parts[0]
    assert not breaches(part, ast.parse(file.read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    ("part", "code", "allowed"),
    [
        ("graph", "import moderngl", False),
        ("scene", "def f():\n    from moderngl import Texture", False),
        ("passes", "import moderngl\ndef f(t: moderngl.Texture) -> moderngl.Buffer: ...", True),
        ("passes", "import moderngl\nx: dict[str, moderngl.Texture] = {}", True),
        ("passes", "import moderngl\ndef f():\n    return moderngl.POINTS", False),
        ("caustics", "import glfw", False),
        ("gpu", "import moderngl\nmoderngl.create_context()", True),
    ],
)
def test_the_rule_notices(part: str, code: str, allowed: bool) -> None:
    assert (not breaches(part, ast.parse(code))) == allowed


COMMON = sorted((glsl_root() / "common").rglob("*.glsl"))


@pytest.mark.parametrize("file", COMMON, ids=lambda file: file.name)
def test_common_glsl_is_pure(file: Path) -> None:
    """No uniforms, no stage variables: these files are the engine snippets."""
    code = strip_comments(file.read_text())
    assert not re.search(r"\buniform\b|\bgl_(Position|FragCoord|FragDepth|VertexID|InstanceID|PointSize)\b", code)
