"""Mitsuba 3 itself: which of its variants runs here, and colours as it takes them."""

from __future__ import annotations

import glob
import importlib
import os
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.targets import luminance
from glcaustics.errors import UsageError

FAST_VARIANT, SURE_VARIANT = "llvm_ad_mono", "scalar_rgb"
LLVM_PATTERNS = ("/usr/lib/*/libLLVM.so.19*", "/usr/lib/*/libLLVM-19.so*", "/usr/lib/llvm-19/lib/libLLVM*.so*")


def find_llvm() -> str | None:
    """Path of LLVM 19, or None. Other versions are not taken: with LLVM 15 or 16 Dr.Jit ends the process."""
    if path := os.environ.get("DRJIT_LIBLLVM_PATH"):
        return path
    return next((found for pattern in LLVM_PATTERNS for found in sorted(glob.glob(pattern))), None)


def best_variant() -> str:
    """`llvm_ad_mono` where LLVM 19 is installed (apt-get install libllvm19), else `scalar_rgb`."""
    return FAST_VARIANT if find_llvm() else SURE_VARIANT


def mitsuba(variant: str) -> ModuleType:
    """The module `mitsuba` with the variant set.

    Raises:
        UsageError: not installed, or the variant cannot start.
    """
    try:
        module = importlib.import_module("mitsuba")
    except ImportError:
        raise UsageError(
            "the package mitsuba is not installed", where="bench", remedy="pip install 'glcaustics[bench]'"
        ) from None
    if variant.startswith("llvm") and (llvm := find_llvm()):
        os.environ["DRJIT_LIBLLVM_PATH"] = llvm
    try:
        module.set_variant(variant)
    except ImportError as error:
        reason = str(error).splitlines()[0]
        raise UsageError(f"Mitsuba's variant {variant} does not start: {reason}", where="bench") from error
    module.set_log_level(module.LogLevel.Error)
    return module


def is_mono(mi: ModuleType) -> bool:
    """Whether the variant carries luminance alone."""
    return "mono" in mi.variant()


def spectrum(mi: ModuleType, color: npt.ArrayLike) -> Any:
    """A colour (3,) as the variant takes it: luminance, or RGB (unbounded, as emitters need)."""
    if is_mono(mi):
        return float(luminance(color))
    return {"type": "rgb", "value": [float(c) for c in np.asarray(color)]}
