"""Makes bunny.ply: a watertight sitting bunny, 0.2 m tall, from an implicit surface. Needs NumPy only.

    python scenes/glass-bunny/make_bunny.py

The shape is a smooth union of ellipsoids and tapered capsules; it is meshed by surface nets (Gibson 1998), its vertices
are pulled onto the surface, and its normals are the field's gradient.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

CELLS_ALONG_HEIGHT = 90
HEIGHT_M = 0.2
LOW, HIGH = np.array([-0.68, -0.06, -1.0]), np.array([0.68, 2.12, 0.85])  # model space: the figure is 2 units tall


def ellipsoid(p, centre, radii):
    """Bound on the signed distance to an ellipsoid, exact enough near the surface (Quilez' form)."""
    q = (p - np.array(centre)) / radii
    k0 = np.linalg.norm(q, axis=-1)
    k1 = np.linalg.norm(q / radii, axis=-1)
    return np.where(k1 > 1e-9, k0 * (k0 - 1.0) / np.maximum(k1, 1e-9), -min(radii))


def capsule(p, a, b, ra, rb, flat=None):
    """Tapered capsule from a to b; `flat` = (axis vector, factor) squeezes it along that axis."""
    a, b = np.array(a), np.array(b)
    q, shrink = p - a, 1.0
    if flat is not None:
        axis, factor = np.array(flat[0]) / np.linalg.norm(flat[0]), flat[1]
        q = q + (q @ axis)[..., None] * axis * (1.0 / factor - 1.0)
        shrink = factor
    t = np.clip((q @ (b - a)) / ((b - a) @ (b - a)), 0.0, 1.0)
    swell = ra + (rb - ra) * t + 0.055 * np.sin(np.pi * t)
    return (np.linalg.norm(q - t[..., None] * (b - a), axis=-1) - swell) * (0.5 + 0.5 * shrink)


def smooth_min(a, b, k):
    """Polynomial smooth minimum with a blend of width k (twice differentiable in the blend's inside)."""
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - h * h * h * k / 6.0


def field(p):
    """Implicit function (...,), negative inside; the bunny looks along +z, stands on y = 0."""
    body = ellipsoid(p, (0.0, 0.56, -0.22), (0.47, 0.50, 0.52))
    chest = ellipsoid(p, (0.0, 0.62, 0.14), (0.34, 0.40, 0.30))
    d = smooth_min(body, chest, 0.25)
    head = ellipsoid(p, (0.0, 1.16, 0.32), (0.31, 0.28, 0.33))
    muzzle = ellipsoid(p, (0.0, 1.07, 0.56), (0.17, 0.14, 0.15))
    d = smooth_min(d, smooth_min(head, muzzle, 0.15), 0.16)
    mirrored = np.array(p)
    mirrored[..., 0] = np.sqrt(p[..., 0] ** 2 + 0.05**2)  # |x| without a crease where the two sides meet
    ear = capsule(mirrored, (0.13, 1.34, 0.20), (0.25, 1.88, -0.06), 0.09, 0.075, ((0.25, 0.3, 1.0), 0.60))
    d = smooth_min(d, ear, 0.16)
    thigh = ellipsoid(mirrored, (0.36, 0.36, -0.22), (0.20, 0.32, 0.34))
    d = smooth_min(d, thigh, 0.12)
    hind = ellipsoid(mirrored, (0.41, 0.11, 0.0), (0.125, 0.11, 0.28))
    d = smooth_min(d, hind, 0.16)
    fore = capsule(mirrored, (0.15, 0.46, 0.28), (0.15, 0.10, 0.38), 0.10, 0.08)
    paw = ellipsoid(mirrored, (0.15, 0.09, 0.46), (0.11, 0.09, 0.17))
    d = smooth_min(d, smooth_min(fore, paw, 0.12), 0.16)
    tail = ellipsoid(p, (0.0, 0.34, -0.74), (0.16, 0.16, 0.15))
    d = smooth_min(d, tail, 0.10)
    return smooth_max(d, -p[..., 1], 0.04)  # a flat sole to stand on


def smooth_max(a, b, k):
    return -smooth_min(-a, -b, k)


def gradient(p, h=1e-4):
    """Gradient (N, 3) of the field by central differences."""
    steps = np.eye(3) * h
    return np.stack([field(p + s) - field(p - s) for s in steps], axis=-1) / (2.0 * h)


def surface_nets(values, low, step):
    """One vertex a mixed cell, at the mean of its edge crossings; one quad a crossed edge, cut into two triangles."""
    nx, ny, nz = values.shape
    inside = values < 0.0
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]

    def at(array, c):
        return array[c[0] : nx - 1 + c[0], c[1] : ny - 1 + c[1], c[2] : nz - 1 + c[2]]

    count = sum(at(inside, c).astype(int) for c in corners)
    mixed = (count > 0) & (count < 8)
    number = np.full(mixed.shape, -1)
    number[mixed] = np.arange(mixed.sum())
    total, hits = np.zeros((mixed.sum(), 3)), np.zeros(mixed.sum())
    for a in corners:
        for axis in range(3):
            if a[axis]:
                continue
            b = tuple(1 if n == axis else a[n] for n in range(3))
            va, vb = at(values, a)[mixed], at(values, b)[mixed]
            cross = (va < 0) != (vb < 0)
            t = np.where(cross, va / np.where(cross, va - vb, 1.0), 0.0)
            total[cross] += (np.array(a, float) + np.eye(3)[axis] * t[:, None])[cross]
            hits += cross
    vertices = low + step * (np.argwhere(mixed) + total / hits[:, None])
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        first, second = np.moveaxis(inside, axis, 0)[:-1], np.moveaxis(inside, axis, 0)[1:]
        where = np.argwhere(first != second)
        entering = second[tuple(where.T)]  # the solid lies on the far side of the edge
        other = [n for n in range(3) if n != axis]
        cell = np.zeros((len(where), 3), int)
        cell[:, axis], cell[:, other[0]], cell[:, other[1]] = where.T
        quad = []
        for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
            neighbour = cell.copy()
            neighbour[:, u] -= du
            neighbour[:, v] -= dv
            quad.append(number[tuple(neighbour.T)])
        quad = np.stack(quad, axis=1)
        quad[entering] = quad[entering][:, ::-1]
        quads.append(quad)
    return vertices, np.concatenate(quads)


