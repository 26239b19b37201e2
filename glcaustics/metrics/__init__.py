"""Measures of error between images and over time: pure functions on NumPy arrays, no OpenGL, no renderer."""

from glcaustics.metrics.error import (
    bias_of_mean,
    flux_balance,
    mean_absolute_error,
    non_finite_share,
    psnr,
    relative_rmse,
)
from glcaustics.metrics.flicker import moving_flicker, static_flicker, surface_flicker
from glcaustics.metrics.perceptual import FlipResult, flip

__all__ = [
    "FlipResult",
    "bias_of_mean",
    "flip",
    "flux_balance",
    "mean_absolute_error",
    "moving_flicker",
    "non_finite_share",
    "psnr",
    "relative_rmse",
    "static_flicker",
    "surface_flicker",
]
