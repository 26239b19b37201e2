"""Writes frames to disk: PNG, OpenEXR, NPZ. A file is there whole or not at all.

What each format holds:
- `.png`: the tone mapped picture, 8-bit sRGB.
- `.npz`: `image` and every AOV under its own name, float32, row 0 on top, linear.
- `.exr`: `image` as R, G, B, and each AOV as a layer: `caustic_irradiance.R`, `normal_ws.X`, `depth_m.V`; 32-bit float.
"""

from __future__ import annotations

import importlib.util
import os
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError

FORMATS = (".png", ".exr", ".npz")
_FRAME_FIELD = re.compile(r"%0?\d*d")


def check_output(path: str | os.PathLike[str]) -> Path:
    """Refuses a path that could not be written after the work is done.

    Raises:
        UsageError: unknown extension, no such directory, not writable, a directory, or OpenEXR not installed.
    """
    target = Path(path)
    if target.suffix.lower() not in FORMATS:
        shown = target.suffix or "no extension"
        raise UsageError(f"{shown} is not a picture format", where=str(target), remedy=f"use {', '.join(FORMATS)}")
    check_writable(target)
    if target.suffix.lower() == ".exr" and importlib.util.find_spec("OpenEXR") is None:
        remedy = "install it with: pip install 'glcaustics[exr]', or write .npz"
        raise UsageError("writing .exr needs the OpenEXR package", where=str(target), remedy=remedy)
    return target


def check_writable(target: Path) -> None:
    """Raises UsageError when a file `target` cannot be created or replaced."""
    folder = target.parent
    if not folder.is_dir():
        raise UsageError(f"no directory {folder}", where=str(target), remedy=f"create it: mkdir -p {folder}")
    if target.is_dir():
        raise UsageError("is a directory", where=str(target), remedy="name a file")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UsageError(f"directory {folder} is not writable", where=str(target), remedy="choose another directory")


def frame_paths(path: str | os.PathLike[str], frames: int) -> list[Path]:
    """The files of a sequence: `out.png` -> `out.0000.png`, `out.0001.png`, ...; `out_%03d.png` numbers as written.

    A single frame keeps the name as it is, unless the name has a number field.
    """
    target = Path(path)
    if len(_FRAME_FIELD.findall(target.name)) > 1:
        raise UsageError("more than one frame number field", where=str(target), remedy="keep one, such as %04d")
    if field := _FRAME_FIELD.search(target.name):
        return [target.with_name(_FRAME_FIELD.sub(field.group() % i, target.name)) for i in range(frames)]
    if frames == 1:
        return [target]
    return [target.with_name(f"{target.stem}.{i:04d}{target.suffix}") for i in range(frames)]


def save_frame(
    path: str | os.PathLike[str],
    *,
    image: npt.NDArray[np.float32],
    ldr: npt.NDArray[np.uint8],
    aov: Mapping[str, npt.NDArray[Any]],
) -> None:
    """Writes a frame in the format that the extension names.

    Args:
        image: (H, W, 3) float32, linear radiance, row 0 on top.
        ldr: (H, W, 3) uint8, sRGB encoded, row 0 on top.
        aov: name -> (H, W) or (H, W, C) array.

    Raises:
        UsageError: as `check_output`, or when the disk refuses; no partial file stays behind.
    """
    target = check_output(path)
    suffix = target.suffix.lower()
    if suffix == ".png":
        _write(target, lambda part: _save_png(part, ldr))
    else:
        arrays = {"image": np.ascontiguousarray(image, dtype=np.float32)}
        arrays |= {n: np.ascontiguousarray(a, dtype=np.float32) for n, a in aov.items() if n != "image"}
        save = _save_npz if suffix == ".npz" else _save_exr
        _write(target, lambda part: save(part, arrays))


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Writes a UTF-8 text file, whole or not at all. Raises UsageError when that is impossible."""

    def save(part: Path) -> None:
        part.write_text(text, encoding="utf-8")

    _write(Path(path), save)


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Writes a file, whole or not at all. Raises UsageError when that is impossible."""

    def save(part: Path) -> None:
        part.write_bytes(data)

    _write(Path(path), save)


def _write(target: Path, save: Callable[[Path], None]) -> None:
    try:
        with _atomic(target) as part:
            save(part)
    except OSError as error:
        reason = error.strerror or str(error)
        raise UsageError(f"cannot write: {reason}", where=str(target), remedy="check space and permissions") from error


@contextmanager
def _atomic(target: Path) -> Iterator[Path]:
    """A temporary path beside `target` that replaces it when the block succeeds and vanishes when it does not."""
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.stem}.", suffix=target.suffix)
    os.close(handle)
    part = Path(name)
    try:
        yield part
        umask = os.umask(0)
        os.umask(umask)
        part.chmod(0o666 & ~umask)  # mkstemp's files are private; a picture gets the usual rights
        os.replace(part, target)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _save_png(path: Path, ldr: npt.NDArray[np.uint8]) -> None:
    from PIL import Image

    Image.fromarray(np.ascontiguousarray(ldr, dtype=np.uint8)).save(path, format="PNG")


def _save_npz(path: Path, arrays: Mapping[str, npt.NDArray[np.float32]]) -> None:
    with path.open("wb") as stream:
        # The names are AOV names; savez's own parameter is `file`, which is none of them.
        np.savez(stream, **arrays)  # type: ignore[arg-type]


def exr_channels(arrays: Mapping[str, npt.NDArray[np.float32]]) -> dict[str, npt.NDArray[np.float32]]:
    """Channel name -> (H, W): `image` is the main layer; vectors get X Y Z, colours R G B, numbers V (as Blender's)."""
    channels: dict[str, npt.NDArray[np.float32]] = {}
    for name, array in arrays.items():
        planes = array[..., None] if array.ndim == 2 else array
        letters = "V" if planes.shape[2] == 1 else "XYZW" if name.endswith(("_ws", "_vs", "_uv", "_px")) else "RGBA"
        prefix = "" if name == "image" else f"{name}."
        for i in range(planes.shape[2]):
            channels[prefix + letters[i]] = np.ascontiguousarray(planes[..., i])
    return channels


def _save_exr(path: Path, arrays: Mapping[str, npt.NDArray[np.float32]]) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, exr_channels(arrays)) as file:
        file.write(str(path))
