"""FLIP: how different two images look when a viewer flips between them. By NVIDIA's own package, flip-evaluator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError
from glcaustics.metrics.error import checked_pair

PIXELS_PER_DEGREE = 67.0  # 0.7 m from a 0.7 m wide screen of 3840 pixels: the package's default
EXPOSURE_STEPS = 5


@dataclass(frozen=True, eq=False)
class FlipResult:
    """`mean` in [0, 1], 0 = equal; `error_map` (H, W) float32."""

    mean: float
    error_map: npt.NDArray[np.float32]


def flip(
    reference: npt.ArrayLike, test: npt.ArrayLike, *, hdr: bool, exposures: tuple[float, float] | None = None
) -> FlipResult:
    """LDR-FLIP (Andersson et al. 2020) or HDR-FLIP (Andersson et al. 2021) of an image against a reference.

    Args:
        reference, test: (H, W, 3). LDR: sRGB-encoded, in [0, 1] (uint8 is divided by 255). HDR: linear, >= 0.
        hdr: which of the two. exposures: first and last exposure compensation of HDR-FLIP, stops; the package would
            choose them from the reference. Fix them when results of several images are compared.

    Raises:
        UsageError: shapes or values that do not fit, or flip-evaluator not installed.
    """
    try:
        import flip_evaluator
    except ImportError as error:
        remedy = "install it with: pip install 'glcaustics[bench]'"
        raise UsageError("FLIP needs the flip-evaluator package", where="metrics.flip", remedy=remedy) from error
    a, b = (_float_image(image, hdr) for image in (reference, test))
    checked_pair(a, b, where="flip")
    if not hdr and (min(a.min(), b.min()) < -1e-6 or max(a.max(), b.max()) > 1.0 + 1e-6):
        raise UsageError("values outside [0, 1]", where="flip", remedy="encode as sRGB, or ask for hdr=True")
    if hdr and min(a.min(), b.min()) < 0.0:
        raise UsageError("negative radiance", where="flip", remedy="give linear values of at least 0")
    parameters: dict[str, float | int] = {"ppd": PIXELS_PER_DEGREE}
    if hdr and exposures is not None:
        start, stop = exposures
        parameters |= {"startExposure": start, "stopExposure": stop, "numExposures": EXPOSURE_STEPS}
    kind = "HDR" if hdr else "LDR"
    # its inputsRGB says whether LDR input is still sRGB-encoded; the package's HDR path takes linear values as they are
    error_map, mean, _ = flip_evaluator.evaluate(a, b, kind, inputsRGB=not hdr, applyMagma=False, parameters=parameters)
    flat = np.asarray(error_map, np.float32)
    return FlipResult(float(mean), flat[..., 0] if flat.ndim == 3 else flat)


def _float_image(image: npt.ArrayLike, hdr: bool) -> npt.NDArray[np.float32]:
    pixels = np.asarray(image)
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, axis=2)
    if pixels.ndim != 3 or pixels.shape[2] != 3:
        raise UsageError(f"an image has shape {pixels.shape}", where="flip", remedy="give (H, W, 3)")
    if pixels.dtype == np.uint8:
        if hdr:
            raise UsageError("8-bit values are not radiance", where="flip", remedy="ask for hdr=False")
        return np.ascontiguousarray(pixels, np.float32) / np.float32(255.0)
    return np.ascontiguousarray(pixels, np.float32)
