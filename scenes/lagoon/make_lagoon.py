"""Makes the meshes and textures of the scene lagoon: an uneven sandy bed, a beach, things afloat and things sunk.

    python scenes/lagoon/make_lagoon.py

World space, metres; the mean water level is y = 0. Everything is placed on one bed, `bed_height`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import procedural_parts as geo  # noqa: E402
from corals import brain, sponge, staghorn, starfish, table  # noqa: E402
from procedural import save_jpg, save_png, write_glb  # noqa: E402
from procedural_fields import fractal2, noise2, pebbles, periodic, scatter, step  # noqa: E402

X_M, Z_M = (-6.4, 6.8), (-6.2, 4.2)  # the bed's rectangle
BUOY = (-1.55, -0.75)


def shore(x, z):
    """Metres inland of a reference line, negative in the water; the beach lies at the back and to the right."""
    return 0.34 * x - 0.94 * z - 2.55 + 0.35 * noise2(x, z, 2.2, 12)


def bed_height(x, z):
    """Height of the sand, m: about 1.2 m down, hummocky and rippled, rising to a beach."""
    inland = shore(x, z)
    rise = step(-2.6, 1.9, inland)
    hummocks = 0.26 * fractal2(x, z, 1.9, 3, 5) + 0.06 * fractal2(x, z, 0.5, 2, 7)
    phase = 15.0 * (0.30 * x - 0.95 * z) + 3.0 * noise2(x, z, 0.9, 9)
    ripples = 0.012 * (1.0 - np.abs(np.sin(phase))) * step(0.1, -0.6, inland)
    return -1.22 + hummocks * (1.0 - 0.85 * rise) + ripples + 1.75 * rise + 0.05 * np.maximum(inland, 0.0)


def plank(length, width, thick, seed):
    """A worn plank along x, a little bent."""
    random = np.random.default_rng(seed)
    x = np.linspace(-0.5, 0.5, 14) * length
    bow = 0.02 * length * (x / length * 2.0) ** 2 * random.uniform(-0.6, 0.6)
    ragged = 0.02 * random.uniform(-1.0, 1.0, (2, 14)) * (np.abs(x) > 0.47 * length)
    low = np.stack([np.stack([x + ragged[k], bow, 0 * x + side * width / 2], -1) for k, side in ((0, -1), (1, 1))])
    return facing_out(geo.board(low - [0, thick / 2, 0], low + [0, thick / 2, 0]))


def facing_out(part):
    positions, normals, uv, triangles = part
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    if np.einsum("ni,ni->", a, np.cross(b, c)) < 0.0:
        normals, triangles = -normals, triangles[:, ::-1]
    return positions, normals, uv, triangles


def crate(size=0.52):
    """An open crate of slats."""
    parts, half = [], size / 2
    for turn in (0.0, 90.0, 180.0, 270.0):
        for k in range(3):
            slat = geo.placed(plank(size, 0.11, 0.018, k), geo.rotation_x(90.0), (0.0, 0.09 + 0.165 * k, half))
            parts.append(geo.placed(slat, geo.rotation_y(turn)))
        post = geo.placed(plank(size, 0.05, 0.03, 9), geo.rotation_z(90.0), (half - 0.03, half, half - 0.03))
        parts.append(geo.placed(post, geo.rotation_y(turn)))
    parts += [geo.placed(plank(size - 0.04, 0.12, 0.018, k), shift=(0, 0.02, (k - 1.5) * 0.128)) for k in range(4)]
    return geo.joined(parts)


def make_driftwood():
    """planks.glb: planks afloat, a crate on the bed, a log on the beach."""
    afloat = [
        geo.placed(plank(1.45, 0.20, 0.045, 1), geo.rotation_y(24.0) @ geo.rotation_x(2.0), (0.75, 0.018, 0.72)),
        geo.placed(plank(1.15, 0.17, 0.045, 2), geo.rotation_y(-31.0) @ geo.rotation_z(1.5), (0.20, 0.020, 0.05)),
        geo.placed(plank(0.85, 0.22, 0.040, 3), geo.rotation_y(66.0), (2.05, 0.018, -0.35)),
    ]
    y = float(bed_height(-0.55, -1.75)) - 0.02
    box = geo.placed(crate(), geo.rotation_y(31.0) @ geo.rotation_z(-9.0), (-0.55, y, -1.75))
    write_glb(HERE / "planks.glb", {"planks": geo.joined([*afloat, box])})
    t = np.linspace(0.0, 1.0, 16)
    x, z = 0.9 + 1.7 * t, -3.55 + 0.55 * t + 0.08 * np.sin(5 * t)
    log = geo.tube(
        np.stack([x, bed_height(x, z) + 0.05 + 0.10 * t, z], -1), 0.10 - 0.045 * t + 0.008 * np.sin(23 * t), 14
    )
    stub_t = np.linspace(0.0, 1.0, 6)
    start = np.array([x[9], bed_height(x[9], z[9]) + 0.12, z[9]])
    stub = geo.tube(start + stub_t[:, None] * np.array([0.12, 0.34, 0.10]), 0.045 - 0.025 * stub_t, 10)
    write_glb(HERE / "log.glb", {"log": geo.joined([log, stub])})


def make_ropes():
    """ropes.glb: the buoy's line and a net line. floats.glb: the floats on that line."""
    foot = np.array([BUOY[0] + 0.5, bed_height(BUOY[0] + 0.5, BUOY[1] + 0.25) + 0.08, BUOY[1] + 0.25])
    t = np.linspace(0.0, 1.0, 30)[:, None]
    head = np.array([BUOY[0], -0.20, BUOY[1]])
    line = (
        head
        + t * (foot - head)
        + np.array([0.12, 0.0, -0.10]) * np.sin(np.pi * t)
        - [0.0, 0.10, 0.0] * np.sin(np.pi * t)
    )
    u = np.linspace(0.0, 1.0, 90)
    x, z = -3.0 + 2.5 * u, 0.35 + 0.85 * u + 0.28 * np.sin(5.0 * u) + 0.1 * np.sin(13.0 * u)
    net = np.stack([x, 0.012 + 0 * u, z], axis=-1)
    write_glb(HERE / "ropes.glb", {"ropes": geo.joined([geo.tube(line, 0.012, 8), geo.tube(net, 0.010, 7)])})
    balls = []
    for k in range(9):
        at = net[5 + 10 * k]
        theta, phi = np.meshgrid(np.linspace(0, np.pi, 11), np.linspace(0, 2 * np.pi, 19), indexing="ij")
        unit = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], -1)
        body = geo.grid_part(0.062 * unit * [1.0, 0.85, 1.0])
        normals = unit.reshape(-1, 3)
        balls.append(geo.placed((body[0], normals, body[2], body[3][distinct(body)]), shift=at + [0.0, 0.006, 0.0]))
    write_glb(HERE / "floats.glb", {"floats": geo.joined(balls)})


