"""Makes the pool's textures: tiles.png, border.png (the dark band), stone.png (paving) and ball.png. NumPy and Pillow.

    python scenes/pool/make_tiles.py

All of them repeat without a seam. Colours are sRGB, chosen as they are stored.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).parent


def save(name, color, colors=0):
    """Write sRGB values in [0, 1], (H, W, 3), as a PNG, with a palette of `colors` when given (small files)."""
    picture = Image.fromarray((np.clip(color, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8))
    if colors:
        picture = picture.quantize(colors, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    picture.save(HERE / name, optimize=True)


def tiling(size, tiles, grout, bevel):
    """(tile number x, tile number y, 1 inside a tile and 0 in the grout) for each texel of a square texture."""
    at = (np.arange(size) + 0.5) / size * tiles
    number = at.astype(int)
    edge = np.minimum(at - number, 1.0 - (at - number))
    cover = np.clip((edge - grout) / bevel, 0.0, 1.0)
    return number[None, :], number[:, None], cover[None, :] * cover[:, None]


def mosaic(size, tiles, base, spread, tint, grout_color, seed):
    """Square tiles whose brightness and hue vary from tile to tile."""
    random = np.random.default_rng(seed)
    nx, ny, cover = tiling(size, tiles, 0.045, 0.02)
    level = 1.0 + spread * random.normal(size=(tiles, tiles, 1))
    hue = 1.0 + np.array(tint) * random.normal(size=(tiles, tiles, 1))
    color = np.array(base) * level * hue
    return cover[..., None] * color[ny, nx] + (1.0 - cover[..., None]) * np.array(grout_color)


def smooth_noise(size, waves, seed):
    """Periodic noise in about [-1, 1]: a sum of plane waves with whole numbers of periods."""
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(size) / size, np.arange(size) / size)
    total = np.zeros((size, size))
    for _ in range(60):
        kx, ky = random.integers(-waves, waves + 1, 2)
        total += np.cos(2 * np.pi * (kx * x + ky * y + random.random())) / (1.0 + 0.15 * np.hypot(kx, ky))
    return total / np.abs(total).max()


def stone(size, slabs, seed):
    """Pale limestone slabs with thin joints."""
    random = np.random.default_rng(seed)
    nx, ny, cover = tiling(size, slabs, 0.008, 0.004)
    level = 1.0 + 0.05 * random.normal(size=(slabs, slabs, 1))
    grain = 1.0 + 0.05 * smooth_noise(size, 9, seed + 1)[..., None] + 0.03 * smooth_noise(size, 40, seed + 2)[..., None]
    color = np.array([0.80, 0.76, 0.69]) * level[ny, nx] * grain
    return cover[..., None] * color + (1.0 - cover[..., None]) * np.array([0.46, 0.43, 0.39])


def beach_ball(size, panels):
    """Coloured panels between white ones, white caps at both poles; u goes once round, v from pole to pole."""
    colors = np.array(
        [(0.75, 0.05, 0.04), (0.85, 0.84, 0.80), (0.95, 0.55, 0.03), (0.85, 0.84, 0.80), (0.03, 0.16, 0.55)]
    )
    colors = np.concatenate([colors, colors[1:2]])
    panel = ((np.arange(size) + 0.5) / size * panels).astype(int)
    picture = np.tile(colors[panel % len(colors)][None], (size, 1, 1))
    cap = size // 24
    picture[:cap] = picture[-cap:] = (0.85, 0.84, 0.80)
    return picture


if __name__ == "__main__":
    white_grout = (0.80, 0.83, 0.83)
    save("tiles.png", mosaic(1024, 16, (0.56, 0.76, 0.82), 0.05, (0.05, 0.0, -0.02), white_grout, 1), 128)
    save("border.png", mosaic(512, 8, (0.035, 0.13, 0.28), 0.18, (0.08, 0.03, 0.0), white_grout, 2), 64)
    save("ball.png", beach_ball(384, 6), 8)
    save("stone.png", stone(1024, 4, 3), 64)
