"""What people use today for the same picture: Mitsuba's `ptracer`, alone and with Open Image Denoise behind it."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.measure import summary
from glcaustics.bench.mitsuba_truth import Ptracer
from glcaustics.errors import UsageError

FloatArray = npt.NDArray[np.float64]
RUNS = 2


class PtracerPeer:
    """Mitsuba on one target or view. In its favour: photons aimed at the casters, and only the wanted pass is timed.

    Args:
        scene: its name. pixels: a side of the image. tracer: makes what traces it; timed as set-up.
    """

    def __init__(self, scene: str, pixels: int, tracer: Callable[[], Ptracer]) -> None:
        start = time.perf_counter()
        self._scene, self._pixels = scene, pixels
        self._tracer = tracer()
        self._tracer.render(1, seed=99)  # compiles the kernels
        self.setup_ms = 1e3 * (time.perf_counter() - start)

    def measure(self, photons: int) -> tuple[dict[str, Any], FloatArray]:
        """A row without its errors, and the irradiance map, of the last run."""
        values, processor, image = [], [], np.zeros(0)
        for run in range(RUNS):
            self._tracer.seconds = self._tracer.processor_seconds = 0.0
            image = self._tracer.render(photons, seed=31 + run)
            values.append(1e3 * self._tracer.seconds)
            processor.append(1e3 * self._tracer.processor_seconds)
        return self._row("ptracer", self._tracer.photons(photons), values, processor), image

    def _row(self, method: str, photons: int, values: list[float], processor: list[float]) -> dict[str, Any]:
        return {
            "scene": self._scene,
            "tool": "mitsuba",
            "method": method,
            "quality": f"{photons}",
            "pixels": self._pixels,
            "photons": photons,
            "variant": self._tracer.variant,
            "time_ms": summary(values, "wall clock"),
            "processor_ms": statistics.median(processor),
            "first_frame_ms": self.setup_ms,
        }

    def denoised(self, row: dict[str, Any], image: FloatArray) -> tuple[dict[str, Any], FloatArray]:
        """The same run with Open Image Denoise after it (its time added)."""
        values, processor, clean = [], [], image
        for _ in range(RUNS):
            start = time.perf_counter(), time.process_time()
            clean = denoise(image)
            values.append(row["time_ms"]["median"] + 1e3 * (time.perf_counter() - start[0]))
            processor.append(row["processor_ms"] + 1e3 * (time.process_time() - start[1]))
        return self._row("ptracer+oidn", row["photons"], values, processor), clean


def has_denoiser() -> bool:
    """Whether Open Image Denoise is installed and runs here."""
    try:
        denoise(np.ones((16, 16)))
    except UsageError:
        return False
    return True


def denoise(image: FloatArray) -> FloatArray:
    """Open Image Denoise, HDR, high quality, on a map (H, W).

    Raises:
        UsageError: pyoidn is missing or does not run.
    """
    try:
        import pyoidn

        scale = max(float(image.mean()), 1e-30)
        color = np.repeat(np.maximum(image / scale, 0.0)[..., None], 3, axis=2).astype(np.float32)
        return np.asarray(pyoidn.denoise(np.ascontiguousarray(color), hdr=True)[..., 1], np.float64) * scale
    except (ImportError, OSError, RuntimeError) as error:
        remedy = "pip install 'glcaustics[bench]'"
        raise UsageError(f"Open Image Denoise does not run: {error}", where="bench", remedy=remedy) from error
