"""The cells of a run: measurements that are kept as soon as they are made, so that a broken run goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.machine import code_key, machine
from glcaustics.bench.plan import Plan
from glcaustics.bench.progress import Progress
from glcaustics.bench.store import Arrays, Store, default_cache, digest

Measured = tuple[dict[str, Any], Arrays]


class Cells:
    """What all parts of a run share: its folder's cells, the cache of references, progress, notes.

    Args:
        folder: of the report. backend: of OpenGL. total: steps that the progress counts.

    Raises:
        UsageError: a folder cannot be made.
    """

    def __init__(self, folder: Path, backend: str, total: int) -> None:
        self.truths = Store(default_cache())
        self.code = digest(code_key(), machine()["cpu"], machine()["cores"], backend)
        self.backend = backend
        self.notes: list[str] = []
        self._cells = Store(folder / "cells")
        self._progress = Progress(total)

    def key(self, *parts: Any) -> str:
        """A key that also holds the renderer's code, the processor and the backend."""
        return digest(self.code, *parts)

    def step(self, label: str) -> None:
        """Tells that the next step begins."""
        self._progress.step(label)

    def cell(self, label: str, key: str, make: Callable[[], Measured]) -> Measured:
        """A measurement, from the folder when it was made before under this key."""
        self.step(label)
        kept = self._cells.load(key)
        if kept is None:
            kept = make()
            self._cells.save(key, *kept)
        return kept

    def note(self, text: str) -> None:
        """A remark for the report, once."""
        if text not in self.notes:
            self.notes.append(text)

    def close(self) -> None:
        """Ends the progress line."""
        self._progress.close()


@dataclass(eq=False)
class Part:
    """One part of a run: its `run` measures and returns the report's keys.

    `peers`: Mitsuba's too. `images` (H, W): irradiance by label; `pictures` (H, W, 3): 8-bit sRGB; both for the page.
    """

    plan: Plan
    cells: Cells
    peers: bool = True
    images: dict[str, npt.NDArray[np.float64]] = field(default_factory=dict)
    pictures: dict[str, npt.NDArray[np.uint8]] = field(default_factory=dict)
