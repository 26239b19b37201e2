"""Axes and projections of views, in float64 and column-vector form; shared by the camera and the lights."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from glcaustics.scene.model import FloatArray


def unit(vector: npt.ArrayLike) -> FloatArray:
    """The vector (3,) at length 1; it must not be zero."""
    v = np.asarray(vector, np.float64)
    return np.asarray(v / np.linalg.norm(v))


def basis(forward: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A right and an up axis for a forward axis, so that right x up = -forward."""
    helper = np.array([0.0, 0.0, -1.0]) if abs(forward[1]) > 0.9 else np.array([0.0, 1.0, 0.0])
    right = unit(np.cross(forward, helper))
    return right, np.cross(right, forward)


def view_from_world(right: FloatArray, up: FloatArray, forward: FloatArray, origin: FloatArray) -> FloatArray:
    """(4, 4) column-vector form: world to an eye at `origin` that looks along `forward` (-Z); axes of unit length."""
    m = np.eye(4)
    m[0, :3], m[1, :3], m[2, :3] = right, up, -forward
    m[:3, 3] = -m[:3, :3] @ origin
    return m


def orthographic(x0: float, x1: float, y0: float, y1: float, near: float, far: float) -> FloatArray:
    """Clip-from-view matrix of an orthographic window; near and far are distances along -Z."""
    m = np.eye(4)
    m[0, 0], m[1, 1], m[2, 2] = 2 / (x1 - x0), 2 / (y1 - y0), -2 / (far - near)
    m[0, 3], m[1, 3], m[2, 3] = -(x1 + x0) / (x1 - x0), -(y1 + y0) / (y1 - y0), -(far + near) / (far - near)
    return m


def perspective(x0: float, x1: float, y0: float, y1: float, near: float, far: float) -> FloatArray:
    """Clip-from-view matrix of an off-centre perspective window given in tangents."""
    m = np.zeros((4, 4))
    m[0, 0], m[0, 2] = 2 / (x1 - x0), (x1 + x0) / (x1 - x0)
    m[1, 1], m[1, 2] = 2 / (y1 - y0), (y1 + y0) / (y1 - y0)
    m[2, 2], m[2, 3] = -(far + near) / (far - near), -2 * far * near / (far - near)
    m[3, 2] = -1
    return m
