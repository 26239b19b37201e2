"""Makes the floors of the small scenes: terrazzo tiles, oak, ash and floor boards, a woven rug. NumPy and Pillow.

    python scenes/make_floors.py

All of them repeat without a seam. Colours are sRGB; the tones are quiet, so that caustics stay what one looks at.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from procedural import save_png
from procedural_fields import periodic

HERE = Path(__file__).resolve().parent


def terrazzo(size=1024, tiles=2):
    """Pale tiles with chips of stone and thin joints."""
    random = np.random.default_rng(3)
    color = np.full((size, size, 3), (0.74, 0.72, 0.68)) * (1.0 + 0.03 * periodic(size, 12, 1))[..., None]
    tints = np.array(
        [(0.58, 0.54, 0.50), (0.84, 0.82, 0.78), (0.62, 0.50, 0.43), (0.50, 0.53, 0.55), (0.78, 0.70, 0.60)]
    )
    y, x = np.mgrid[-12:13, -12:13]
    for _ in range(2600):
        r, squash, turn = random.uniform(1.5, 8.0), random.uniform(0.5, 1.0), random.uniform(0, np.pi)
        u, v = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
        cover = np.clip(r - np.maximum(np.abs(u) + 0.4 * np.abs(v), np.hypot(u, v / squash)) + 0.5, 0.0, 1.0)[..., None]
        at, tint = random.integers(0, size, 2), tints[random.integers(0, 5)]
        rows, columns = (at[0] + y[:, 0]) % size, (at[1] + x[0]) % size
        color[np.ix_(rows, columns)] = color[np.ix_(rows, columns)] * (1.0 - cover) + tint * cover
    at = (np.arange(size) + 0.5) / size * tiles
    edge = np.minimum(at % 1.0, 1.0 - at % 1.0)
    cover = np.clip((edge - 0.004) / 0.003, 0.0, 1.0)
    number = np.floor(at).astype(int)
    level = 1.0 + 0.025 * random.normal(size=(tiles, tiles))[number[:, None], number[None, :]]
    cover = (cover[:, None] * cover[None, :])[..., None]
    return cover * color * level[..., None] + (1.0 - cover) * np.array([0.55, 0.53, 0.50])


def boards(base, rows, seed, size=1024, contrast=0.16, joints=1):
    """Planks along u, with grain, one or two butt joints a repeat, and a tone of their own."""
    random = np.random.default_rng(seed)
    u, v = np.meshgrid((np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size * rows)
    row = v.astype(int)
    joint_at, tone = random.uniform(0, 1, rows), random.normal(size=(rows, 2)) * 0.07
    half = (((u - joint_at[row]) % 1.0 > 0.5) & (joints == 2)).astype(int)
    shift = random.uniform(0, 1, (rows, 2))[row, half]
    grain = np.zeros(u.shape)
    for _ in range(60):
        ku, kv, phase = random.integers(0, 5), random.uniform(0.3, 9.0), random.random()
        grain += np.cos(
            2 * np.pi * (ku * u + kv * (v % 1.0) + 7.0 * shift + phase + 0.2 * np.sin(2 * np.pi * (u + phase)))
        )
    grain /= np.abs(grain).max()
    fine = np.random.default_rng(seed + 1).normal(size=(size, 1)) * 0.02
    color = np.array(base) * (1.0 + tone[row, half] + contrast * grain + fine)[..., None]
    across = np.minimum(v % 1.0, 1.0 - v % 1.0) / rows
    along = np.minimum.reduce([np.abs((u - joint_at[row] + s) % 1.0 - 0.5) for s in (0.5, 0.0)[:joints]])
    gap = np.clip(np.minimum(across, along) / 0.0018, 0.0, 1.0)[..., None]
    return color * (0.45 + 0.55 * gap)


def rug(size=512):
    """A woven border of stripes and diamonds; u and v run once over the rug."""
    u, v = np.meshgrid((np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size)
    edge = np.minimum(np.minimum(u, 1.0 - u) * 1.26, np.minimum(v, 1.0 - v))
    color = np.where((edge > 0.12)[..., None], (0.62, 0.50, 0.42), (0.70, 0.64, 0.54))
    diamond = np.abs((u * 10.08) % 1.0 - 0.5) + np.abs((v * 8.0) % 1.0 - 0.5)
    color = np.where(((edge > 0.15) & (diamond < 0.26))[..., None], (0.42, 0.30, 0.28), color)
    color = np.where(((edge > 0.045) & (edge < 0.075))[..., None], (0.32, 0.36, 0.42), color)
    weave = 1.0 + 0.05 * np.sign(np.sin(u * size * np.pi / 2)) * np.sign(np.sin(v * size * np.pi / 2))
    return np.roll(color * weave[..., None], size // 2, axis=(0, 1))  # a box has its texture's origin in the middle


if __name__ == "__main__":
    save_png(HERE / "glass-sphere" / "terrazzo.png", terrazzo(), 48)
    save_png(HERE / "metal-ring" / "oak.png", boards((0.60, 0.47, 0.36), 5, 5), 48)
    save_png(HERE / "glass-bunny" / "ash.png", boards((0.76, 0.69, 0.60), 5, 9, contrast=0.10), 48)
    save_png(HERE / "dry-room" / "boards.png", boards((0.55, 0.42, 0.31), 8, 12), 48)
    save_png(HERE / "dry-room" / "rug.png", rug(), 32)
