"""Makes bunny.ply: a watertight sitting bunny, 0.2 m tall, from an implicit surface. Needs NumPy and Pillow.

    python scenes/glass-bunny/make_bunny.py

The shape is a smooth union of ellipsoids and tapered capsules; it is meshed by surface nets (Gibson 1998), its vertices
are pulled onto the surface, and its normals are the field's gradient.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from procedural import capsule, ellipsoid, polygonise, smooth_max, smooth_min, write_ply  # noqa: E402

CELLS_ALONG_HEIGHT = 90
HEIGHT_M = 0.2
LOW, HIGH = np.array([-0.68, -0.06, -1.0]), np.array([0.68, 2.12, 0.85])  # model space: the figure is 2 units tall


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


def main():
    step = (HIGH[1] - LOW[1]) / CELLS_ALONG_HEIGHT
    vertices, normals, triangles = polygonise(field, LOW, HIGH, step)
    scale = HEIGHT_M / (vertices[:, 1].max() - vertices[:, 1].min())
    vertices = (vertices - [0.0, vertices[:, 1].min(), 0.0]) * scale
    comment = "MIT, made by make_bunny.py of glcaustics"
    write_ply(Path(__file__).with_name("bunny.ply"), vertices, normals, triangles, comment)
    print(f"{len(vertices)} vertices, {len(triangles)} triangles")


if __name__ == "__main__":
    main()
