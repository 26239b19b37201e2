"""What is kept between runs: references by content, measurements by what they measured. Files are whole or absent."""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError
from glcaustics.output import write_bytes, write_text
from glcaustics.scene.model import Scene

Arrays = dict[str, npt.NDArray[Any]]
CACHE_ENV = "GLCAUSTICS_CACHE"


def default_cache() -> Path:
    """Where references are kept: `bench` in `$GLCAUSTICS_CACHE`, else in `~/.cache/glcaustics`."""
    named = os.environ.get(CACHE_ENV)
    return (Path(named).expanduser() if named else Path.home() / ".cache" / "glcaustics") / "bench"


def digest(*parts: Any) -> str:
    """A key of 24 hex digits for numbers, texts, arrays, and lists and mappings of them."""
    sha = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            sha.update(str((part.shape, part.dtype.str)).encode())
            sha.update(np.ascontiguousarray(part).tobytes())
        elif isinstance(part, bytes):
            sha.update(part)
        else:
            sha.update(json.dumps(part, sort_keys=True, default=str).encode())
        sha.update(b"\0")
    return sha.hexdigest()[:24]


def scene_key(scene: Scene) -> str:
    """A key of what decides a scene's irradiance at time 0: geometry, specular materials, lights."""
    parts: list[Any] = []
    for i in scene.instances_at(0.0):
        m = i.material
        optical = [m.transmission, m.ior, m.metallic, m.roughness, m.dispersion, list(m.sigma_a), list(m.base_color)]
        kind = i.optical_kind.value
        parts += [kind, optical if kind != "diffuse" else [], i.positions_ws(), i.mesh.normals, i.mesh.triangles]
    for light in scene.lights:
        parts.append([light.kind.value, light.color, light.intensity, light.position_ws, light.direction_ws])
        parts.append([light.inner_cone_rad, light.outer_cone_rad])
        if light.has_size:  # left out without one: keys of scenes from before there were sizes stay
            parts.append([light.radius_m, light.angular_diameter_rad])
    return digest(*parts)


class Store:
    """Named JSON documents with arrays in a folder; a broken or foreign file counts as absent.

    Raises:
        UsageError: the folder cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(
                f"cannot make the folder: {error.strerror}", where=str(folder), remedy="choose another"
            ) from error

    def load(self, key: str) -> tuple[dict[str, Any], Arrays] | None:
        """The document and arrays under a key, or None."""
        try:
            document = json.loads((self.folder / f"{key}.json").read_text(encoding="utf-8"))
            with np.load(self.folder / f"{key}.npz") as file:
                return document, {name: file[name] for name in file.files}
        except (OSError, ValueError, EOFError, zipfile.BadZipFile):
            return None

    def save(self, key: str, document: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Keep them; the arrays first, so that a document that is there has its arrays."""
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
        write_bytes(self.folder / f"{key}.npz", buffer.getvalue())
        write_text(self.folder / f"{key}.json", json.dumps(document, indent=1))
