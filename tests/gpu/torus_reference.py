"""Light of a point source through an analytic torus of glass over a floor, ray by ray in float64.

Two interfaces (in and out) and the reflection off the outside; what is totally reflected inside ends there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from glcaustics.optics.fresnel import fresnel_dielectric
from glcaustics.optics.refract import reflect, refract

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Torus:
    """Round the y axis through `centre`; `major_m`: radius of the ring, `minor_m`: of the tube."""

    major_m: float
    minor_m: float
    centre: tuple[float, float, float]

    def distance(self, p: FloatArray) -> FloatArray:
        """Signed distance (N,), metres, negative inside; exact."""
        q = p - np.asarray(self.centre)
        ring = np.hypot(q[:, 0], q[:, 2]) - self.major_m
        return np.hypot(ring, q[:, 1]) - self.minor_m

    def normal(self, p: FloatArray) -> FloatArray:
        q = p - np.asarray(self.centre)
        r = np.hypot(q[:, 0], q[:, 2])
        tube = np.stack((q[:, 0] * self.major_m / r, np.zeros_like(r), q[:, 2] * self.major_m / r), 1)
        n = q - tube
        return n / np.linalg.norm(n, axis=1, keepdims=True)

    def first_hit(self, origin: FloatArray, direction: FloatArray, sign: float, far_m: float) -> FloatArray:
        """Sphere tracing (Hart 1996) from outside (+1) or inside (-1): distance (N,), inf where there is none."""
        t = np.full(len(origin), 1e-6 if sign > 0 else 1e-5)
        done = np.zeros(len(origin), bool)
        missed = np.zeros(len(origin), bool)
        active = np.arange(len(origin))
        for _ in range(400):
            d = sign * self.distance(origin[active] + t[active, None] * direction[active])
            t[active] += np.where(d > 1e-10, d, 0.0)
            done[active[d <= 1e-10]] = True
            missed[active[t[active] > far_m]] = True
            active = active[(d > 1e-10) & (t[active] <= far_m)]
            if len(active) == 0:
                break
        missed[active] = True  # a ray that grazes for 400 steps passes
        return np.where(missed, np.inf, t)


def photons(
    torus: Torus, lamp: npt.ArrayLike, ior: float, floor_y_m: float, count: int, seed: int = 1
) -> tuple[FloatArray, FloatArray]:
    """Landing points (N, 2) in x, z and their flux (N,) for a lamp of 1 W/sr.

    Directions are stratified over the cone that holds the torus; each carries cone solid angle / count.
    """
    lamp = np.asarray(lamp, np.float64)
    axis = np.asarray(torus.centre) - lamp
    distance = float(np.linalg.norm(axis))
    axis = axis / distance
    cosine = np.sqrt(1.0 - ((torus.major_m + torus.minor_m) * 1.001 / distance) ** 2)
    side = int(np.sqrt(count))
    jitter = np.random.default_rng(seed).random((2, side, side))
    i, j = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    z = 1.0 - (1.0 - cosine) * ((i + jitter[0]) / side).ravel()
    phi = 2.0 * np.pi * ((j + jitter[1]) / side).ravel()
    right = np.cross(axis, (0.0, 0.0, 1.0) if abs(axis[2]) < 0.9 else (1.0, 0.0, 0.0))
    right /= np.linalg.norm(right)
    up = np.cross(axis, right)
    rho = np.sqrt(1.0 - z**2)
    d = z[:, None] * axis + (rho * np.cos(phi))[:, None] * right + (rho * np.sin(phi))[:, None] * up
    flux = np.full(len(d), 2.0 * np.pi * (1.0 - cosine) / len(d))

    far = 2.0 * distance + 10.0
    t = torus.first_hit(np.broadcast_to(lamp, d.shape), d, 1.0, far)
    hit = np.isfinite(t)
    d, flux, p = d[hit], flux[hit], lamp + t[hit, None] * d[hit]
    n = torus.normal(p)
    share = fresnel_dielectric(-(d * n).sum(1), 1.0, ior)
    landing = [_floor(p, reflect(d, n), flux * share, floor_y_m)]
    inside, _ = refract(d, n, 1.0, ior)
    s = torus.first_hit(p, inside, -1.0, far)
    out = p + s[:, None] * inside
    n_out = torus.normal(out)
    leaving, total = refract(inside, n_out, ior, 1.0)
    passed = (1.0 - share) * (1.0 - fresnel_dielectric((inside * n_out).sum(1), ior, 1.0))
    landing.append(_floor(out[~total], leaving[~total], (flux * passed)[~total], floor_y_m))
    return np.concatenate([x for x, _ in landing]), np.concatenate([f for _, f in landing])


def _floor(p: FloatArray, d: FloatArray, flux: FloatArray, floor_y_m: float) -> tuple[FloatArray, FloatArray]:
    down = d[:, 1] < -1e-9
    t = (floor_y_m - p[down, 1]) / d[down, 1]
    x = p[down] + t[:, None] * d[down]
    return x[:, [0, 2]], flux[down]
