"""Coral-like shapes for make_lagoon.py. Mesh parts in metres, foot at the origin; texture v runs from foot to tip."""

from __future__ import annotations

import numpy as np
from procedural_fields import fractal2
from procedural_parts import grid_part, joined, placed, tube, upward


def outward(part, centre=(0.0, 0.0, 0.0)):
    """The part with its front away from `centre`."""
    positions, normals, uv, triangles = part
    turned = ((positions - np.asarray(centre)) * normals).sum() < 0.0
    return (positions, -normals, uv, triangles[:, ::-1]) if turned else part


def staghorn(seed, height=0.5):
    """A bush of forking branches with blunt tips."""
    random = np.random.default_rng(seed)
    parts = []

    def grow(start, way, length, radius, level):
        t = np.linspace(0.0, 1.0, 5)[:, None]
        bend = random.normal(size=3) * 0.25
        path = start + length * (t * way + t**2 * bend * 0.5)
        thick = radius * (1.0 - 0.22 * t[:, 0])
        tip = path[-1] + (path[-1] - path[-2]) * 0.25
        branch = tube(np.concatenate([path, tip[None]]), np.append(thick, thick[-1] * 0.55), 6)
        v = np.clip(branch[0][:, 1] / height, 0.0, 1.0)
        parts.append((branch[0], branch[1], np.stack([0.5 + 0 * v, 1.0 - v], axis=-1), branch[3]))
        if level == 0:
            return
        for k in range(3):
            away = random.normal(size=3) * 0.62
            on = way + bend * 0.8 + away + np.array([0.0, 0.35, 0.0])
            at = path[-1 - (k % 2)]
            grow(at, on / np.linalg.norm(on), length * random.uniform(0.62, 0.85), radius * 0.80, level - 1)

    for _ in range(7):
        way = random.normal(size=3) * 0.62 + np.array([0.0, 1.0, 0.0])
        grow(np.array([0.0, -0.03, 0.0]), way / np.linalg.norm(way), height * 0.42, 0.036, 2)
    return joined(parts)


def brain(seed, radius=0.3):
    """A dome with winding grooves; texture v follows the groove's depth."""
    theta, phi = np.linspace(0.02, 0.62 * np.pi, 44), np.linspace(0.0, 2.0 * np.pi, 109)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=-1)
    unit[:, -1] = unit[:, 0]
    x, y, z = unit[..., 0] * 10.0, unit[..., 1] * 10.0, unit[..., 2] * 10.0
    warp = fractal2(unit[..., 0] + 3.0 * unit[..., 1], unit[..., 2], 0.5, 3, seed)
    maze = np.sin(x + 3.0 * warp + 1.5 * np.sin(y)) + np.sin(z + 2.5 * warp + 1.7 * np.sin(x)) + np.sin(y + z)
    ridge = 0.5 + 0.5 * np.tanh(2.2 * np.sin(2.2 * maze))
    r = radius * (1.0 + 0.055 * ridge + 0.06 * np.sin(2.0 * p + seed) * np.sin(t))
    lattice = unit * r[..., None] * [1.0, 0.72, 0.92]
    lattice[:, -1] = lattice[:, 0]
    positions, normals, uv, triangles = outward(
        grid_part(lattice, np.stack([0.5 + 0 * ridge, 0.92 - 0.8 * ridge], axis=-1))
    )
    rows = normals.reshape(44, 109, 3).copy()
    rows[:, 0] = rows[:, -1] = rows[:, 0] + rows[:, -1]
    rows[:, 0] = rows[:, -1] = rows[:, 0] / np.linalg.norm(rows[:, 0], axis=-1, keepdims=True)
    return positions, rows.reshape(-1, 3), uv, triangles