def distinct(part):
    """Which triangles have an area."""
    corners = part[0][part[3]]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) > 1e-12


def make_reef():
    """rocks.glb, and one file for each colour of coral."""
    random = np.random.default_rng(8)
    shapes = {f"rock{n}": geo.boulder((0.42, 0.30, 0.36), 60 + n, 0.24, 16) for n in range(3)}
    large = [(2.55, -1.25, 1.35), (3.05, -0.55, 0.95), (-2.75, -2.10, 1.25), (-2.05, -2.45, 0.8), (1.15, -1.55, 0.75)]
    small = scatter(3, 15, ((-3.4, 3.6), (-3.0, 2.2)), 0.55, lambda x, z: bed_height(x, z) < 0.12)
    rocks = large + [(x, z, random.uniform(0.18, 0.45)) for x, z in small]
    nodes = [
        (
            f"rock{n % 3}",
            geo.matrix(x, bed_height(x, z) + 0.09 * size, z, random.uniform(0, 360), size, random.uniform(-15, 15)),
        )
        for n, (x, z, size) in enumerate(rocks)
    ]
    write_glb(HERE / "rocks.glb", shapes, nodes)

    def plant(name, shapes, places):
        nodes = []
        for n, (x, z, size, lift) in enumerate(places):
            turn = random.uniform(0, 360)
            nodes.append((list(shapes)[n % len(shapes)], geo.matrix(x, bed_height(x, z) + lift, z, turn, size)))
        write_glb(HERE / f"{name}.glb", shapes, nodes)

    horns = {"staghorn0": staghorn(1), "staghorn1": staghorn(5)}
    plant(
        "staghorn",
        horns,
        [(-0.75, 0.45, 1.05, 0.0), (-1.25, 0.75, 0.8, 0.0), (1.95, 0.35, 0.95, 0.0), (2.6, 0.6, 0.7, 0.0)],
    )
    plant("brain", {"brain": brain(4)}, [(0.35, 0.62, 0.9, 0.03), (1.35, -0.45, 1.1, 0.03), (-1.9, 0.1, 0.75, 0.02)])
    plant("table", {"table": table(2)}, [(-0.15, -0.75, 1.1, 0.0), (1.80, 0.70, 0.85, 0.0), (-2.6, -0.9, 1.0, 0.0)])
    plant(
        "sponge",
        {"sponge": sponge(3)},
        [(0.75, -0.35, 1.0, -0.02), (-1.35, -0.15, 0.8, -0.02), (2.4, 1.25, 0.8, -0.02)],
    )
    stars = [(0.95, 1.0, 0.9, 0.004), (-0.25, 0.25, 1.0, 0.006), (0.35, -2.55, 0.9, 0.01)]
    plant("starfish", {"starfish": starfish()}, stars)

    grass = {"grass": geo.tuft(71, 80, 0.45, (0.15, 0.5), (0.007, 0.013), (0.3, 1.0), 5, root=-0.10)}
    spots = scatter(14, 26, ((-5.5, 6.0), (-6.0, -2.5)), 0.55, lambda x, z: shore(x, z) > 1.55)
    write_glb(HERE / "grass.glb", grass, geo.on_ground(list(grass), spots, bed_height, random, (0.8, 1.3)))


