"""Finding and loading scenes: built-in names, .toml, .glb and .gltf files."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from glcaustics.errors import SceneError
from glcaustics.scene.gltf import load_gltf
from glcaustics.scene.model import Scene
from glcaustics.scene.strict_table import nearest
from glcaustics.scene.toml import load_toml


def scenes_root() -> Path:
    """The folder of the built-in scenes: `scenes/` of the checkout, or the copy inside the installed wheel.

    Raises:
        SceneError: if there is neither.
    """
    package = Path(__file__).resolve().parent.parent
    for folder in (package / "_data" / "scenes", package.parent / "scenes"):
        if folder.is_dir():
            return folder
    raise SceneError("the built-in scenes are missing", where=str(package), remedy="install glcaustics again")


def _builtin_files() -> dict[str, Path]:
    return {path.parent.name: path for path in sorted(scenes_root().glob("*/scene.toml"))}


def builtin_scenes() -> list[tuple[str, str, str]]:
    """(name, purpose, licence) of every built-in scene, by name."""
    rows = []
    for name, path in _builtin_files().items():
        head = tomllib.loads(path.read_text(encoding="utf-8")).get("scene", {})
        rows.append((name, str(head.get("purpose", "")), str(head.get("licence", ""))))
    return rows


def load_scene(name_or_path: str | Path, overrides: Mapping[str, Any] | None = None) -> Scene:
    """Load a built-in scene by name, or a .toml, .glb or .gltf file.

    Args:
        name_or_path: "pool", or a path.
        overrides: for TOML scenes, values in place of the file's: {"light[0].direction": (0, -1, 0)}.

    Raises:
        SceneError: unknown name, missing file, or a file that is not a valid scene.
    """
    text = str(name_or_path)
    path = Path(text)
    suffix = path.suffix.lower()
    if suffix == ".toml":
        return load_toml(path, overrides)
    if suffix in (".glb", ".gltf"):
        if overrides:
            raise SceneError("overrides work on TOML scenes only", where=text, remedy="include the glTF from a .toml")
        return load_gltf(path)
    builtin = _builtin_files()
    if text in builtin:
        return load_toml(builtin[text], overrides)
    if path.exists():
        raise SceneError(f"files of kind '{suffix}' are not scenes", where=text, remedy="use .toml, .glb or .gltf")
    raise SceneError(f"unknown scene '{text}'", remedy=nearest(text, builtin) + "; or a .toml, .glb or .gltf file")
