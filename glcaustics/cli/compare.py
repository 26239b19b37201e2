"""`glcaustics compare`: every error measure between two pictures, and a map of where the error is."""

from __future__ import annotations

import argparse
import importlib.util
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics import metrics, output
from glcaustics.errors import UsageError

READS = (".png", ".npz", ".exr")
# dark to bright in even steps for the eye, after matplotlib's magma (CC0); black = equal
MAGMA = tuple(bytes.fromhex("000004 281159 651a80 9f2f7f d4486b f57d62 febc82 fcfdbf".replace(" ", "")))


@dataclass(frozen=True, eq=False)
class Picture:
    """`linear`: (H, W, C) float64. `encoded`: (H, W, 3) sRGB-encoded in [0, 1] if it was an 8-bit picture."""

    path: Path
    linear: npt.NDArray[np.float64]
    encoded: npt.NDArray[np.float32] | None


def compare_command(args: argparse.Namespace) -> int:
    """Compares `args.test` with `args.reference`."""
    if args.output is not None:
        target = output.check_output(args.output)
        if target.suffix.lower() != ".png":
            raise UsageError("the error map is a PNG", where=str(target), remedy="name it NAME.png")
        if target.resolve() in (Path(args.reference).resolve(), Path(args.test).resolve()):
            raise UsageError("is one of the inputs", where=str(target), remedy="name another file")
    reference, test = read_picture(Path(args.reference), args.aov), read_picture(Path(args.test), args.aov)
    a, b = reference.linear, test.linear
    if a.shape != b.shape:
        raise UsageError(
            f"is {_shape(b)}, but {reference.path} is {_shape(a)}",
            where=str(test.path),
            remedy="render both at one size and compare the same buffer",
        )
    numbers = _measure(reference, test)
    if args.json:
        finite = {k: v if v is None or math.isfinite(v) else str(v) for k, v in numbers.items()}
        print(json.dumps({"reference": str(reference.path), "test": str(test.path), **finite}, indent=2))
    else:
        for name, value in numbers.items():
            print(f"{name:<24}{'not measured' if value is None else f'{value:.6g}'}")
    if args.output is not None:
        scale = _write_map(target, a, b)
        if not args.json:
            print(f"{target}: |test - reference|, brightest = {scale:.4g} or more; white = not finite")
    return 0


def _measure(reference: Picture, test: Picture) -> dict[str, float | None]:
    a, b = reference.linear, test.linear
    mask = np.isfinite(a).all(axis=-1) & np.isfinite(b).all(axis=-1)
    numbers: dict[str, float | None] = {
        "non_finite_reference": metrics.non_finite_share(a),
        "non_finite_test": metrics.non_finite_share(b),
    }
    if not mask.any():
        raise UsageError("no pixel is finite in both", where=str(test.path), remedy="look at the renders")
    dark = float(a[mask].mean()) <= 0.0
    measures = {
        "relative_rmse": metrics.relative_rmse,
        "relative_mae": metrics.mean_absolute_error,
        "bias_of_mean": metrics.bias_of_mean,
    }
    for name, measure in measures.items():
        numbers[name] = None if dark else measure(a, b, mask=mask)
    if reference.encoded is not None and test.encoded is not None:
        numbers["psnr_db"] = metrics.psnr(reference.encoded, test.encoded, peak=1.0)
    else:
        numbers["psnr_db"] = None if dark else metrics.psnr(a, b, mask=mask)
    if importlib.util.find_spec("flip_evaluator") is None:
        print("note: FLIP is left out; to have it: pip install flip-evaluator", file=sys.stderr)
        return numbers
    numbers["flip_mean"] = _flip(reference, test) if mask.all() else None
    return numbers


def _flip(reference: Picture, test: Picture) -> float | None:
    """LDR-FLIP of 8-bit pictures, else HDR-FLIP of colours or grey; None where it is not defined."""
    if reference.encoded is not None and test.encoded is not None:
        return metrics.flip(reference.encoded, test.encoded, hdr=False).mean
    a, b = reference.linear, test.linear
    if a.shape[2] not in (1, 3) or min(a.min(), b.min()) < 0.0 or a.max() <= 0.0:
        return None
    wide = [np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image for image in (a, b)]
    return metrics.flip(wide[0], wide[1], hdr=True).mean


