"""Makes the meshes and textures of the scene boat: a half-sunk rowing boat among weeds in a shallow lake.

    python scenes/boat/make_boat.py

World space, metres; the mean water level is y = 0. Everything is placed on one bed, `bed_height`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import procedural_parts as geo  # noqa: E402
from hull import clinker_boat  # noqa: E402
from procedural import save_jpg, save_png, write_glb  # noqa: E402
from procedural_fields import fractal2, noise2, pebbles, periodic, scatter, step  # noqa: E402

X_M, Z_M = (-6.8, 5.8), (-5.6, 3.9)  # the bed's rectangle
BOAT_AT, BOAT_YAW, BOAT_PITCH, BOAT_ROLL = (0.15, -0.40, -0.75), 154.0, 12.0, 9.0


def bed_height(x, z):
    """Height of the ground, m: a bumpy bed about 0.95 m down, a bank along the far side."""
    bumps = 0.20 * fractal2(x, z, 1.7, 4, 3) + 0.10 * fractal2(x + 40.0, z, 0.55, 3, 8)
    edge = -2.75 + 0.45 * noise2(x, z * 0.0, 2.3, 21) + 2.6 * step(-3.2, -6.4, x) + 1.0 * step(3.2, 5.6, x)
    bank = step(edge + 0.35, edge - 1.5, z)
    ripples = 0.012 * np.sin(9.0 * x + 5.0 * z + 3.0 * noise2(x, z, 0.8, 5))
    return -0.93 + 1.2 * bumps * (1.0 - 0.6 * bank) + ripples + 1.55 * bank + 0.5 * step(-3.6, -5.6, z)


def lily_pads(seed, spots):
    """Floating leaves with a notch, and a few white flowers."""
    random = np.random.default_rng(seed)
    leaves, flowers = [], []
    for n, (x, z) in enumerate(spots):
        radius, turn = random.uniform(0.10, 0.19), random.uniform(0, 6.28)
        angle = np.linspace(0.16, 2 * np.pi - 0.16, 30) + turn
        r = np.linspace(0.05, 1.0, 5)[:, None] * radius * (1.0 + 0.03 * np.cos(5 * angle))
        rise = 0.014 + 0.03 * radius * np.linspace(0, 1, 5)[:, None] ** 4 + 0.004 * np.sin(3 * angle + n) * r / radius
        lattice = np.stack([x + r * np.cos(angle), rise, z + r * np.sin(angle)], axis=-1)
        u, v = np.meshgrid((angle - turn) / (2 * np.pi), np.linspace(0.0, 1.0, 5))
        leaves.append(geo.upward(geo.grid_part(lattice, np.stack([u, v], axis=-1))))
        if n % 4 == 0:
            flowers.append(geo.placed(flower(random), shift=(x + 0.6 * radius, 0.02, z + 0.5 * radius)))
    return geo.joined(leaves), geo.joined(flowers)


def flower(random):
    """A water lily: three rings of pointed petals."""
    petals = []
    t, s = np.linspace(0.0, 1.0, 6), np.linspace(-1.0, 1.0, 3)
    for ring, (count, tilt, length) in enumerate(((9, 20.0, 0.075), (8, 45.0, 0.065), (6, 68.0, 0.05))):
        width = 0.018 * np.sin(np.pi * np.clip(t, 0.08, 0.97)) ** 0.7
        x = np.repeat(length * t[:, None], 3, 1)
        lattice = np.stack([x, 0.25 * x * t[:, None] + 0.006 * s**2, width[:, None] * s], axis=-1)
        uv = np.stack(np.broadcast_arrays(0.5 + 0.5 * s, t[:, None]), axis=-1)
        part = geo.placed(geo.upward(geo.grid_part(lattice, uv)), geo.rotation_z(tilt))
        for k in range(count):
            petals.append(geo.placed(part, geo.rotation_y(360.0 * (k + 0.5 * ring) / count + random.uniform(-5, 5))))
    return geo.joined(petals)


def boat_frame():
    """World from boat: (rotation, shift)."""
    return geo.rotation_y(BOAT_YAW) @ geo.rotation_x(BOAT_ROLL) @ geo.rotation_z(BOAT_PITCH), np.array(BOAT_AT)


def in_boat(x, z, margin):
    rotate, shift = boat_frame()
    p = (np.array([x, BOAT_AT[1], z]) - shift) @ rotate
    return abs(p[0]) < 1.65 + margin and abs(p[2]) < 0.62 + margin


def make_plants():
    """weeds.glb (under water), reeds.glb (through the surface), grass.glb (on the bank), lilies.glb, flowers.glb."""
    random = np.random.default_rng(2)
    weeds = {f"weed{n}": geo.tuft(30 + n, 104, 0.42, (0.55, 1.0), (0.015, 0.031), (0.05, 0.28), 8) for n in range(3)}
    clumps = [((-3.4, -1.0), (-0.7, 2.2), 11), ((1.2, 3.2), (-2.4, 0.7), 12), ((-4.4, -1.5), (-2.5, -0.9), 7)]
    nodes = []
    for n, (xs, zs, count) in enumerate(clumps):
        for x, z in scatter(n, count, (xs, zs), 0.40, lambda x, z: bed_height(x, z) < -0.5 and not in_boat(x, z, 0.35)):
            y = float(bed_height(x, z))
            size = min((-0.04 - y) / 0.98, 1.15) * random.uniform(0.82, 1.0)
            nodes.append((f"weed{len(nodes) % 3}", geo.matrix(x, y, z, random.uniform(-40, 40), size)))
    write_glb(HERE / "weeds.glb", weeds, nodes)

    reeds = {f"reed{n}": geo.tuft(50 + n, 26, 0.26, (1.1, 1.9), (0.012, 0.022), (0.05, 0.35), 9) for n in range(2)}
    line = scatter(11, 15, ((-5.6, 4.6), (-3.6, -2.6)), 0.42, lambda x, z: -0.45 < bed_height(x, z) < 0.05)
    line += [(1.95, -1.75), (2.3, -1.35), (-2.55, -1.75)]
    write_glb(HERE / "reeds.glb", reeds, geo.on_ground(list(reeds), line, bed_height, random, (0.8, 1.05)))

    grass = {"grass0": geo.tuft(70, 90, 0.55, (0.12, 0.42), (0.008, 0.016), (0.2, 0.9), 5, root=-0.10)}
    spots = scatter(13, 34, ((-6.0, 5.2), (-5.4, -2.9)), 0.50, lambda x, z: bed_height(x, z) > 0.10)
    write_glb(HERE / "grass.glb", grass, geo.on_ground(list(grass), spots, bed_height, random, (0.8, 1.3)))

    near = scatter(17, 15, ((1.35, 3.3), (-1.6, 0.9)), 0.30, lambda x, z: not in_boat(x, z, 0.3))
    far = scatter(19, 9, ((-3.6, -1.6), (-2.5, -1.3)), 0.30, lambda x, z: not in_boat(x, z, 0.3))
    leaves, flowers = lily_pads(5, near + far)
    write_glb(HERE / "lilies.glb", {"leaves": leaves})
    write_glb(HERE / "flowers.glb", {"flowers": flowers})


def make_stones():
    random = np.random.default_rng(6)
    shapes = {f"stone{n}": geo.boulder((0.24, 0.15, 0.19), 80 + n, 0.2, 14) for n in range(3)}
    spots = scatter(23, 20, ((-4.4, 3.4), (-3.4, 1.4)), 0.4, lambda x, z: not in_boat(x, z, 0.1))
    nodes = []
    for n, (x, z) in enumerate(spots):
        size = random.uniform(0.3, 1.0) * (1.3 if z < -2.2 else 1.0)
        nodes.append((f"stone{n % 3}", geo.matrix(x, bed_height(x, z) + 0.05 * size, z, random.uniform(0, 360), size)))
    write_glb(HERE / "stones.glb", shapes, nodes)


def make_boat():
    rotate, shift = boat_frame()
    for name, part in clinker_boat().items():
        write_glb(HERE / f"{name}.glb", {name: geo.placed(part, rotate, shift)})
    bow = np.array([1.52, 0.60, 0.0]) @ rotate.T + shift
    post = np.array([-2.75, 0.42, -2.05])
    t = np.linspace(0.0, 1.0, 40)[:, None]
    line = bow + t * (post - bow) - np.array([0.0, 1.0, 0.0]) * 0.55 * 4.0 * t * (1.0 - t) * 0.5
    ring = np.linspace(0.0, 4.0 * np.pi, 40)
    knot = post + np.stack([0.072 * np.cos(ring), -0.012 * ring / np.pi, 0.072 * np.sin(ring)], axis=-1)
    write_glb(HERE / "rope.glb", {"rope": geo.joined([geo.tube(line, 0.011, 8), geo.tube(knot, 0.012, 8)])})
    foot = bed_height(post[0], post[2]) - 0.1
    y = np.linspace(foot, 0.62, 14)
    lean = np.stack([post[0] + 0.02 * np.sin(3 * y), y, post[2] + 0.03 * (y - 0.42)], axis=-1)
    write_glb(HERE / "post.glb", {"post": geo.tube(lean, np.full(14, 0.062), 16)})


def make_bed(width=2048):
    """bed.glb and bed.jpg: sand with pebbles and algae under water, wet earth and grass above it."""
    write_glb(HERE / "bed.glb", {"bed": geo.ground(bed_height, X_M, Z_M, 150, 114)})
    x, z = geo.ground_texels(X_M, Z_M, width)
    level = bed_height(x, z)
    fine = fractal2(x, z, 0.09, 3, 31)[..., None]
    broad = fractal2(x, z, 1.1, 4, 33)[..., None]
    color = np.array([0.78, 0.72, 0.60]) * (1.0 + 0.10 * fine + 0.12 * broad)
    algae = step(0.05, 0.55, broad + 0.5 * fine)
    color = color * (1.0 - 0.45 * algae) + 0.45 * algae * np.array([0.40, 0.43, 0.27])
    tints = np.array(
        [(0.62, 0.57, 0.49), (0.78, 0.74, 0.66), (0.54, 0.52, 0.48), (0.66, 0.56, 0.45), (0.58, 0.58, 0.54)]
    )
    for cell, seed, share in ((0.036, 41, 0.45), (0.085, 43, 0.28)):
        cover, owner, rise = pebbles(x, z, cell, seed, share)
        stone = tints[owner % 5] * (0.72 + 0.34 * rise + 0.06 * fine[..., 0])[..., None]
        color = color * (1.0 - cover[..., None]) + stone * cover[..., None]
    wet = step(0.20, 0.02, level)[..., None]
    earth = np.array([0.42, 0.34, 0.24]) * (1.0 + 0.25 * fine) * (1.0 - 0.25 * wet)
    green = np.array([0.40, 0.42, 0.26]) * (1.0 + 0.3 * fine + 0.2 * broad)
    meadow = step(0.10, 0.34, level + 0.10 * broad[..., 0])[..., None]
    shore = step(-0.10, 0.05, level + 0.05 * fine[..., 0])[..., None]
    color = color * (1.0 - shore) + shore * (earth * (1.0 - meadow) + green * meadow)
    save_jpg(HERE / "bed.jpg", color, 76)


def make_leaf_textures():
    """leaf.png: four blades side by side, root at the bottom. lily.png: a leaf in polar coordinates."""
    u, v = np.meshgrid((np.arange(128) + 0.5) / 128, (np.arange(256) + 0.5) / 256)
    tints = np.array([(0.46, 0.55, 0.28), (0.56, 0.60, 0.31), (0.40, 0.51, 0.30), (0.62, 0.61, 0.35)])
    rib = np.abs((u * 4.0) % 1.0 - 0.5)
    color = tints[(u * 4).astype(int)] * (0.62 + 0.55 * (1.0 - v))[..., None]
    color = color * (1.0 + 0.25 * np.cos(rib * 36.0) * 0.5 + 0.2 * (rib < 0.07))[..., None]
    color *= 1.0 + 0.08 * fractal2(u * 2.0, v * 3.0, 0.2, 3, 3)[..., None]
    save_png(HERE / "leaf.png", color, 64)
    veins = np.abs(np.sin(u * np.pi * 11.0)) ** 14
    color = np.array([0.38, 0.50, 0.26]) * (0.85 + 0.25 * v + 0.12 * fractal2(u * 4, v, 0.2, 3, 9))[..., None]
    color = color + 0.10 * (veins * (1.0 - v))[..., None]
    color = np.where((v > 0.95)[..., None], color * np.array([1.25, 0.85, 0.75]), color)
    save_png(HERE / "lily.png", color, 64)


def make_wood():
    """wood.png: weathered grain along u. paint.png: chipped paint over it. Both repeat."""
    u, v = np.meshgrid((np.arange(512) + 0.5) / 512, (np.arange(512) + 0.5) / 512)
    random = np.random.default_rng(7)
    grain, chips = np.zeros(u.shape), np.zeros(u.shape)
    for _ in range(70):
        ku, kv = random.integers(0, 4), random.integers(4, 70)
        grain += np.cos(
            2 * np.pi * (ku * u + kv * v + 0.25 * np.sin(2 * np.pi * (u + random.random())) + random.random())
        )
        ku, kv = random.integers(-9, 10), random.integers(-30, 31)
        chips += np.cos(2 * np.pi * (ku * u + kv * v + random.random())) / (4.0 + np.hypot(ku, kv))
    grain, chips = grain / np.abs(grain).max(), chips / np.abs(chips).max()
    wood = np.array([0.60, 0.46, 0.33]) * (1.0 + 0.32 * grain + 0.10 * chips)[..., None]
    save_png(HERE / "wood.png", wood, 48)
    worn = np.clip((chips - 0.22 + 0.25 * grain) / 0.08, 0.0, 1.0)[..., None]
    coat = np.array([0.23, 0.45, 0.50]) * (1.0 + 0.05 * grain + 0.12 * chips)[..., None]
    save_png(HERE / "paint.png", coat * (1.0 - worn) + wood * 0.9 * worn, 48)


def make_stone_texture():
    """stone.png: grey granite with lichen; repeats."""
    grain, patch = periodic(512, 90, 21, 0.02)[..., None], periodic(512, 9, 22)[..., None]
    color = np.array([0.52, 0.50, 0.47]) * (1.0 + 0.22 * grain + 0.18 * patch)
    lichen = np.clip((patch + 0.4 * grain - 0.28) / 0.15, 0.0, 1.0)
    save_png(HERE / "stone.png", color * (1.0 - 0.6 * lichen) + 0.6 * lichen * np.array([0.50, 0.50, 0.36]), 48)


if __name__ == "__main__":
    make_bed()
    make_plants()
    make_stones()
    make_boat()
    make_leaf_textures()
    make_wood()
    make_stone_texture()
