"""LuxCore's light tracer (LIGHTCPU) as a peer, for the pool alone: its sun shines straight down one interface."""

from __future__ import annotations

import importlib.util
import math
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.measure import summary
from glcaustics.bench.scene_export import world_normals
from glcaustics.bench.targets import Target, casters, luminance
from glcaustics.errors import UsageError
from glcaustics.passes.view_math import unit
from glcaustics.scene.model import Scene

FloatArray = npt.NDArray[np.float64]
SCENES = ("pool",)
ALBEDO = 1e-3
MARGIN_M = 0.5  # of water beyond the straight refracted path, for its waves' slopes and for light that slips under it
DEPTH = 3
BORDER = 2  # film pixels on every side of the target: LuxCore's light tracer loses a row at the film's edge


def has_luxcore() -> bool:
    """Whether pyluxcore is installed."""
    return importlib.util.find_spec("pyluxcore") is not None


def luxcore_scene(scene: Scene, target: Target, pixels: int) -> dict[str, Any]:
    """What the worker needs, but for the seconds. `pixels`: of the target's side; the film gets `BORDER` more around.

    In LuxCore's favour only the water that light on its way to the target meets is kept, and of the floor the target:
    its `sharpdistant` light spreads photons over the whole scene's bounding sphere. Nothing opaque stands in the way.
    """
    light, water = scene.lights[0], casters(scene)[0]
    d = unit(light.direction_ws)
    points, faces = water.positions_ws(), water.mesh.triangles
    depth_m = float(points[:, 1].mean()) - target.centre_ws[1]
    sideways = d[[0, 2]] / water.material.ior
    shift = sideways / math.sqrt(1.0 - float(sideways @ sideways)) * depth_m
    away = np.abs(points[:, [0, 2]] + shift - np.asarray(target.centre_ws)[[0, 2]]).max(axis=1)
    kept = faces[(away[faces] < target.half_m + MARGIN_M).all(axis=1)]
    used, renumbered = np.unique(kept, return_inverse=True)
    seen_m = target.half_m * (1.0 + 2.0 * BORDER / pixels)
    x, z = replace(target, half_m=seen_m).edges_m(1)
    floor = np.array([(a, target.centre_ws[1], b) for a, b in ((x[0], z[0]), (x[0], z[1]), (x[1], z[1]), (x[1], z[0]))])
    height_m = target.pinhole_ws[1] - target.centre_ws[1]
    return {
        "water_points": points[used],
        "water_normals": world_normals(water)[used],
        "water_triangles": renumbered.reshape(-1, 3),
        "floor_points": floor,
        "floor_normals": np.tile((0.0, 1.0, 0.0), (4, 1)),
        "floor_triangles": np.array([(0, 1, 2), (0, 2, 3)]),
        "sun_direction": d,
        "sun": light.intensity * float(luminance(np.asarray(light.color))),
        "ior": water.material.ior,
        "eye": target.pinhole_ws,
        "fov_deg": 2.0 * math.degrees(math.atan(seen_m / height_m)),
        "pixels": pixels + 2 * BORDER,
        "albedo": ALBEDO,
        "depth": DEPTH,
    }


def luxcore_rows(
    scene: Scene, target: Target, pixels: int, seconds: tuple[float, ...]
) -> tuple[list[dict[str, Any]], list[FloatArray]]:
    """Rows without their errors, and irradiance maps (H, W), after each of `seconds` of one run.

    Raises:
        UsageError: pyluxcore does not run.
    """
    given = luxcore_scene(scene, target, pixels) | {"seconds": seconds}
    with tempfile.TemporaryDirectory() as folder:
        source, destination = Path(folder) / "in.npz", Path(folder) / "out.npz"
        np.savez(source, **given)
        command = [sys.executable, "-m", "glcaustics.bench.luxcore_worker", str(source), str(destination)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=60.0 + max(seconds), check=False)
        except subprocess.TimeoutExpired:
            raise UsageError("LuxCore did not end in time", where="bench", remedy="pip uninstall pyluxcore") from None
        if done.returncode or not destination.exists():
            reason = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
            raise UsageError(f"LuxCore does not run: {reason}", where="bench", remedy="pip uninstall pyluxcore")
        out = dict(np.load(destination))
    inside = slice(BORDER, BORDER + pixels)
    images = [np.asarray(image[inside, inside], np.float64) * (math.pi / ALBEDO) for image in out["images"]]
    rows = [
        {
            "scene": scene.name,
            "tool": "luxcore",
            "method": "LIGHTCPU",
            "quality": f"{budget:g} s",
            "pixels": pixels,
            "samples": float(samples),
            "time_ms": summary([1e3 * float(spent)], "wall clock"),
            "first_frame_ms": 1e3 * float(out["setup"]),
        }
        for budget, spent, samples in zip(seconds, out["seconds"], out["samples"], strict=True)
    ]
    return rows, images
