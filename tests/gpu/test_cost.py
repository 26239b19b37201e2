"""What a frame costs, as ratios within one run: the absolute times of these machines mean nothing.

Processor time of this process, all threads of the software renderer included: what else the machine does hardly enters.
"""

from __future__ import annotations

import statistics
import time

import pytest

import glcaustics as glc
from tests.gpu.feature_scenes import BACKEND

pytestmark = pytest.mark.gpu


def interleaved_medians(scene_name: str, size: tuple[int, int], methods: tuple[str, ...], rounds: int) -> list[float]:
    """Median milliseconds of a frame by method; the methods take turns, so that a busy moment hits them alike."""
    scene = glc.load_scene(scene_name)
    renderers = [
        glc.Renderer(scene, size=size, method=method, quality="medium", backend=BACKEND, stats=False)
        for method in methods
    ]
    times: list[list[float]] = [[] for _ in methods]
    try:
        for round_index in range(rounds + 1):  # the first one compiles and uploads
            for renderer, record in zip(renderers, times, strict=True):
                renderer.device.make_current()
                start = time.process_time()
                renderer.draw(0.05 * round_index)
                renderer.device.ctx.finish()
                record.append(time.process_time() - start)
    finally:
        for renderer in renderers:
            renderer.device.make_current()
            renderer.close()
    return [1e3 * statistics.median(record[1:]) for record in times]


@pytest.mark.parametrize("method", ["caustic_map", "displaced_mesh"])
def test_caustics_at_most_double_the_frame(method: str) -> None:
    """`pool` at 1280x720, quality medium, in at most twice the cost of the same frame with caustics off."""
    off, on = interleaved_medians("pool", (1280, 720), ("none", method), rounds=5)
    print(f"pool 1280x720 medium: none {off:.0f} ms, {method} {on:.0f} ms, ratio {on / off:.2f}")
    assert on <= 2.0 * off