def read_picture(path: Path, aov: str | None) -> Picture:
    """A PNG, or one buffer of an NPZ or OpenEXR file (`aov`; default `image`, or the only one there is).

    Raises:
        UsageError: no such file, unknown format, not readable, or no such buffer.
    """
    suffix = path.suffix.lower()
    if suffix not in READS:
        raise UsageError(
            f"{suffix or 'no extension'} is not readable", where=str(path), remedy=f"use {', '.join(READS)}"
        )
    if not path.is_file():
        raise UsageError("no such file", where=str(path), remedy="check the path")
    if suffix == ".png" and aov not in (None, "image"):
        raise UsageError(f"a PNG holds no buffer '{aov}'", where=str(path), remedy="render to .npz or .exr")
    try:
        if suffix == ".png":
            return _read_png(path)
        buffers = _read_npz(path) if suffix == ".npz" else _read_exr(path)
    except UsageError:
        raise
    except Exception as error:  # the readers raise whatever a broken file makes them stumble over
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UsageError(f"cannot be read: {reason}", where=str(path), remedy="write it anew") from error
    name = aov or ("image" if "image" in buffers else next(iter(buffers)) if len(buffers) == 1 else None)
    if name is None or name not in buffers:
        missing = f"holds no buffer '{name}'" if name else "holds several buffers"
        raise UsageError(missing, where=str(path), remedy=f"--aov with one of: {', '.join(buffers)}")
    pixels = np.asarray(buffers[name], np.float64)
    if pixels.ndim not in (2, 3) or pixels.size == 0:
        raise UsageError(f"buffer '{name}' has shape {pixels.shape}", where=str(path), remedy="give (H, W[, C])")
    return Picture(path, pixels[..., None] if pixels.ndim == 2 else pixels, None)


def _read_png(path: Path) -> Picture:
    from PIL import Image

    with Image.open(path) as image:
        if image.mode.startswith("I") or image.mode == "F":
            raise UsageError("is no 8-bit picture", where=str(path), remedy="use .npz or .exr for more depth")
        encoded = np.asarray(image.convert("RGB"), np.float32) / np.float32(255.0)
    wide = encoded.astype(np.float64)
    linear = np.where(wide <= 0.04045, wide / 12.92, ((wide + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    return Picture(path, linear, encoded)


def _read_npz(path: Path) -> dict[str, npt.NDArray[Any]]:
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def _read_exr(path: Path) -> dict[str, npt.NDArray[Any]]:
    try:
        import OpenEXR
    except ImportError as error:
        remedy = "install it with: pip install 'glcaustics[exr]'"
        raise UsageError("reading .exr needs the OpenEXR package", where=str(path), remedy=remedy) from error
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    layers: dict[str, dict[str, npt.NDArray[Any]]] = {}
    for name, pixels in channels.items():
        layer, _, letter = name.rpartition(".")
        layers.setdefault(layer or "image", {})[letter] = pixels
    order = "RXYGZBV"  # R G B, X Y Z, V
    rank = {"R": 0, "G": 1, "B": 2, "X": 0, "Y": 1, "Z": 2}
    known = {layer: [c for c in parts if c in order] for layer, parts in layers.items()}
    return {
        layer: np.stack([layers[layer][c] for c in sorted(letters, key=lambda c: rank.get(c, 0))], axis=-1)
        for layer, letters in known.items()
        if letters
    }


def _shape(image: npt.NDArray[np.float64]) -> str:
    channels = image.shape[2]
    return f"{image.shape[1]}x{image.shape[0]} with {channels} channel{'s' if channels > 1 else ''}"


def _write_map(target: Path, a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]) -> float:
    """Mean absolute difference of the channels through MAGMA, the brightest at its 99.5th percentile; returns that."""
    with np.errstate(invalid="ignore"):
        difference = np.abs(b - a).mean(axis=-1)
    finite = np.isfinite(difference)
    scale = float(np.percentile(difference[finite], 99.5)) or float(difference[finite].max()) or 1.0
    level = np.clip(np.where(finite, difference, 0.0) / scale, 0.0, 1.0) * (len(MAGMA) // 3 - 1)
    stops = np.asarray(MAGMA, np.float64).reshape(-1, 3)
    colors = np.stack([np.interp(level, np.arange(len(stops)), stops[:, c]) for c in range(3)], axis=-1)
    colors[~finite] = 255.0
    ldr = np.round(colors).astype(np.uint8)
    output.save_frame(target, image=ldr.astype(np.float32), ldr=ldr, aov={})
    return scale
