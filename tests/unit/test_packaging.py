"""What is shipped: the wheel's contents, its dependencies, and the pins of ./run."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import glcaustics

ROOT = Path(glcaustics.__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CORE = {"moderngl", "glfw", "numpy", "pyrr", "trimesh", "pillow"}
CORE_MODULES = {"moderngl", "glfw", "numpy", "pyrr", "trimesh", "PIL"}
EXTRA_MODULES = {"OpenEXR", "imgui_bundle", "mitsuba", "flip_evaluator", "matplotlib", "embreex", "pyoidn"}


def tracked(*folders: str) -> list[str]:
    """Files of the checkout under `folders` that are not caches."""
    files = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.is_file()]
    return sorted(str(path.relative_to(ROOT)) for path in files if "__pycache__" not in path.parts)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(out), str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return next(out.glob("*.whl"))


def test_the_wheel_carries_code_shaders_and_scenes(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    assert set(tracked("glcaustics")) <= names
    data = {f"glcaustics/_data/{name}" for name in tracked("glsl", "scenes")}
    assert data and data <= names
    outside = {name for name in names if not name.startswith("glcaustics")}
    assert outside == set(), "nothing else may land in site-packages"


@pytest.mark.long
def test_the_wheel_works_with_its_core_packages_alone(wheel: Path, tmp_path: Path) -> None:
    """Installed in an empty environment, away from the checkout; needs the package index."""
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "venv")], check=True)
    python = tmp_path / "venv" / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "--quiet", str(wheel)], check=True)
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    scenes = subprocess.run(
        [python, "-m", "glcaustics", "scenes"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    names = [line.split()[0] for line in scenes.stdout.splitlines() if line[:1].strip()]
    assert "pool" in names
    for name in names:
        command = [python, "-m", "glcaustics", "render", name, "--size", "32x24", "--quality", "draft"]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / f"{name}.png").is_file()


def test_core_dependencies_are_the_six() -> None:
    assert {canonicalize_name(Requirement(line).name) for line in PROJECT["dependencies"]} == CORE


def test_pins_are_exact_and_meet_the_declared_bounds() -> None:
    names = ("requirements.lock", "requirements-bench.lock")
    lines = [line for name in names for line in (ROOT / name).read_text().splitlines()]
    pins = dict(line.split("==") for line in lines if line and not line.startswith("#"))
    pinned = {canonicalize_name(name): version for name, version in pins.items()}
    extras = PROJECT["optional-dependencies"]
    for line in [*PROJECT["dependencies"], *extras["exr"], *extras["bench"], *extras["dev"]]:
        requirement = Requirement(line)
        if requirement.name != "glcaustics":
            assert pinned[canonicalize_name(requirement.name)] in requirement.specifier, line


def test_the_environment_is_complete() -> None:
    """Every dependency of every pin is pinned too: the set-up installs with --no-deps."""
    done = subprocess.run([sys.executable, "-m", "pip", "check"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def imports(tree: ast.AST, inside_function: bool = False) -> Iterator[tuple[str, bool]]:
    """(top-level module name, whether a function holds the import)."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name.split(".")[0], inside_function) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.split(".")[0], inside_function
        function = isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
        yield from imports(node, inside_function or function)


@pytest.mark.parametrize("path", [name for name in tracked("glcaustics") if name.endswith(".py")])
def test_only_declared_packages_are_imported(path: str) -> None:
    for module, inside_function in imports(ast.parse((ROOT / path).read_text())):
        if module in sys.stdlib_module_names or module in CORE_MODULES | {"glcaustics"}:
            continue
        assert module in EXTRA_MODULES, f"{path} imports {module}, which no dependency declares"
        assert inside_function, f"{path} imports {module}, an extra, before it is needed"


def test_importing_the_package_loads_no_opengl() -> None:
    code = "import sys, glcaustics, glcaustics.cli; print({'moderngl', 'glfw', 'trimesh'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_versions_agree() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text()
    assert re.search(rf"^## \[({re.escape(glcaustics.__version__)}|Unreleased)\]", changelog, re.MULTILINE)
    done = subprocess.run([sys.executable, "-m", "glcaustics", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"glcaustics {glcaustics.__version__}\n"


@pytest.mark.parametrize("script", ["run", ".ci/run"])
def test_scripts_are_executable_posix_shell(script: str) -> None:
    path = ROOT / script
    assert os.access(path, os.X_OK)
    assert path.read_text().startswith("#!/bin/sh\n")
    subprocess.run(["sh", "-n", str(path)], check=True)
