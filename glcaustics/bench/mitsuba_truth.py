"""Irradiance by Mitsuba's `ptracer`: a pinhole over the receiver, E = pi L / albedo.

The receivers get a tiny albedo, so that light that bounces from them a second time does not count (the share is the
albedo itself); the direct light is taken off by a render of depth 2 with the same seed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.mitsuba_camera import film, look
from glcaustics.bench.mitsuba_lights import aimed_lights
from glcaustics.bench.mitsuba_shapes import shapes
from glcaustics.bench.mitsuba_variant import best_variant, mitsuba
from glcaustics.bench.scene_export import beam_scene
from glcaustics.bench.store import Store, digest, scene_key
from glcaustics.bench.targets import Target, casters, luminance
from glcaustics.errors import UsageError
from glcaustics.optics.raycast import RayCaster
from glcaustics.scene.model import LightKind, Scene

FloatArray = npt.NDArray[np.float64]
ALBEDO = 1e-3
MITSUBA_VERSION = 3  # of the cache: raise it when this module's results change
SAMPLES_PER_PASS = 256  # per pixel; more in one pass loses digits in the film's float32
PHOTONS_PER_PASS = 1 << 18  # at least, or small films would take many passes
SEED_STRIDE = 1_000_003
HALF_M = 20.0  # of the target as Mitsuba gets it: it starts rays 0.1 mm off surfaces, and more the farther out


@dataclass(frozen=True, eq=False)
class Halves:
    """Two independent estimates of one image; the truth is their mean.

    `first`, `second`: (H, W) float64 luminance of irradiance. `seconds`: what they took; 0 from a cache.
    """

    first: FloatArray
    second: FloatArray
    seconds: float = 0.0
    source: str = ""

    @property
    def mean(self) -> FloatArray:
        return 0.5 * (self.first + self.second)

    @property
    def noise(self) -> FloatArray:
        """Root mean square error of `mean` by chance alone: half the difference of the halves; a scalar array."""
        return np.sqrt(np.mean((0.5 * (self.first - self.second)) ** 2))


def agreement(truth: Halves, other: Halves) -> dict[str, float | bool]:
    """Whether two references differ by their noise alone: relative RMSE against what chance explains, bias of the mean.

    `agree`: RMSE within 1.2 times the noise, and the bias under 0.5 % or three of its own standard errors.
    """
    mean = float(truth.mean.mean())
    difference = other.mean - truth.mean
    rrmse = float(np.sqrt(np.mean(difference**2))) / mean
    expected = float(np.hypot(truth.noise, other.noise)) / mean
    bias = float(difference.mean()) / mean
    bias_noise = 0.5 * abs(float(other.first.mean() - other.second.mean())) / mean
    sigma = max(bias_noise, expected / np.sqrt(truth.mean.size))
    ok = rrmse <= 1.2 * expected and abs(bias) <= max(0.005, 3.0 * sigma)
    return {
        "rrmse": rrmse,
        "expected_noise": expected,
        "ratio": rrmse / expected,
        "bias": bias,
        "bias_sigma": float(sigma),
        "agree": bool(ok),
    }


class Ptracer:
    """A scene loaded once, whose irradiance at a sensor's pixels is then estimated with any number of photons.

    Args:
        scene: as Mitsuba gets it. sensor: makes its camera. film: pixels (height, width). interfaces: light's most.
        variant: of Mitsuba; the fastest there is when None. rough: specular surfaces as rough as they are.

    Raises:
        UsageError: Mitsuba is missing.
    """

    def __init__(
        self,
        scene: Scene,
        sensor: Callable[[Any], dict[str, Any]],
        film: tuple[int, int],
        interfaces: int,
        variant: str | None = None,
        *,
        rough: bool = False,
    ) -> None:
        self.variant = variant or best_variant()
        self._mi = mi = mitsuba(self.variant)
        self._film = film
        self._scenes = []
        aim = np.concatenate([i.positions_ws() for i in casters(scene)])
        everything = np.concatenate([i.positions_ws() for i in scene.instances_at(0.0)])
        for light in scene.lights:
            if not light.shines:
                continue
            parts = shapes(mi, scene, light, albedo=ALBEDO, rough=rough)
            parts |= {"type": "scene", **aimed_lights(mi, light, aim, everything), "sensor": sensor(mi)}
            self._scenes.append(mi.load_dict(parts))
        self._depth = interfaces + 2
        self.seconds = 0.0  # spent on passes of the full depth since somebody set this to 0
        self.processor_seconds = 0.0  # the same, of all threads

    def render(self, photons: int, seed: int, *, direct: bool = False) -> FloatArray:
        """Caustic irradiance (H, W), luminance, by at least `photons` photons in passes averaged in float64.

        Args:
            direct: keep light that met no caster.
        """
        film_pixels = self._film[0] * self._film[1]
        spp, done = self.photons(photons) // film_pixels, 0
        each = max(SAMPLES_PER_PASS, PHOTONS_PER_PASS // film_pixels)
        total = np.zeros(self._film)
        while done < spp:
            count = min(each, spp - done)
            run = seed * SEED_STRIDE + done // each
            start = time.perf_counter(), time.process_time()
            image = self._pass(self._depth, count, run)
            self.seconds += time.perf_counter() - start[0]
            self.processor_seconds += time.process_time() - start[1]
            if not direct:
                image = image - self._pass(2, count, run)
            total += image * count
            done += count
        return self._wanted(total / spp)

    def photons(self, at_least: int) -> int:
        """The number that is really traced: a whole number for each pixel of the film."""
        film_pixels = self._film[0] * self._film[1]
        return film_pixels * max(1, -(-at_least // film_pixels))

    def _wanted(self, image: FloatArray) -> FloatArray:
        """The part of the film that was asked for."""
        return image

    def _pass(self, depth: int, spp: int, seed: int) -> FloatArray:
        mi = self._mi
        settings = {"type": "ptracer", "max_depth": depth, "rr_depth": 1000, "hide_emitters": True}
        integrator = mi.load_dict(settings)
        images = [np.array(mi.render(s, integrator=integrator, spp=spp, seed=seed % 2**32)) for s in self._scenes]
        radiance = np.sum(np.asarray(images, np.float64), axis=0)
        flat = radiance[..., 0] if radiance.shape[-1] == 1 else luminance(radiance)
        return np.asarray(flat * (math.pi / ALBEDO))


class PhotonMap(Ptracer):
    """Irradiance (P, P) at a target.

    Args:
        scene: see `targets.bench_scene`. pixels: of each side of the image. variant: see Ptracer.

    Raises:
        UsageError: Mitsuba is missing, or the target's pinhole does not see all of it.
    """

    def __init__(
        self, scene: Scene, target: Target, pixels: int, variant: str | None = None, *, rough: bool = False
    ) -> None:
        check_pinhole(scene, target)
        scene, target = enlarged(scene, target, HALF_M / target.half_m)
        hole = self._hole = Pinhole.over(target, pixels)
        self._pixels = pixels
        super().__init__(scene, hole.sensor, (hole.side, hole.side), target.interfaces, variant, rough=rough)

    def _wanted(self, image: FloatArray) -> FloatArray:
        hole = self._hole
        return image[hole.row : hole.row + self._pixels, hole.column : hole.column + self._pixels]


def enlarged(scene: Scene, target: Target, factor: float) -> tuple[Scene, Target]:
    """The same at another scale, about the target's centre as the origin; irradiance stays what it is."""
    larger, move = larger_scene(scene, factor, np.asarray(target.centre_ws, np.float64))
    moved = replace(
        target,
        centre_ws=_moved(move, target.centre_ws),
        half_m=factor * target.half_m,
        pinhole_ws=_moved(move, target.pinhole_ws),
    )
    return larger, moved


