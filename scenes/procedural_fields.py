"""Noise, pebbles and random places for the generator scripts. NumPy only."""

from __future__ import annotations

import numpy as np


def noise2(x, z, cell, seed):
    """Smooth value noise in [-1, 1] with lattice spacing `cell`; arrays of any shape."""
    random = np.random.default_rng(seed)
    table = random.uniform(-1.0, 1.0, (64, 64))
    u, v = np.asarray(x) / cell, np.asarray(z) / cell
    i, j = np.floor(u).astype(int), np.floor(v).astype(int)
    fu, fv = u - i, v - j
    fu, fv = fu**3 * (fu * (6 * fu - 15) + 10), fv**3 * (fv * (6 * fv - 15) + 10)
    at = table[i % 64, j % 64] * (1 - fu) + table[(i + 1) % 64, j % 64] * fu
    far = table[i % 64, (j + 1) % 64] * (1 - fu) + table[(i + 1) % 64, (j + 1) % 64] * fu
    return at * (1 - fv) + far * fv


def fractal2(x, z, cell, octaves, seed, gain=0.5):
    """Sum of `octaves` noises, each of half the cell and `gain` times the strength; about [-1, 1]."""
    total, weight, strength = 0.0, 0.0, 1.0
    for n in range(octaves):
        total = total + strength * noise2(x + 13.7 * n, z - 7.1 * n, cell / 2**n, seed + n)
        weight, strength = weight + strength, strength * gain
    return total / weight


def step(low, high, x):
    """0 at `low`, 1 at `high` (either may be the larger), smooth in between."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def scatter(seed, count, box, gap, accept):
    """Up to `count` random places (x, z) in a box, no two nearer than `gap`."""
    random = np.random.default_rng(seed)
    found: list[tuple[float, float]] = []
    for _ in range(6000):
        x, z = random.uniform(*box[0]), random.uniform(*box[1])
        if len(found) < count and accept(x, z) and all(np.hypot(x - a, z - b) > gap for a, b in found):
            found.append((x, z))
    return found


def pebbles(x, z, cell, seed, share):
    """Round stones on a jittered lattice: (cover in [0, 1], stone number, height in [0, 1])."""
    random = np.random.default_rng(seed)
    jitter, size = random.uniform(0.15, 0.85, (2, 64, 64)), random.uniform(0.15, 0.48, (64, 64))
    size[random.random((64, 64)) > share] = 0.0
    i, j = np.floor(x / cell).astype(int), np.floor(z / cell).astype(int)
    best, owner = np.full(x.shape, -1.0), np.zeros(x.shape, int)
    for di in (-1, 0, 1):
        for dj in (-1, 0, 1):
            a, b = (i + di) % 64, (j + dj) % 64
            dx, dz = x / cell - (i + di + jitter[0][a, b]), z / cell - (j + dj + jitter[1][a, b])
            squash = 1.0 + 0.5 * jitter[0][a, b]
            inside = 1.0 - np.hypot(dx * squash, dz) / np.maximum(size[a, b], 1e-3)
            owner = np.where(inside > best, a * 64 + b, owner)
            best = np.maximum(best, inside)
    return np.clip(best / 0.12, 0.0, 1.0), owner, np.sqrt(np.clip(best, 0.0, 1.0))


def periodic(size, waves, seed, falloff=0.15):
    """Noise in [-1, 1] that repeats, (size, size): a sum of plane waves with whole numbers of periods."""
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(size) / size, np.arange(size) / size)
    total = np.zeros((size, size))
    for _ in range(70):
        kx, ky = random.integers(-waves, waves + 1, 2)
        total += np.cos(2 * np.pi * (kx * x + ky * y + random.random())) / (1.0 + falloff * np.hypot(kx, ky))
    return total / np.abs(total).max()