def make_bed(width=2048):
    """bed.glb and bed.jpg: pale sand with shell grit, wet along the water's edge."""
    write_glb(HERE / "bed.glb", {"bed": geo.ground(bed_height, X_M, Z_M, 144, 114)})
    x, z = geo.ground_texels(X_M, Z_M, width)
    level = bed_height(x, z)
    fine, broad = fractal2(x, z, 0.07, 3, 51)[..., None], fractal2(x, z, 1.3, 4, 53)[..., None]
    color = np.array([0.90, 0.84, 0.72]) * (1.0 + 0.06 * fine + 0.06 * broad)
    phase = 15.0 * (0.30 * x - 0.95 * z) + 3.0 * noise2(x, z, 0.9, 9)
    trough = (np.abs(np.sin(phase)) ** 3 * step(0.1, -0.6, shore(x, z)))[..., None]
    color = color * (1.0 - 0.13 * trough)
    tints = np.array(
        [(0.70, 0.62, 0.52), (0.95, 0.91, 0.84), (0.62, 0.58, 0.54), (0.84, 0.68, 0.58), (0.93, 0.86, 0.78)]
    )
    for cell, seed, share in ((0.030, 61, 0.30), (0.10, 63, 0.10)):
        cover, owner, rise = pebbles(x, z, cell, seed, share)
        stone = tints[owner % 5] * (0.78 + 0.28 * rise)[..., None]
        color = color * (1.0 - cover[..., None]) + stone * cover[..., None]
    wet = (step(0.10, 0.03, level) * step(-0.25, -0.02, level))[..., None]
    color = color * (1.0 - 0.28 * wet * np.array([0.85, 1.0, 1.15]))
    speck = np.random.default_rng(1).normal(size=level.shape)[..., None] * 0.018
    save_jpg(HERE / "bed.jpg", color + speck, 74)


def make_textures():
    """rock.png, wood.png (both repeat), coral.png (dark foot to pale tip), buoy.png (bands)."""
    grain, patch = periodic(512, 80, 31, 0.02)[..., None], periodic(512, 8, 32)[..., None]
    rock = np.array([0.56, 0.51, 0.46]) * (1.0 + 0.20 * grain + 0.22 * patch)
    crust = np.clip((patch + 0.5 * grain - 0.2) / 0.2, 0.0, 1.0)
    save_png(HERE / "rock.png", rock * (1.0 - 0.5 * crust) + 0.5 * crust * np.array([0.58, 0.46, 0.50]), 48)
    u, v = np.meshgrid((np.arange(512) + 0.5) / 512, (np.arange(512) + 0.5) / 512)
    random, grain = np.random.default_rng(7), np.zeros((512, 512))
    for _ in range(70):
        ku, kv = random.integers(0, 4), random.integers(4, 70)
        grain += np.cos(
            2 * np.pi * (ku * u + kv * v + 0.25 * np.sin(2 * np.pi * (u + random.random())) + random.random())
        )
    wood = np.array([0.62, 0.54, 0.45]) * (1.0 + 0.34 * grain / np.abs(grain).max())[..., None]
    save_png(HERE / "wood.png", wood, 32)
    v = (np.arange(128) + 0.5) / 128  # v = 0 on top: the tip
    tone = 0.50 + 0.42 * (1.0 - v) ** 0.8 + 0.10 * step(0.16, 0.04, v)
    save_png(HERE / "coral.png", np.repeat(np.repeat(tone[:, None, None], 8, 1), 3, 2), 64)
    band = np.where((v > 0.36) & (v < 0.64), 1.0, 0.0)[:, None, None]
    white, red = np.array([0.90, 0.88, 0.84]), np.array([0.78, 0.17, 0.10])
    save_png(HERE / "buoy.png", np.repeat(white * band + red * (1.0 - band), 16, 1), 8)


if __name__ == "__main__":
    make_bed()
    make_driftwood()
    make_ropes()
    make_reef()
    make_textures()
