"""What a frame cost and how its solves went, as numbers for machines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glcaustics.passes.runner import PlanRunner


def plan_stats(runner: PlanRunner, timings_ms: Mapping[str, float]) -> dict[str, Any]:
    """Time and bytes of every pass that ran or was kept from the frame before, why others did not run, and memory.

    Args:
        timings_ms: by pass; empty where nothing was timed.
    """
    written, plan = runner.step_bytes(), runner.plan
    return {
        "passes": [
            {
                "name": s.name,
                "ms": 0.0 if s.name in runner.skipped else timings_ms.get(s.name),
                "bytes": written[s.name],
                "kept": s.name in runner.skipped,
            }
            for s in plan.steps
        ],
        "left_out": [{"name": item.name, "because": item.because} for item in plan.left_out],
        "bytes_allocated": plan.bytes_allocated,
        "bytes_without_aliasing": plan.bytes_without_aliasing,
        "bytes_without_culling": plan.bytes_without_culling,
    }


def solve_stats(solves: list[dict[str, Any]]) -> dict[str, Any]:
    """The method's solves, and the share of their flux that was lost; None where none was sent out."""
    flux = sum(s["flux"] for s in solves)
    return {"solves": solves, "lost_flux": sum(s["flux_lost"] for s in solves) / flux if flux > 0 else None}
