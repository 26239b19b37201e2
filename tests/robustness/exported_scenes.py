"""Glass as modellers export it, written as .glb files: each once showed a fault (see test_exported_scenes)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from glcaustics.scene import mesh_tools
from tests.unit.glb_builder import GLASS, WHITE, build_glb, plane

SUN = {"type": "directional", "intensity": 1.0, "name": "sun"}
LOOK_DOWN = [-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]  # quaternion: -z becomes -y
Part = dict[str, Any]


def lathe(profile: list[tuple[float, float]], sides: int = 48) -> Part:
    """A solid of revolution round y: (radius, height) from axis to axis along its outline; smooth up to 40 degrees."""
    outline, turn = np.asarray(profile), np.arange(sides) * 2.0 * np.pi / sides
    ring = np.stack((np.cos(turn), np.zeros(sides), -np.sin(turn)), 1)
    points = (outline[:, None, :1] * ring + outline[:, None, 1:] * (0.0, 1.0, 0.0)).reshape(-1, 3)
    row, column = np.meshgrid(np.arange(len(outline) - 1), np.arange(sides), indexing="ij")
    a, b = row * sides + column, row * sides + (column + 1) % sides
    quads = np.stack((a, b, b + sides, a, b + sides, a + sides), -1).reshape(-1, 3)
    triangles = quads[mesh_tools.nondegenerate(points, quads)]
    if mesh_tools.signed_volume(points, triangles) < 0.0:
        triangles = triangles[:, ::-1]
    split = mesh_tools.crease_normals(points, triangles, labels=mesh_tools.weld(points))
    return {"positions": points[split.source], "normals": split.normals, "indices": split.triangles, "material": 0}


def ball(radius_m: float, sides: int = 48) -> Part:
    angle = np.linspace(0.0, np.pi, sides // 2 + 1)
    outline = np.stack((radius_m * np.abs(np.sin(angle)), -radius_m * np.cos(angle)), 1)
    outline[[0, -1], 0] = 0.0
    return lathe([(float(r), float(y)) for r, y in outline], sides)


def knot(tube_m: float = 0.11, rings: int = 192, sides: int = 24) -> Part:
    """A trefoil of glass, some 0.7 m wide: in most places light meets several of its turns."""

    def centre(t: np.ndarray) -> np.ndarray:
        ring = 0.5 + 0.22 * np.cos(3 * t)
        return np.stack((ring * np.cos(2 * t), 0.22 * np.sin(3 * t), ring * np.sin(2 * t)), -1)

    t, v = np.arange(rings) * 2 * np.pi / rings, np.arange(sides) * 2 * np.pi / sides
    ahead = centre(t + 1e-4) - centre(t - 1e-4)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    out = centre(t) * (1.0, 0.0, 1.0)
    out -= ahead * np.einsum("ij,ij->i", out, ahead)[:, None]
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    side = np.cross(ahead, out)
    normals = out[:, None] * np.cos(v)[:, None] + side[:, None] * np.sin(v)[:, None]
    points = centre(t)[:, None] + tube_m * normals
    i, j = np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")
    at = [((i + a) % rings) * sides + (j + b) % sides for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    quads = np.stack((at[0], at[1], at[2], at[0], at[2], at[3]), -1).reshape(-1, 3)
    return {"positions": points.reshape(-1, 3), "normals": normals.reshape(-1, 3), "indices": quads, "material": 0}


def tumbler() -> Part:
    """A drinking glass: one closed mesh with an inner wall."""
    outer = [(0.0, 0.0), (0.28, 0.0), (0.30, 0.02), (0.34, 0.4), (0.40, 0.9)]
    return lathe([*outer, (0.37, 0.9), (0.31, 0.4), (0.27, 0.1), (0.25, 0.07), (0.0, 0.07)])


def sheet(half_m: float) -> Part:
    return {**plane(half_m), "material": 0}


def holed(part: Part, missing: int = 3) -> Part:
    return {**part, "indices": np.delete(part["indices"], np.arange(200, 200 + missing), axis=0)}


def turned(axis: str, degrees: float) -> list[float]:
    """A quaternion (x, y, z, w)."""
    half = math.radians(degrees) / 2.0
    return [math.sin(half) * (a == axis) for a in "xyz"] + [math.cos(half)]


def write(path: Path, *placed: tuple[Part, dict[str, Any]], sun_rotation: list[float] | None = None) -> Path:
    """Parts with their nodes over a floor of 6 m of two triangles, under one sun straight from above or turned."""
    parts = [part for part, _ in placed] + [{**plane(3.0), "material": 1}]
    nodes: list[dict[str, Any]] = [{"mesh": n, **node} for n, (_, node) in enumerate(placed)]
    nodes.append({"mesh": len(placed)})
    rotation = sun_rotation or LOOK_DOWN
    nodes.append({"extensions": {"KHR_lights_punctual": {"light": 0}}, "rotation": rotation})
    return build_glb(path, parts, materials=[GLASS, WHITE], lights=[SUN], nodes=nodes)


SLANTED = [-0.5417, -0.2593, -0.1795, 0.7789]  # the sun's, some 30 degrees off the vertical
EXPORTED = {
    "tumbler on a floor": lambda path: write(path, (tumbler(), {}), sun_rotation=SLANTED),
    "tilted sheet": lambda path: write(path, (sheet(0.7), {"rotation": turned("z", 35.0), "translation": [0, 1, 0]})),
    "ball sunk into the floor": lambda path: write(path, (ball(0.5), {"translation": [0.0, 0.1, 0.0]})),
    "ball in a ball's light": lambda path: write(
        path, (ball(0.4), {"translation": [0.1, 1.5, 0.0]}), (ball(0.35), {"translation": [0.0, 0.5, 0.0]})
    ),
    "knot": lambda path: write(path, (knot(), {"translation": [0.0, 0.5, 0.0]}), sun_rotation=SLANTED),
    "ball with a hole": lambda path: write(path, (holed(ball(0.4)), {"translation": [0.0, 0.6, 0.0]})),
    "mirrored, squeezed ball": lambda path: write(
        path, (ball(0.4), {"translation": [0.0, 0.6, 0.0], "scale": [-1.0, 0.5, 1.0]}), sun_rotation=SLANTED
    ),
}
