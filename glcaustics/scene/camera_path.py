"""A camera that moves smoothly through key frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from glcaustics.scene.model import Camera, FloatArray


@dataclass(frozen=True)
class CameraKey:
    """Where the camera stands at `time_s` and what it looks at (world space, metres), with its full vertical angle."""

    time_s: float
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    yfov_rad: float


def interpolate(times_s: FloatArray, values: FloatArray, time_s: float) -> FloatArray:
    """Cubic Hermite curve through (K,) times and (K, D) values, held at both ends; -> (D,).

    The tangents are those of the parabola through three neighbouring keys (Catmull and Rom 1974 for uneven spacing), so
    velocity is continuous; at the ends they are zero, so that the camera starts and stops gently.
    """
    if time_s <= times_s[0] or len(times_s) == 1:
        return np.asarray(values[0])
    if time_s >= times_s[-1]:
        return np.asarray(values[-1])
    step = np.diff(times_s)[:, None]
    slope = np.diff(values, axis=0) / step
    tangent = np.zeros_like(values)
    tangent[1:-1] = (slope[:-1] * step[1:] + slope[1:] * step[:-1]) / (step[1:] + step[:-1])
    i = int(np.searchsorted(times_s, time_s, side="right")) - 1
    h = float(step[i, 0])
    u = (time_s - times_s[i]) / h
    start, end = (1 + 2 * u) * (1 - u) ** 2 * values[i], u * u * (3 - 2 * u) * values[i + 1]
    return np.asarray(start + end + h * u * (1 - u) * ((1 - u) * tangent[i] - u * tangent[i + 1]))


def camera_path(
    keys: Sequence[CameraKey], up: tuple[float, float, float] = (0.0, 1.0, 0.0)
) -> Callable[[float], Camera]:
    """A function time_s -> Camera through the keys, whose times must rise."""
    times = np.array([k.time_s for k in keys], np.float64)
    values = np.array([[*k.eye, *k.target, k.yfov_rad] for k in keys], np.float64)

    def camera_at(time_s: float) -> Camera:
        now = interpolate(times, values, time_s)
        return Camera.look_at(now[:3], now[3:6], up, yfov_rad=float(now[6]))

    return camera_at
