"""What the convergence instruments of eye rays and light rays share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from glcaustics.scene.model import Camera, FloatArray, OpticalKind, Scene

SCENES = ("pool", "glass-statue", "boat", "lagoon")  # those that play the parts of Mayer 2026, and one more
SOLID_TURN = np.radians(60.0)
ITERATIONS = tuple(range(8))  # 0: the solver's start alone; as the graphs of Mayer 2026, table 2


def pooled(rows: Sequence[Mapping[str, Any]], weights: Sequence[float]) -> dict[str, Any]:
    """One row for all: numbers of things are summed, shares are averaged by weight.

    Args:
        rows: with equal keys; values are int (summed), float or tuples of float (shares); `iterations`, texts kept.
        weights: of the rows, such as the number of rays that a share counts.
    """
    total = max(float(np.sum(weights)), 1e-30)
    found: dict[str, Any] = {}
    for name, first in rows[0].items():
        values = [row[name] for row in rows]
        if name == "iterations" or isinstance(first, str):
            found[name] = first
        elif isinstance(first, int):
            found[name] = int(sum(values))
        else:
            mean = np.asarray(weights, np.float64) @ np.asarray(values, np.float64) / total
            found[name] = float(mean) if np.ndim(mean) == 0 else tuple(float(v) for v in mean)
    return found


def seeded_cameras(scene: Scene, count: int, seed: int = 0) -> list[Camera]:
    """The scene's own camera, then orbits; every third one grazing.

    Water is seen from all around, about the point that the scene's camera looks at; a glass object from its front,
    within SOLID_TURN of the scene's camera, about its middle: what stands behind it would hide it.
    """
    rng = np.random.default_rng(seed)
    base = scene.view_at(0.0)
    m = np.asarray(base.world_from_camera, np.float64)
    eye, forward = m[:3, 3], -m[:3, 2]
    kinds = [(i.optical_kind, i) for i in scene.instances_at(0.0)]
    solids = [i.positions_ws() for kind, i in kinds if kind is OpticalKind.SOLID]
    around = not solids or any(kind is OpticalKind.INTERFACE for kind, _ in kinds)
    if around:
        target = eye + forward * (eye[1] / max(-forward[1], 0.2)) * 0.9
    else:
        points = np.concatenate(solids)
        target = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = float(np.linalg.norm(eye - target))
    front = float(np.arctan2(eye[2] - target[2], eye[0] - target[0]))
    cameras = [base]
    for index in range(1, count):
        turn = rng.uniform(0.0, 1.0)
        azimuth = 2.0 * np.pi * turn if around else front + SOLID_TURN * (2.0 * turn - 1.0)
        elevation = np.radians(rng.uniform(12.0, 20.0) if index % 3 == 2 else rng.uniform(30.0, 75.0))
        offset = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(elevation), np.sin(azimuth) * np.cos(elevation)])
        place = target + radius * rng.uniform(0.6, 1.1) * offset
        cameras.append(replace(base, world_from_camera=look_at(place, target)))
    return cameras


def look_at(eye: FloatArray, target: FloatArray) -> FloatArray:
    """(4, 4) world_from_camera of a camera at `eye` that looks at `target`, world +y up; metres."""
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    m = np.eye(4)
    m[:3, 0], m[:3, 1], m[:3, 2], m[:3, 3] = right, np.cross(back, right), back, eye
    return m