def table(seed, radius=0.30, height=0.26):
    """A plate on a stalk: it shades what lies below."""
    random = np.random.default_rng(seed)
    a, r = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 73), np.linspace(0.02, 1.0, 16))
    phase = random.uniform(0.0, 6.28, 3)
    rim = 1.0 + 0.10 * np.sin(3 * a + phase[0]) + 0.06 * np.sin(7 * a + phase[1]) + 0.03 * np.sin(17 * a + phase[2])
    rho = radius * r * rim
    bump = 0.012 * fractal2(rho * np.cos(a), rho * np.sin(a), 0.06, 3, seed) * r
    y = height + 0.09 * r**2 + bump
    layers = []
    for sink in (0.0, 1.0):
        lattice = np.stack([rho * np.cos(a), y - sink * (0.022 + 0.03 * (1.0 - r)), rho * np.sin(a)], axis=-1)
        lattice[:, -1] = lattice[:, 0]
        part = upward(grid_part(lattice, np.stack([0.5 + 0 * r, 0.75 - 0.65 * r**3], axis=-1)))
        layers.append(part if sink == 0.0 else (part[0], -part[1], part[2], part[3][:, ::-1]))
    stem_y = np.linspace(-0.08, height, 8)
    stem = tube(np.stack([0 * stem_y, stem_y, 0 * stem_y], axis=-1), 0.10 - 0.05 * np.sin(np.linspace(0, np.pi, 8)), 14)
    stem = (stem[0], stem[1], np.stack([0.5 + 0 * stem[2][:, 0], 0.9 + 0 * stem[2][:, 0]], axis=-1), stem[3])
    rim_pair = np.stack([layers[0][0].reshape(16, 73, 3)[-1], layers[1][0].reshape(16, 73, 3)[-1]])
    edge = outward(grid_part(rim_pair, np.full((2, 73, 2), 0.1)), (0.0, height, 0.0))
    return joined([*layers, edge, stem])


def sponge(seed, count=6, height=0.42):
    """A group of open tubes."""
    random = np.random.default_rng(seed)
    parts = []
    for k in range(count):
        tall = height * random.uniform(0.5, 1.0)
        a, t = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 21), np.linspace(0.0, 1.0, 13))
        swell = 0.045 + 0.012 * np.sin(np.pi * t) + 0.004 * np.sin(9.0 * t * tall / 0.4 + 3 * np.sin(a))
        # up the outside, over the lip and down into the tube
        y = np.where(t < 0.7, t / 0.7, 1.0 - np.maximum(t - 0.78, 0.0) * 2.2) * tall
        radius = np.where(t < 0.72, swell, swell - 0.020)
        lean = np.array([np.cos(k * 2.4), 0.0, np.sin(k * 2.4)]) * 0.30
        lattice = np.stack([radius * np.cos(a), y, radius * np.sin(a)], axis=-1)
        lattice = lattice + lean * y[..., None] * 0.8 + lean * 0.22
        lattice[:, -1] = lattice[:, 0]
        v = np.where(t < 0.72, 0.75 - 0.6 * y / height, 0.98)
        part = grid_part(lattice, np.stack([0.5 + 0 * v, v], axis=-1))
        outer = part[1].reshape(13, 21, 3)[:6]
        middle = (lattice[:6] - lattice[:6].mean(axis=1, keepdims=True)) * outer
        parts.append((part[0], -part[1], part[2], part[3][:, ::-1]) if middle.sum() < 0.0 else part)
    return joined(parts)


def starfish(radius=0.16):
    """Five blunt arms, domed."""
    a, r = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 121), np.linspace(0.0, 1.0, 14))
    arm = 0.36 + 0.64 * (0.5 + 0.5 * np.cos(5.0 * a)) ** 1.6
    rho = radius * arm * r
    y = 0.035 * np.sqrt(np.clip(1.0 - r**2.4, 0.0, 1.0)) * (0.55 + 0.45 * (1.0 - r)) + 0.003 * np.cos(40 * r) * r
    lattice = np.stack([rho * np.cos(a), y, rho * np.sin(a)], axis=-1)
    return placed(upward(grid_part(lattice, np.stack([0.5 + 0 * r, 0.15 + 0.6 * r], axis=-1))))
