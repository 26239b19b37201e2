"""What is varied alone to see how run time grows: pixels, light samples, triangles of the caster."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from glcaustics.bench.measure import Case
from glcaustics.bench.targets import bench_scene, casters, target_of
from glcaustics.caustics.registry import METHODS
from glcaustics.optics.beams import peer_pool_field
from glcaustics.scene.model import Instance, Mesh, Scene

SAMPLE_SIDES = ("caster_size", "photons_per_side")  # options whose square is the number of light samples
QUALITY = "medium"


def scaling_cases(name: str, methods: tuple[str, ...], *, quick: bool, backend: str) -> list[tuple[str, float, Case]]:
    """(what, its value, case); in each series one thing grows and the rest is as in `medium`."""
    scene, target = bench_scene(name), target_of(name)
    sides = (64, 128, 256) if quick else (128, 256, 512, 1024)
    samples = (64, 128, 256) if quick else (64, 128, 256, 512)
    meshes = (32, 64, 128) if quick else (32, 64, 128, 256, 512)
    found: list[tuple[str, float, Case]] = []
    for method in methods:
        found += [
            ("time against pixels", side**2, Case(scene, target, method, QUALITY, side, backend)) for side in sides
        ]
        if option := samples_option(method):
            found += [
                ("time against light samples", n**2, Case(scene, target, method, QUALITY, 128, backend, {option: n}))
                for n in samples
            ]
        if name == "peer-pool":
            found += [
                ("time against caster triangles", 2 * n**2, Case(wavy(scene, n), target, method, QUALITY, 128, backend))
                for n in meshes
            ]
    return found


def samples_option(method: str) -> str | None:
    """The option that sets a method's number of light samples; None if it has none that is known here."""
    return next((name for name in SAMPLE_SIDES if name in METHODS[method].ladder[QUALITY]), None)


def wavy(scene: Scene, cells: int) -> Scene:
    """`peer-pool` with its water as a mesh of `cells` x `cells` squares."""
    water = casters(scene)[0]
    span = np.linspace(-1.0, 1.0, cells + 1)
    x, z = np.meshgrid(span, span)
    field = peer_pool_field(1.0)
    slope_x, slope_z = field.gradient(x, z)
    points = np.stack([x, field.height_m(x, z), z], axis=-1).reshape(-1, 3)
    normals = np.stack([-slope_x, np.ones_like(x), -slope_z], axis=-1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(cells), np.arange(cells)))
    a = j * (cells + 1) + i
    b, c, d = a + 1, a + cells + 1, a + cells + 2
    triangles = np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)]).astype(np.uint32)
    uv = np.stack([x, z], axis=-1).reshape(-1, 2).astype(np.float32)
    mesh = Mesh("water", points.astype(np.float32), normals.astype(np.float32), uv, triangles, False)
    others = tuple(i for i in scene.instances if i is not water)
    return replace(scene, instances=(*others, Instance("water", mesh, water.material, water.world_from_object)))
