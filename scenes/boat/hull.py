"""A clinker-built rowing boat, 3.2 m long: strakes, ribs, thwarts, rails, transom, keel, an oar. Used by make_boat.py.

Boat space, metres: +x towards the bow, +y up, the keel's lowest line at y = 0, the origin amidships.
"""

from __future__ import annotations

import numpy as np
from procedural_parts import board, joined, placed, rotation_y, rotation_z, tube

LENGTH, STATIONS, STRAKES = 3.2, 26, 6


def half_beam(t):
    return (
        0.60 * (0.80 + 0.20 * np.sin(np.pi * np.clip(t / 0.8, 0, 1))) * (1.0 - np.clip((t - 0.42) / 0.58, 0, 1) ** 2.4)
    )


def sheer(t):
    return 0.46 + 0.20 * t**2.2 + 0.05 * (1.0 - t) ** 2


def keel(t):
    return 0.02 + 0.30 * np.clip((t - 0.80) / 0.20, 0, 1) ** 2 + 0.05 * np.clip((0.2 - t) / 0.2, 0, 1) ** 2


def shell(t, s, out=0.0, side=1.0):
    """A point of the hull at station t (0 stern, 1 bow), s (0 keel, 1 rail), moved `out` metres outward."""
    t, s = np.broadcast_arrays(np.asarray(t, float), np.asarray(s, float))
    angle = s * 0.5 * np.pi
    wide, high = np.sin(angle) ** 0.85, 1.0 - np.cos(angle) ** 0.9
    flare = 1.0 + 0.10 * s
    y = keel(t) + (sheer(t) - keel(t)) * high - out * np.cos(angle)
    z = half_beam(t) * wide * flare / 1.1 + 0.012 + out * np.sin(np.maximum(angle, 0.3))
    x = (t - 0.5) * LENGTH + 0.10 * s * t**3
    return np.stack([x, y, side * z], axis=-1)


def solid(low, high):
    """`board`, turned so that its faces look outward."""
    positions, normals, uv, triangles = board(low, high)
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    if np.einsum("ni,ni->", a, np.cross(b, c)) < 0.0:
        normals, triangles = -normals, triangles[:, ::-1]
    return positions, normals, uv, triangles


def box(low, high):
    (x0, y0, z0), (x1, y1, z1) = low, high
    lattice = np.array([[(x0, 0, z0), (x1, 0, z0)], [(x0, 0, z1), (x1, 0, z1)]], float)
    return solid(lattice + [0, y0, 0], lattice + [0, y1, 0])


def strakes(inner, outer):
    """Both sides' planks between two distances from the mid-surface; each overlaps the one above."""
    t = np.linspace(0.0, 1.0, STATIONS)[None, :]
    parts = []
    for n in range(STRAKES):
        s = np.linspace(n / STRAKES, min((n + 1.12) / STRAKES, 1.0), 3)[:, None]
        lap = np.linspace(0.0, 0.014, 3)[::-1][:, None]
        for side in (1.0, -1.0):
            parts.append(solid(shell(t, s, inner - lap * -1.0 - 0.014, side), shell(t, s, outer + lap - 0.014, side)))
    return joined(parts)


def fittings():
    """Ribs, thwarts, bottom boards, transom, keel, stem: bare wood."""
    parts = []
    for t in np.linspace(0.10, 0.88, 10):
        s = np.linspace(0.06, 0.97, 12)[:, None]
        for side in (1.0, -1.0):
            ends = np.array([[t - 0.006, t + 0.006]])
            parts.append(solid(shell(ends, s, -0.040, side), shell(ends, s, -0.012, side)))
    for t, height, width in ((0.16, 0.30, 0.30), (0.46, 0.29, 0.24), (0.74, 0.36, 0.22)):
        x = (t - 0.5) * LENGTH
        reach = float(half_beam(t)) * 0.93
        parts.append(box((x - width / 2, height, -reach), (x + width / 2, height + 0.028, reach)))
    for z in (-0.21, -0.07, 0.07, 0.21):
        parts.append(box((-1.25, 0.085, z - 0.055), (0.85, 0.105, z + 0.055)))
    s = np.linspace(0.0, 1.0, 10)[:, None]
    edge = shell(np.zeros((1, 1)), s, 0.012)
    across = np.linspace(-1.0, 1.0, 7)[None, :, None] * np.array([0, 0, 1.0]) * edge[..., 2:] + edge * [1, 1, 0]
    parts.append(solid(across - [0.03, 0, 0], across + [0.004, 0, 0]))
    t = np.linspace(0.0, 1.0, STATIONS)
    line = np.stack([(t - 0.5) * LENGTH, keel(t), 0 * t], axis=-1)
    lattice = np.stack([line - [0, 0, 0.018], line + [0, 0, 0.018]])
    parts.append(solid(lattice - [0, 0.055, 0], lattice + [0, 0.01, 0]))
    s = np.linspace(0.0, 1.04, 8)
    stem = np.stack([0.5 * LENGTH + 0.10 * s + 0.012, keel(1.0) + (sheer(1.0) - keel(1.0)) * s * 1.03, 0 * s], axis=-1)
    lattice = np.stack([stem - [0, 0, 0.022], stem + [0, 0, 0.022]])
    parts.append(solid(lattice - [0.05, 0, 0], lattice + [0.025, 0, 0]))
    return joined(parts)


def rails():
    """Gunwales and the rubbing strake below them: white paint."""
    t = np.linspace(0.0, 1.0, STATIONS)[:, None]
    parts = []
    for side in (1.0, -1.0):
        pair = np.concatenate([shell(t, 1.0, -0.028, side), shell(t, 1.0, 0.026, side)], axis=1).reshape(STATIONS, 2, 3)
        parts.append(solid(pair - [0, 0.012, 0], pair + [0, 0.022, 0]))
        parts.append(solid(shell(t, [[0.86, 0.92]], 0.0, side), shell(t, [[0.86, 0.92]], 0.016, side)))
    return joined(parts)


def oar():
    """An oar that lies across the middle thwart, its blade outside."""
    x = np.linspace(0.0, 2.0, 24)
    shaft = tube(np.stack([x, 0 * x, 0 * x], axis=-1), 0.021 - 0.004 * x / 2.0, 12)
    u = np.linspace(1.75, 2.35, 12)
    width = 0.02 + 0.055 * np.sin(np.clip((u - 1.75) / 0.30, 0, 1) * np.pi / 2)
    blade = np.stack([np.stack([u, 0 * u, -width], axis=-1), np.stack([u, 0 * u, width], axis=-1)])
    return joined([shaft, solid(blade - [0, 0.007, 0], blade + [0, 0.007, 0])])


def clinker_boat():
    """{"hull": painted outside, "boards": bare wood, "rails": white}: mesh parts in boat space."""
    at = placed(oar(), rotation_y(-58.0) @ rotation_z(-4.0), (-0.35, 0.44, -0.30))
    return {
        "hull": strakes(0.0, 0.008),
        "boards": joined([strakes(-0.009, -0.0005), fittings(), at]),
        "rails": rails(),
    }
