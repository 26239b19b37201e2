"""Makes the meshes of the scene flooded-colonnade: two rows of columns, the arches above them, walls and ceilings.

    python scenes/flooded-colonnade/make_colonnade.py

World space, metres; y = 0 is the floor, the nave runs along z.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
from procedural import write_glb  # noqa: E402
from procedural_parts import joined, placed  # noqa: E402

NAVE, AISLE, LENGTH = 2.5, 4.6, 6.0  # half widths and half length
BAY, RADIUS, SPRING, TOP, WALL = 2.0, 0.74, 2.3, 3.4, 4.0  # arch spacing and radius, its springing, ceiling, wall's top
THICK = 0.25  # half, of the arcade's wall


def quad(a, b, c, d):
    """A flat quadrilateral, front where a, b, c, d run anticlockwise."""
    points = np.array([a, b, c, d], float)
    normal = np.cross(points[1] - points[0], points[3] - points[0])
    normals = np.tile(normal / np.linalg.norm(normal), (4, 1))
    return points, normals, np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float), np.array([[0, 1, 2], [0, 2, 3]])


def box(low, high):
    """A box: six quads, normals outwards."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return joined(
        [
            quad((x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)),
            quad((x1, y0, z0), (x0, y0, z0), (x0, y1, z0), (x1, y1, z0)),
            quad((x1, y0, z1), (x1, y0, z0), (x1, y1, z0), (x1, y1, z1)),
            quad((x0, y0, z0), (x0, y0, z1), (x0, y1, z1), (x0, y1, z0)),
            quad((x0, y1, z1), (x1, y1, z1), (x1, y1, z0), (x0, y1, z0)),
            quad((x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)),
        ]
    )


def lathe(profile, segments=40):
    """A body of revolution about y from (radius, height) pairs going up, smooth around."""
    r, y = np.array(profile, float).T
    angle = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    parts = []
    for i in range(len(r) - 1):
        slope = np.array([y[i + 1] - y[i], r[i] - r[i + 1]])
        slope /= max(np.linalg.norm(slope), 1e-9)
        rings = [np.stack([q * np.cos(angle), np.full_like(angle, h), -q * np.sin(angle)], 1) for q, h in
                 ((r[i], y[i]), (r[i + 1], y[i + 1]))]  # fmt: skip
        normals = np.stack([slope[0] * np.cos(angle), np.full_like(angle, slope[1]), -slope[0] * np.sin(angle)], 1)
        n, a = segments + 1, np.arange(segments)
        triangles = np.concatenate([np.stack([a, a + 1, a + n], 1), np.stack([a + 1, a + n + 1, a + n], 1)])
        uv = np.stack([np.tile(angle / 6.2832, 2), np.repeat([0.0, 1.0], n)], 1)
        parts.append((np.concatenate(rings), np.concatenate([normals, normals]), uv, triangles))
    return joined(parts)


def column():
    """Base, shaft with entasis, capital: 0 to SPRING."""
    shaft = [(0.19 + 0.03 * np.sin(np.pi * (0.15 + 0.7 * t)) - 0.035 * t, 0.3 + t * 1.7) for t in np.linspace(0, 1, 7)]
    capital = [(0.2, 2.02), (0.2, 2.06), (0.17, 2.08), (0.27, 2.22)]
    turned = lathe([(0.3, 0.12), (0.3, 0.2), (0.25, 0.24), (0.25, 0.28), (shaft[0][0], 0.3), *shaft[1:], *capital])
    plinth = box((-0.32, -0.02, -0.32), (0.32, 0.12, 0.32))
    return joined([plinth, turned, box((-0.3, 2.2, -0.3), (0.3, SPRING, 0.3))])


def arcade():
    """One wall with its arches, in the plane x = 0, from springing to the wall's top; along z over the whole length."""
    parts, steps = [], 24
    bays = round(2 * LENGTH / BAY)
    for bay in range(bays):
        middle, start, end = -LENGTH + (bay + 0.5) * BAY, -LENGTH + bay * BAY, -LENGTH + (bay + 1) * BAY
        angle = np.linspace(np.pi, 0.0, steps + 1)
        line = [(start, SPRING), *zip(middle + RADIUS * np.cos(angle), SPRING + RADIUS * np.sin(angle), strict=True)]
        line.append((end, SPRING))
        for (z0, y0), (z1, y1) in zip(line[:-1], line[1:], strict=True):
            parts.append(quad((THICK, y1, z1), (THICK, y0, z0), (THICK, WALL, z0), (THICK, WALL, z1)))
            parts.append(quad((-THICK, y0, z0), (-THICK, y1, z1), (-THICK, WALL, z1), (-THICK, WALL, z0)))
            parts.append(quad((-THICK, y1, z1), (-THICK, y0, z0), (THICK, y0, z0), (THICK, y1, z1)))
    parts.append(quad((-THICK, WALL, LENGTH), (THICK, WALL, LENGTH), (THICK, WALL, -LENGTH), (-THICK, WALL, -LENGTH)))
    return joined(parts)


def main() -> None:
    columns = [
        placed(column(), shift=(x, 0.0, z)) for x in (-NAVE, NAVE) for z in np.arange(-LENGTH, LENGTH + 0.1, BAY)
    ]
    walls = [placed(arcade(), shift=(x, 0.0, 0.0)) for x in (-NAVE, NAVE)]
    shell = [
        box((-AISLE - 0.2, 0.0, -LENGTH), (-AISLE, TOP, LENGTH)),
        box((AISLE, 0.0, -LENGTH), (AISLE + 0.2, TOP, LENGTH)),
        box((-AISLE - 0.2, 0.0, -LENGTH - 0.2), (AISLE + 0.2, WALL, -LENGTH)),
        box((-AISLE - 0.2, 0.0, LENGTH), (AISLE + 0.2, WALL, LENGTH + 0.2)),
    ]
    ceilings = [box((x0, TOP, -LENGTH), (x1, TOP + 0.15, LENGTH)) for x0, x1 in ((-AISLE, -NAVE), (NAVE, AISLE))]
    write_glb(HERE / "columns.glb", {"columns": joined(columns)})
    write_glb(HERE / "arcades.glb", {"arcades": joined(walls)})
    write_glb(HERE / "shell.glb", {"shell": joined(shell)})
    write_glb(HERE / "ceilings.glb", {"ceilings": joined(ceilings)})


if __name__ == "__main__":
    main()
