"""Mesh parts for the generator scripts: (positions, normals, uv, triangles), joined and placed. NumPy only."""

from __future__ import annotations

import numpy as np


def rotation_y(degrees):
    """(3, 3) rotation about +y, right-handed."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rotation_x(degrees):
    """(3, 3) rotation about +x."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def rotation_z(degrees):
    """(3, 3) rotation about +z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def placed(part, rotate=None, shift=(0.0, 0.0, 0.0), scale=1.0):
    """A mesh part moved: scaled (uniformly), turned by a (3, 3) rotation, shifted."""
    rotate = np.eye(3) if rotate is None else rotate
    positions, normals, uv, triangles = part
    return (positions * scale) @ rotate.T + np.asarray(shift, float), normals @ rotate.T, uv, triangles


def joined(parts):
    """Mesh parts as one."""
    first = np.cumsum([0] + [len(p[0]) for p in parts])
    arrays = [np.concatenate([p[i] for p in parts]) for i in range(3)]
    return (*arrays, np.concatenate([p[3] + start for p, start in zip(parts, first, strict=False)]))


def grid_part(positions, uv=None):
    """A mesh part (positions, normals, uv, triangles) from a lattice (R, C, 3); front where d/dc x d/dr points."""
    rows, columns = positions.shape[:2]
    along_r, along_c = np.gradient(positions, axis=0), np.gradient(positions, axis=1)
    normals = np.cross(along_c, along_r)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    if uv is None:
        c, r = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
        uv = np.stack([c, r], axis=-1)
    j, i = np.meshgrid(np.arange(columns - 1), np.arange(rows - 1))
    a = (i * columns + j).ravel()
    b, c, d = a + 1, a + columns, a + columns + 1
    triangles = np.stack([a, b, c, b, d, c], axis=-1).reshape(-1, 3)
    return positions.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), triangles


def tube(path, radius, sides=10, uv_per_m=1.0):
    """A tube along `path` (N, 3) with radii (N,), both ends closed to a point."""
    path, radius = np.asarray(path, float), np.broadcast_to(np.asarray(radius, float), len(path))
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along[0], [0.31, 0.17, 0.93])
    rings = []
    for t in along:
        side = side - (side @ t) * t
        side /= np.linalg.norm(side)
        angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
        rings.append(np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * np.cross(t, side))
    out = np.array(rings)
    out[:, -1] = out[:, 0]
    rows = path[:, None] + radius[:, None, None] * out
    ends = [np.repeat(path[k][None, None], sides + 1, axis=1) for k in (0, -1)]
    lattice = np.concatenate([ends[0], rows, ends[1]])
    length = np.concatenate([[0.0, 0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    length = np.concatenate([length, length[-1:]]) * uv_per_m
    u, v = np.meshgrid(np.linspace(0, 1, sides + 1), length)
    positions, _, uv, triangles = grid_part(lattice, np.stack([u, v], axis=-1))
    normals = np.concatenate([-along[:1].repeat(sides + 1, 0)[None], out, along[-1:].repeat(sides + 1, 0)[None]])
    corners = positions[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return positions, normals.reshape(-1, 3), uv, triangles[area > 1e-12]


def board(corners_low, corners_high):
    """A solid between two lattices (R, C, 3) of equal shape, faces flat across its edges."""
    low, high = np.asarray(corners_low, float), np.asarray(corners_high, float)
    parts = [grid_part(high), grid_part(low[:, ::-1])]
    for a, b in ((low[0], high[0]), (high[-1], low[-1]), (high[:, 0], low[:, 0]), (low[:, -1], high[:, -1])):
        parts.append(grid_part(np.stack([a, b])))
    return joined([along_uv(p) for p in parts])


def along_uv(part):
    """The part with texture coordinates in metres: u along its longest axis, v across."""
    positions = part[0]
    axis = int(np.argmax(np.ptp(positions, axis=0)))
    others = [k for k in range(3) if k != axis]
    across = max(others, key=lambda k: np.ptp(positions[:, k]))
    uv = np.stack([positions[:, axis], positions[:, across]], axis=1)
    return part[0], part[1], uv, part[3]


def boulder(radii, seed, roughness=0.18, detail=22):
    """A stone: a lattice sphere pushed about by noise and flattened by a few planes."""
    random = np.random.default_rng(seed)
    theta, phi = np.linspace(0.0, np.pi, detail), np.linspace(0.0, 2.0 * np.pi, 2 * detail + 1)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=-1)
    unit[:, -1] = unit[:, 0]
    r = np.ones(t.shape)
    for _ in range(9):
        way = random.normal(size=3)
        way /= np.linalg.norm(way)
        height = unit @ way
        r = np.where(height * r > 0.72, 0.72 / np.maximum(height, 1e-6) * 0.35 + r * 0.65, r)
    for n in range(5):
        way, phase = random.normal(size=3) * 1.7**n, random.uniform(0, 6.28)
        r = r + roughness / 1.6**n * np.sin(1.6 * unit @ way + phase) * 0.5
    lattice = unit * r[..., None] * np.asarray(radii)
    lattice[0], lattice[-1] = lattice[0].mean(0), lattice[-1].mean(0)
    lattice[:, -1] = lattice[:, 0]
    uv = np.stack([p / (2.0 * np.pi) * 3.0, t / np.pi * 1.5], axis=-1)
    positions, _, uv, triangles = grid_part(lattice, uv)
    corners = positions[triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    keep = np.linalg.norm(face, axis=1) > 1e-12
    _, same = np.unique(positions.round(9), axis=0, return_inverse=True)
    same = same.reshape(-1)
    total = np.zeros((same.max() + 1, 3))
    for k in range(3):
        np.add.at(total, same[triangles[:, k]], face)
    normals = total[same]
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return positions, normals, uv, triangles[keep]


def upward(part):
    """The part with its front on top."""
    positions, normals, uv, triangles = part
    return (positions, -normals, uv, triangles[:, ::-1]) if normals[:, 1].mean() < 0.0 else part


def ground(height, x_m, z_m, columns, rows):
    """The part over a rectangle at y = height(x, z), its texture stretched once over it. x_m, z_m: (low, high)."""
    x, z = np.meshgrid(np.linspace(*x_m, columns), np.linspace(*z_m, rows))
    uv = np.stack([(x - x_m[0]) / (x_m[1] - x_m[0]), (z - z_m[0]) / (z_m[1] - z_m[0])], axis=-1)
    return upward(grid_part(np.stack([x, height(x, z), z], axis=-1), uv))


def ground_texels(x_m, z_m, width):
    """x and z (H, W), metres, of the texels of a texture `width` texels wide for `ground`."""
    height = int(width * (z_m[1] - z_m[0]) / (x_m[1] - x_m[0]))
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    return x_m[0] + u * (x_m[1] - x_m[0]), z_m[0] + v * (z_m[1] - z_m[0])


def ribbon(random, length, width, bend, lean, rows):
    """A blade from the origin upwards: (positions, normals, uv, triangles), bent over towards `lean` (radians)."""
    t = np.linspace(0.0, 1.0, rows)
    sway = 0.045 * length * np.sin(2.0 * np.pi * (t * random.uniform(0.6, 1.3) + random.random())) * t
    out = bend * length * t**1.8 + sway
    height = length * (t - 0.28 * bend * t**2.5)
    twist = random.uniform(0.0, np.pi) + random.uniform(-1.2, 1.2) * t
    half = 0.5 * width * (1.0 - 0.85 * t**4)
    centre = np.stack([np.cos(lean) * out, height, np.sin(lean) * out], axis=-1)
    side = np.stack([np.cos(twist), 0.0 * t, np.sin(twist)], axis=-1) * half[:, None]
    u = np.broadcast_to((random.integers(0, 4) + np.array([0.06, 0.94])) / 4.0, (rows, 2))
    return grid_part(
        np.stack([centre - side, centre + side], axis=1), np.stack([u, np.repeat(1 - t[:, None], 2, 1)], axis=-1)
    )


def tuft(seed, count, radius, lengths, widths, bend, rows, root=-0.14):
    """Many blades around the origin, taller in the middle."""
    random = np.random.default_rng(seed)
    blades = []
    for _ in range(count):
        r, a = radius * np.sqrt(random.random()), random.uniform(0, 2 * np.pi)
        tall = random.uniform(*lengths) * (1.0 - 0.35 * (r / radius) ** 2)
        lean = 0.5 + random.normal() * 0.9
        blade = ribbon(random, tall - root, random.uniform(*widths), random.uniform(*bend), lean, rows)
        blades.append(placed(blade, shift=(r * np.cos(a), root, r * np.sin(a))))
    return joined(blades)


def on_ground(names, spots, height, random, sizes):
    """Nodes of the named parts in turn at (x, z) spots of a ground y = height(x, z), turned and, in (low, high), sized
    at random.
    """
    return [
        (names[n % len(names)], matrix(x, height(x, z), z, random.uniform(0, 360), random.uniform(*sizes)))
        for n, (x, z) in enumerate(spots)
    ]


def matrix(x, y, z, turn=0.0, scale=1.0, tilt=0.0):
    """World from object, 4x4: scaled, tilted about x, turned about y (degrees), shifted."""
    out = np.eye(4)
    out[:3, :3] = rotation_y(turn) @ rotation_x(tilt) * scale
    out[:3, 3] = x, y, z
    return out