def larger_scene(scene: Scene, factor: float, centre_ws: FloatArray) -> tuple[Scene, FloatArray]:
    """The scene at time 0 at another scale about a point that becomes the origin, and the map (4, 4) of its points."""
    move = np.eye(4)
    move[:3, :3] *= factor
    move[:3, 3] = -factor * centre_ws
    instances = tuple(replace(i, world_from_object=move @ i.world_from_object) for i in scene.instances_at(0.0))
    lights = tuple(
        light
        if light.kind is LightKind.DIRECTIONAL
        else replace(
            light,
            position_ws=_moved(move, light.position_ws),
            intensity=light.intensity * factor**2,
            radius_m=light.radius_m * factor,
        )
        for light in scene.lights
    )
    return replace(scene, instances=instances, waters=(), lights=lights), move


def _moved(move: FloatArray, point: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (move @ [*point, 1.0])[:3].tolist()
    return x, y, z


@dataclass(frozen=True)
class Pinhole:
    """A pinhole camera over the receiver, its image plane parallel to it, whose film has the target's pixels in it.

    It stands over the middle of its film, since Mitsuba's `ptracer` is wrong for shifted principal points; the film
    grows until it holds the target. `side`: film pixels; `row`, `column`: of the target's first pixel.
    """

    eye_ws: tuple[float, float, float]
    height_m: float
    half_film_m: float
    side: int
    row: int
    column: int

    @staticmethod
    def over(target: Target, pixels: int) -> Pinhole:
        """The pinhole moves by less than a pixel, so that film and target share their pixel edges."""
        step = 2.0 * target.half_m / pixels
        low = np.asarray(target.centre_ws) - target.half_m
        to_x, to_z = (round((target.pinhole_ws[i] - low[i]) / step) for i in (0, 2))
        half = max(abs(to_x), abs(to_z), abs(pixels - to_x), abs(pixels - to_z))
        eye = (float(low[0] + to_x * step), target.pinhole_ws[1], float(low[2] + to_z * step))
        return Pinhole(eye, eye[1] - target.centre_ws[1], half * step, 2 * half, half - to_z, half - to_x)

    def sensor(self, mi: ModuleType) -> dict[str, Any]:
        """Mitsuba's camera."""
        return {
            "type": "perspective",
            "fov": 2.0 * math.degrees(math.atan(self.half_film_m / self.height_m)),
            "near_clip": 1e-3 * self.height_m,
            "far_clip": 1e3 * self.height_m,
            "to_world": look(mi, self.eye_ws, (0, -1, 0), (0, 0, -1)),
            "film": film(mi, (self.side, self.side)),
            "sampler": {"type": "independent"},
        }


def check_pinhole(scene: Scene, target: Target, rays_per_side: int = 32) -> None:
    """Raises UsageError when something stands between the target and its pinhole, or the receiver is not there."""
    x, z = target.edges_m(rays_per_side)
    grid_x, grid_z = np.meshgrid(0.5 * (x[1:] + x[:-1]), 0.5 * (z[1:] + z[:-1]))
    points = np.stack([grid_x.ravel(), np.full(grid_x.size, target.centre_ws[1]), grid_z.ravel()], axis=1)
    eye = np.asarray(target.pinhole_ws, np.float64)
    distance = np.linalg.norm(points - eye, axis=1)
    caster = RayCaster(beam_scene(scene))
    hit_m = caster.first_hits(np.tile(eye, (len(points), 1)), (points - eye) / distance[:, None]).t
    wrong = np.abs(hit_m - distance) > 1e-4 * distance.max()
    if wrong.any():
        raise UsageError(
            f"the pinhole {target.pinhole_ws} sees {1 - wrong.mean():.0%} of the target",
            where=f"bench target {target.scene}",
            remedy="move pinhole_ws to where no caster hides the receiver",
        )


def mitsuba_reference(
    scene: Scene, target: Target, pixels: int, photons: int, store: Store, variant: str | None = None
) -> Halves:
    """Two halves of `photons` photons each, from the cache when the same was rendered before."""
    variant = variant or best_variant()
    key = digest("mitsuba", MITSUBA_VERSION, scene_key(scene), list(vars(target).values()), pixels, photons, variant)
    source = f"Mitsuba ptracer ({variant}), 2 x {photons / 1e6:g} M photons"
    if kept := store.load(key):
        return Halves(kept[1]["first"], kept[1]["second"], 0.0, source)
    start = time.perf_counter()
    tracer = PhotonMap(scene, target, pixels, variant)
    first, second = (tracer.render(photons, seed) for seed in (1001, 2002))
    halves = Halves(first, second, time.perf_counter() - start, source)
    store.save(key, {"source": source}, {"first": first, "second": second})
    return halves
