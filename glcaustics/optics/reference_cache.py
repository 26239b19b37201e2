"""A cache of references on disk, keyed by everything that they depend on: geometry, lights, settings, and this code."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import tempfile
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from glcaustics.errors import UsageError
from glcaustics.optics.beam_scene import BeamWater
from glcaustics.optics.reference import FluxBalance, Reference

CACHE_ENV = "GLCAUSTICS_CACHE"
CODE_VERSION = "beams-1"  # raise it when the tracer's results change


def cache_folder() -> Path:
    """`$GLCAUSTICS_CACHE`, else `~/.cache/glcaustics`."""
    named = os.environ.get(CACHE_ENV)
    return Path(named).expanduser() if named else Path.home() / ".cache" / "glcaustics"


def content_key(*parts: Any) -> str:
    """SHA-256 (hex) of dataclasses, arrays, numbers, text, bytes, and lists, tuples and dicts of these.

    Raises:
        UsageError: something whose content cannot be told, such as a function.
    """
    digest = hashlib.sha256(CODE_VERSION.encode())
    for part in parts:
        _feed(digest, part)
    return digest.hexdigest()


def _feed(digest: Any, part: Any) -> None:
    digest.update(type(part).__name__.encode() + b"\0")
    if part is None or isinstance(part, (bool, int, float, str, bytes, Enum, np.generic)):
        digest.update(part if isinstance(part, bytes) else repr(part).encode())
    elif isinstance(part, np.ndarray):
        digest.update(f"{part.dtype}{part.shape}".encode() + np.ascontiguousarray(part).tobytes())
    elif isinstance(part, (list, tuple)):
        digest.update(str(len(part)).encode())
        for item in part:
            _feed(digest, item)
    elif isinstance(part, dict):
        _feed(digest, sorted(part.items()))
    elif isinstance(part, BeamWater):  # its field is a function: `key` stands for it
        _feed(digest, (part.key, part.centre_ws, part.size_m, part.max_height_m, part.optics))
    elif dataclasses.is_dataclass(part):
        for item in dataclasses.fields(part):
            _feed(digest, (item.name, getattr(part, item.name)))
    else:
        raise UsageError(f"{type(part).__name__} has no content to key by", where="content_key", remedy="give data")


def cached_arrays(
    key: str, compute: Callable[[], dict[str, np.ndarray]], folder: Path | None = None
) -> dict[str, np.ndarray]:
    """Arrays from the cache, or from `compute`, which are then kept. A broken file is made anew.

    Raises:
        UsageError: the folder cannot be written.
    """
    path = (folder or cache_folder()) / f"{key}.npz"
    if path.is_file():
        try:
            with np.load(path, allow_pickle=False) as file:
                return {name: file[name] for name in file.files}
        except (OSError, ValueError, KeyError, EOFError, _zip_error()):
            path.unlink(missing_ok=True)
    arrays = compute()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "wb") as stream:
            np.savez(stream, **arrays)  # type: ignore[arg-type]
        os.replace(name, path)
    except OSError as error:
        remedy = f"set {CACHE_ENV} to a folder of your own"
        raise UsageError(f"the cache cannot be written: {error.strerror}", where=str(path), remedy=remedy) from error
    return arrays


def _zip_error() -> type[Exception]:
    from zipfile import BadZipFile

    return BadZipFile


def cached_reference(key: str, compute: Callable[[], Reference], folder: Path | None = None) -> Reference:
    """A Reference from the cache, or from `compute`. `key`: content_key of everything that it depends on."""
    arrays = cached_arrays(key, lambda: _to_arrays(compute()), folder)
    numbers = json.loads(str(arrays["numbers"]))
    balance = FluxBalance(rays=numbers["rays"], **{k: np.array(v) for k, v in numbers["flux"].items()})
    return Reference(arrays["half_a"], arrays["half_b"], numbers["noise"], numbers["step"], balance)


def _to_arrays(reference: Reference) -> dict[str, np.ndarray]:
    balance = reference.balance
    flux = {k: getattr(balance, k).tolist() for k in ("emitted", "landed", "caught", "unsplit")}
    numbers = {"noise": reference.noise, "step": reference.step, "rays": balance.rays, "flux": flux}
    return {"half_a": reference.half_a, "half_b": reference.half_b, "numbers": np.array(json.dumps(numbers))}
