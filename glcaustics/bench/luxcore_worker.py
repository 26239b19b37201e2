"""LuxCore's LIGHTCPU on one scene, in a process of its own: `python -m glcaustics.bench.luxcore_worker IN.npz OUT.npz`.

A process of its own because pyluxcore does not shut down cleanly: the process ends with `os._exit`.
IN has `seconds` (K,), `pixels`, `albedo`, `eye`, `fov_deg`, `sun_direction`, `sun`, `ior`, `depth`, and `points`,
`triangles`, `normals` of `water` and `floor`. OUT has `images` (K, H, W), radiance, row 0 at -z; `seconds` and
`samples`, each (K,); `setup`, seconds.
"""

from __future__ import annotations

import importlib
import os
import sys
import time
from typing import Any

import numpy as np


def _mesh(scene: Any, name: str, given: Any) -> None:
    points, normals, faces = (given[f"{name}_{part}"] for part in ("points", "normals", "triangles"))
    rows = [[tuple(map(kind, r)) for r in a] for a, kind in ((points, float), (faces, int), (normals, float))]
    scene.DefineMesh(name, rows[0], rows[1], rows[2], None, None, None)


def _properties(lux: Any, values: dict[str, Any]) -> Any:
    made = lux.Properties()
    for key, value in values.items():
        made.Set(lux.Property(key, value))
    return made


def _scene(lux: Any, given: Any) -> Any:
    scene = lux.Scene()
    for name in ("water", "floor"):
        _mesh(scene, name, given)
    eye = [float(c) for c in given["eye"]]
    albedo = float(given["albedo"])
    values: dict[str, Any] = {
        "scene.camera.type": "perspective",
        "scene.camera.lookat.orig": eye,
        "scene.camera.lookat.target": [eye[0], eye[1] - 1.0, eye[2]],
        "scene.camera.up": [0.0, 0.0, -1.0],
        "scene.camera.fieldofview": float(given["fov_deg"]),
        "scene.camera.screenwindow": [-1.0, 1.0, -1.0, 1.0],
        "scene.camera.autofocus.enable": False,
        "scene.camera.cliphither": 1e-3,
        "scene.lights.sun.type": "sharpdistant",
        "scene.lights.sun.direction": [float(c) for c in given["sun_direction"]],
        "scene.lights.sun.color": [1.0, 1.0, 1.0],
        "scene.lights.sun.gain": [float(given["sun"])] * 3,
        "scene.materials.glass.type": "glass",
        "scene.materials.glass.kr": [1.0, 1.0, 1.0],
        "scene.materials.glass.kt": [1.0, 1.0, 1.0],
        "scene.materials.glass.interiorior": float(given["ior"]),
        "scene.materials.glass.exteriorior": 1.0,
        "scene.materials.grey.type": "matte",
        "scene.materials.grey.kd": [albedo] * 3,
    }
    for name, material in (("water", "glass"), ("floor", "grey")):
        values[f"scene.objects.{name}.shape"] = name
        values[f"scene.objects.{name}.material"] = material
    scene.Parse(_properties(lux, values))
    return scene


def _config(lux: Any, given: Any) -> Any:
    pixels, depth = int(given["pixels"]), int(given["depth"])
    values = {
        "renderengine.type": "LIGHTCPU",
        "sampler.type": "RANDOM",
        "renderengine.seed": 7,
        "native.threads.count": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "film.width": pixels,
        "film.height": pixels,
        "film.filter.type": "NONE",
        "film.outputs.0.type": "RGB",
        "film.outputs.0.filename": "unused.exr",
        "film.imagepipelines.0.0.type": "NOP",
        "path.maxdepth": depth,
        "light.maxdepth": depth,
        "light.russianroulette.depth": 1000,
    }
    return _properties(lux, values)


def main(source: str, destination: str) -> None:
    """Render, keeping a picture at each of the budgets."""
    born = time.perf_counter()
    lux = importlib.import_module("pyluxcore")
    given = np.load(source)
    lux.Init()
    session = lux.RenderSession(lux.RenderConfig(_config(lux, given), _scene(lux, given)))
    pixels = int(given["pixels"])
    images, spent, samples = [], [], []
    session.Start()
    begin = time.perf_counter()
    for budget in given["seconds"]:
        time.sleep(max(0.0, begin + float(budget) - time.perf_counter()))
        session.UpdateStats()
        image = np.zeros((pixels, pixels, 3), np.float32)
        session.GetFilm().GetOutputFloat(lux.FilmOutputType.RGB, image, 0)
        spent.append(time.perf_counter() - begin)
        samples.append(session.GetStats().Get("stats.renderengine.pass").GetFloat() * pixels**2)
        # LuxCore's first row is the lowest; splatted pictures lie one row too low
        images.append(np.roll(image[::-1, :, 1], -1, axis=0))
    session.Stop()
    np.savez(destination, images=np.asarray(images), seconds=spent, samples=samples, setup=begin - born)
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
