"""The whole run: the parts that were asked for, and the report of what they found."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import glcaustics
from glcaustics.bench import caustics_part, eye_part, mesh_part, photons_part, seen_part
from glcaustics.bench.cells import Cells
from glcaustics.bench.machine import code_key, commit, machine, versions
from glcaustics.bench.marks import marks
from glcaustics.bench.plan import PARTS, Plan

SCHEMA = "glcaustics-bench/1"
FloatArray = npt.NDArray[np.float64]
EMPTY: dict[str, list[Any]] = {
    name: [] for name in ("references", "validation", "rows", "pareto", "equal_error", "scaling")
}


@dataclass(eq=False)
class Study:
    """Runs a plan. `folder`: of the report; its `cells` keep what is measured, so that a run can go on.

    `images`: maps (H, W) or (H, W, 3) by name; `pictures`: (H, W, 3) uint8 by name; both for the page.

    Raises:
        UsageError: a scene without a target, an unknown method, or a package that is missing.
    """

    plan: Plan
    folder: Path
    peers: bool = True
    command: str = ""
    images: dict[str, FloatArray] = field(default_factory=dict)
    pictures: dict[str, npt.NDArray[np.uint8]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if "caustics" in self.plan.parts:
            caustics_part.check_plan(self.plan)
        self._cells = Cells(self.folder, self.plan.backend, self._count())

    def _count(self) -> int:
        counts = {
            "caustics": caustics_part.count_steps(self.plan, self.peers),
            "photons": photons_part.count_steps(self.plan, self.peers),
            "mesh": mesh_part.count_steps(self.plan),
            "eye": eye_part.count_steps(self.plan),
            "seen": seen_part.count_steps(self.plan),
        }
        return sum(counts[part] for part in self.plan.parts)

    def run(self) -> dict[str, Any]:
        """Measure everything and return the report."""
        begin = time.perf_counter()
        runs = {
            "caustics": caustics_part.CausticsPart,
            "photons": photons_part.PhotonsPart,
            "mesh": mesh_part.MeshPart,
            "eye": eye_part.EyePart,
            "seen": seen_part.SeenPart,
        }
        found: dict[str, Any] = {name: list(empty) for name, empty in EMPTY.items()}
        seconds = {}
        for name in PARTS:
            if name not in self.plan.parts:
                continue
            start = time.perf_counter()
            part = runs[name](self.plan, self._cells, self.peers)
            found |= part.run()
            self.images |= part.images
            self.pictures |= part.pictures
            seconds[name] = round(time.perf_counter() - start, 1)
        self._cells.close()
        report = self._facts(found) | {"seconds_of_parts": seconds, "seconds": round(time.perf_counter() - begin, 1)}
        report |= found
        return report | {"marks": marks(report)}

    def _facts(self, found: dict[str, Any]) -> dict[str, Any]:
        """What made the report: command, commit, machine, packages, plan."""
        renderers = [found.get("gl_renderer"), *(r.get("gl_renderer") for r in found["rows"])]
        return {
            "schema": SCHEMA,
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "command": self.command,
            "glcaustics": glcaustics.__version__,
            **commit(),
            "code": code_key(),
            "machine": machine() | {"gl_renderer": next((name for name in renderers if name), None)},
            "versions": versions(),
            "plan": asdict(self.plan),
            "notes": self._cells.notes,
        }