def split_quads(vertices, quads):
    """Cut each quad along its shorter diagonal."""
    a, b, c, d = (vertices[quads[:, i]] for i in range(4))
    short = np.linalg.norm(a - c, axis=1) <= np.linalg.norm(b - d, axis=1)
    ac, bd = quads[short], quads[~short]
    parts = [ac[:, [0, 1, 2]], ac[:, [0, 2, 3]], bd[:, [0, 1, 3]], bd[:, [1, 2, 3]]]
    return np.concatenate(parts)


def write_ply(path, vertices, normals, triangles):
    """Binary little-endian PLY with normals."""
    head = "ply\nformat binary_little_endian 1.0\ncomment MIT, made by make_bunny.py of glcaustics\n"
    head += f"element vertex {len(vertices)}\n" + "".join(f"property float {n}\n" for n in "x y z nx ny nz".split())
    head += f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = np.empty(len(triangles), dtype=[("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, triangles
    data = np.concatenate([vertices, normals], axis=1).astype("<f4")
    path.write_bytes(head.encode("ascii") + data.tobytes() + faces.tobytes())


def main():
    step = (HIGH[1] - LOW[1]) / CELLS_ALONG_HEIGHT
    counts = np.ceil((HIGH - LOW) / step).astype(int) + 1
    axes = [LOW[i] + step * np.arange(counts[i]) for i in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    vertices, quads = surface_nets(field(grid), LOW, step)
    for _ in range(6):  # Newton steps along the gradient, short ones so that neighbours keep their order
        slope = gradient(vertices)
        move = -field(vertices)[:, None] * slope / np.maximum((slope * slope).sum(axis=1, keepdims=True), 1e-6)
        length = np.linalg.norm(move, axis=1, keepdims=True)
        vertices = vertices + move * np.minimum(1.0, 0.3 * step / np.maximum(length, 1e-12))
    triangles = split_quads(vertices, quads)
    normals = gradient(vertices)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    scale = HEIGHT_M / (vertices[:, 1].max() - vertices[:, 1].min())
    vertices = (vertices - [0.0, vertices[:, 1].min(), 0.0]) * scale
    write_ply(Path(__file__).with_name("bunny.ply"), vertices, normals, triangles)
    print(f"{len(vertices)} vertices, {len(triangles)} triangles")


if __name__ == "__main__":
    main()
