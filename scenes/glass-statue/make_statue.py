"""Makes statue.ply (a glass figure on a lotus), wall.glb and wall.jpg (coloured stones), floor.png (inlaid tiles).

    python scenes/glass-statue/make_statue.py

The figure is one smooth union of ellipsoids and tapered capsules, with robe folds and curls as displacement; it is
half a metre tall and watertight. The wall's relief and its picture come from the same stones.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
from procedural import (  # noqa: E402
    capsule,
    ellipsoid,
    polygonise,
    save_jpg,
    save_png,
    smooth_max,
    smooth_min,
    write_glb,
    write_ply,
)
from procedural_fields import fractal2  # noqa: E402
from procedural_parts import grid_part  # noqa: E402

CELLS_ALONG_HEIGHT = 102
HEIGHT_M = 0.5
LOW, HIGH = (-1.02, -0.05, -0.85), (1.02, 2.42, 0.98)  # model space: the figure is 2.3 units tall
WALL_M = (2.9, 1.4)  # width, height
RELIEF_M = 0.045


def folded(p, count, turn=0.0):
    """Points (..., 3) turned about y into the sector of +z, one of `count`; mirrored there, without a crease."""
    sector = 2.0 * np.pi / count
    angle = np.arctan2(p[..., 0], p[..., 2]) + turn
    angle = angle - sector * np.round(angle / sector)
    radius = np.hypot(p[..., 0], p[..., 2])
    return np.stack([radius * np.sin(angle), p[..., 1], radius * np.cos(angle)], axis=-1)


def lotus(p):
    """The seat: a drum between two rings of petals."""
    drum = ellipsoid(p, (0.0, 0.16, 0.0), (0.74, 0.26, 0.66))
    upper = ellipsoid(folded(p, 14), (0.0, 0.25, 0.68), (0.16, 0.17, 0.11))
    lower = ellipsoid(folded(p, 14, np.pi / 14), (0.0, 0.08, 0.71), (0.17, 0.13, 0.13))
    d = smooth_min(drum, smooth_min(upper, lower, 0.05), 0.07)
    return d


def figure(p):
    """The seated body without the seat; it looks along +z."""
    m = np.array(p)
    m[..., 0] = np.sqrt(p[..., 0] ** 2 + 0.04**2)  # |x| without a crease where the two sides meet
    d = smooth_min(
        ellipsoid(p, (0.0, 0.86, -0.05), (0.37, 0.50, 0.27)), ellipsoid(p, (0.0, 1.17, -0.02), (0.42, 0.25, 0.25)), 0.2
    )
    d = smooth_min(d, capsule(m, (0.0, 1.28, -0.03), (0.42, 1.25, -0.03), 0.10, 0.09), 0.16)
    d = smooth_min(d, capsule(m, (0.20, 0.50, -0.02), (0.74, 0.47, 0.26), 0.20, 0.12), 0.18)
    d = smooth_min(d, capsule(p, (0.74, 0.45, 0.26), (-0.22, 0.43, 0.60), 0.10, 0.06), 0.12)
    d = smooth_min(d, capsule(p, (-0.74, 0.45, 0.26), (0.22, 0.47, 0.56), 0.10, 0.06), 0.10)
    arm = smooth_min(
        capsule(m, (0.50, 1.22, -0.02), (0.60, 0.82, 0.06), 0.09, 0.06),
        capsule(m, (0.60, 0.82, 0.06), (0.13, 0.64, 0.40), 0.06, 0.03),
        0.08,
    )
    d = smooth_min(d, arm, 0.09)
    d = smooth_min(d, ellipsoid(p, (0.0, 0.62, 0.42), (0.21, 0.07, 0.12)), 0.08)
    folds = 0.010 * np.sin(26.0 * (p[..., 1] - 0.55 * p[..., 0] + 0.25 * np.sin(2.0 * p[..., 0])))
    chest = np.exp(-(((p[..., 1] - 0.95) / 0.30) ** 4)) * np.exp(-((p[..., 0] / 0.42) ** 4))
    drape = 0.014 * np.sin(16.0 * np.abs(m[..., 0]) + 9.0 * p[..., 2])
    lap = np.exp(-(((p[..., 1] - 0.45) / 0.16) ** 4)) * np.clip(m[..., 0] * 2.0 - 0.3, 0.0, 1.0)
    return d + folds * chest + drape * lap


def head(p):
    """Head with ears, nose, brows and a knot of curled hair."""
    m = np.array(p)
    m[..., 0] = np.sqrt(p[..., 0] ** 2 + 0.015**2)
    skull = smooth_min(
        ellipsoid(p, (0.0, 1.75, 0.03), (0.225, 0.27, 0.245)), ellipsoid(p, (0.0, 1.64, 0.07), (0.17, 0.19, 0.18)), 0.1
    )
    knot = ellipsoid(p, (0.0, 2.03, -0.01), (0.12, 0.13, 0.12))
    hair = smooth_min(skull, knot, 0.09)
    curls = np.sin(34.0 * p[..., 0]) * np.sin(34.0 * p[..., 1]) * np.sin(34.0 * p[..., 2])
    line = 1.84 - 0.45 * (0.20 - p[..., 2])  # the hairline runs down towards the neck
    above = 1.0 / (1.0 + np.exp(np.clip(-60.0 * (p[..., 1] - line), -50.0, 50.0)))
    hair = hair - 0.018 * above - 0.012 * curls * above
    d = smooth_min(hair, capsule(p, (0.0, 1.30, -0.01), (0.0, 1.56, 0.02), 0.10, 0.10), 0.08)
    d = smooth_min(d, ellipsoid(m, (0.235, 1.66, 0.02), (0.035, 0.15, 0.06)), 0.03)
    d = smooth_min(d, capsule(p, (0.0, 1.76, 0.262), (0.0, 1.67, 0.285), 0.012, 0.026), 0.04)
    eye = ellipsoid(m, (0.085, 1.735, 0.265), (0.055, 0.022, 0.03))
    d = smooth_max(d, -eye, 0.04)
    d = smooth_min(d, ellipsoid(m, (0.085, 1.728, 0.232), (0.05, 0.026, 0.03)), 0.02)
    return smooth_min(d, ellipsoid(p, (0.0, 1.59, 0.235), (0.06, 0.020, 0.03)), 0.02)


def halo(p):
    """A ring of beads behind the head, grown into the shoulders."""
    q = p - np.array([0.0, 1.72, -0.20])
    angle = np.arctan2(q[..., 0], q[..., 1])
    ring = np.hypot(np.hypot(q[..., 0], q[..., 1]) - 0.50, q[..., 2] * 0.8)
    return ring - 0.055 - 0.016 * np.cos(24.0 * angle)


def field(p):
    """Implicit function (...,), negative inside."""
    d = smooth_min(figure(p), head(p), 0.07)
    d = smooth_min(d, halo(p), 0.06)
    d = smooth_min(d, lotus(p), 0.06)
    return smooth_max(d, -p[..., 1], 0.03)  # a flat sole to stand on


def stones(x, y, seed):
    """Irregular masonry at (x, y), metres: (relief in [0, 1], colour (..., 3) sRGB)."""
    random = np.random.default_rng(seed)
    course, length = 0.115, 0.17
    rows, columns = int(WALL_M[1] / course) + 4, int(WALL_M[0] / length) + 6
    palette = np.array(
        [(0.62, 0.45, 0.36), (0.72, 0.63, 0.48), (0.42, 0.49, 0.55), (0.70, 0.67, 0.61), (0.47, 0.37, 0.34)]
        + [(0.45, 0.50, 0.43), (0.78, 0.73, 0.65), (0.56, 0.51, 0.46), (0.36, 0.43, 0.51), (0.68, 0.52, 0.41)]
    )
    shade = palette[random.integers(0, len(palette), rows * columns)] * random.uniform(0.8, 1.1, (rows * columns, 1))
    rise = random.uniform(0.55, 1.0, rows * columns)
    j, i = np.meshgrid(np.arange(columns), np.arange(rows))
    jitter = random.uniform(-0.26, 0.26, (2, rows, columns))
    centre_x = (j + 0.5 * (i % 2) + jitter[0] - 2.5) * length - 0.5 * WALL_M[0]
    centre_y = (i + 0.6 * jitter[1] - 1.0) * course
    near, second = np.full(x.shape, 1e9), np.full(x.shape, 1e9)
    owner = np.zeros(x.shape, int)
    wobble = 0.012 * fractal2(x, y, 0.06, 3, seed + 9)
    for k, (cx, cy) in enumerate(zip(centre_x.ravel(), centre_y.ravel(), strict=True)):
        if abs(cx) > 0.5 * WALL_M[0] + 0.3:
            continue
        d = np.maximum(np.abs(x - cx) / 1.35, np.abs(y - cy)) * 0.6 + 0.4 * np.hypot((x - cx) / 1.35, y - cy) + wobble
        closer = d < near
        second = np.where(closer, near, np.minimum(second, d))
        owner, near = np.where(closer, k, owner), np.minimum(near, d)
    edge = np.clip((second - near - 0.004) / 0.045, 0.0, 1.0)
    dome = np.sqrt(1.0 - (1.0 - edge) ** 2)
    grain = fractal2(x, y, 0.05, 4, seed + 3)
    relief = dome * (0.80 * rise[owner] + 0.12 * grain)
    mortar = np.array([0.42, 0.38, 0.34])
    cover = np.clip((second - near - 0.002) / 0.010, 0.0, 1.0)[..., None]
    vein = np.clip(np.abs(fractal2(x * 1.3, y * 2.0, 0.11, 4, seed + 5)) * 9.0, 0.0, 1.0)[..., None]
    color = shade[owner] * (1.0 + 0.22 * grain[..., None]) * (0.82 + 0.18 * vein)
    return relief, cover * color + (1.0 - cover) * mortar * (1.0 + 0.2 * grain[..., None])


def make_wall():
    """The relief as a lattice, and its picture."""
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 252) * WALL_M[0], np.linspace(WALL_M[1], 0.0, 122))
    relief, _ = stones(x, y, 11)
    positions = np.stack([x, y, RELIEF_M * relief], axis=-1)
    u, v = np.meshgrid(np.linspace(0.0, 1.0, 252), np.linspace(0.0, 1.0, 122))
    positions, normals, uv, triangles = grid_part(positions, np.stack([u, v], axis=-1))
    if normals[:, 2].mean() < 0.0:
        normals, triangles = -normals, triangles[:, ::-1]
    write_glb(HERE / "wall.glb", {"wall": (positions, normals, uv, triangles)})
    x, y = np.meshgrid((np.arange(1536) + 0.5) / 1536 - 0.5, 1.0 - (np.arange(960) + 0.5) / 960)
    save_jpg(HERE / "wall.jpg", stones(x * WALL_M[0], y * WALL_M[1], 11)[1], 84)


def make_floor(size=1024, tiles=4):
    """Inlaid tiles: eight-pointed stars and crosses in four colours, with worn joints; repeats without a seam."""
    at = (np.arange(size) + 0.5) / size * tiles
    x, y = np.meshgrid(at - np.floor(at) - 0.5, at - np.floor(at) - 0.5)
    number = (np.floor(at).astype(int)[None, :] * 3 + np.floor(at).astype(int)[:, None] * 5) % 7
    square = np.maximum(np.abs(x), np.abs(y)) - 0.33
    diamond = (np.abs(x) + np.abs(y)) / np.sqrt(2.0) - 0.33
    star = np.minimum(square, diamond)
    heart = np.maximum(np.abs(x), np.abs(y)) + 0.35 * np.minimum(np.abs(x), np.abs(y)) - 0.17
    ivory, slate = np.array([0.84, 0.81, 0.75]), np.array([0.56, 0.61, 0.66])
    sage, rose = np.array([0.62, 0.68, 0.62]), np.array([0.73, 0.58, 0.49])
    level = 1.0 + 0.05 * (number[..., None] - 3) / 3.0
    color = np.where(star[..., None] < 0, np.where((number % 2 == 0)[..., None], slate, sage), ivory) * level
    color = np.where((heart < 0)[..., None], rose * level, color)
    joint = np.minimum(np.minimum(np.abs(star), np.abs(heart)), 0.5 - np.maximum(np.abs(x), np.abs(y)))
    cover = np.clip((joint - 0.008) / 0.008, 0.0, 1.0)[..., None]
    noise = np.random.default_rng(4).normal(size=(size, size, 1)) * 0.015
    color = cover * color + (1.0 - cover) * np.array([0.58, 0.54, 0.48])
    save_png(HERE / "floor.png", color + noise, 64)


def main():
    step = (HIGH[1] - LOW[1]) / CELLS_ALONG_HEIGHT
    vertices, normals, triangles = polygonise(field, LOW, HIGH, step)
    scale = HEIGHT_M / np.ptp(vertices[:, 1])
    vertices = (vertices - [0.0, vertices[:, 1].min(), 0.0]) * scale
    write_ply(HERE / "statue.ply", vertices, normals, triangles, "MIT, made by make_statue.py of glcaustics")
    print(f"{len(vertices)} vertices, {len(triangles)} triangles")
    make_wall()
    make_floor()


if __name__ == "__main__":
    main()
