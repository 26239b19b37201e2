"""Follows rays through one sequence of specular events, 'T' (refracted) and 'R' (reflected), to where they land."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from glcaustics.optics.beam_scene import BeamScene, SurfaceKind
from glcaustics.optics.beam_spread import Facets, RoughOptics
from glcaustics.optics.fresnel import fresnel_dielectric
from glcaustics.optics.microfacet import ggx_visible_share, visible_normals
from glcaustics.optics.raycast import Hits, RayCaster
from glcaustics.optics.refract import refract

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
HASH, HASH_MASK = np.int64(1000003), np.int64(0x7FFFFFFFFFFF)


@dataclass(frozen=True, eq=False)
class Landings:
    """Where n rays of one branch end. `signature` (n,): equal for rays that met the same objects in the same way;
    -1 where the ray does not follow the branch on to a receiver. Other fields hold for signature >= 0 only.

    `point_ws`, `normal_ws` (n, 3): on the receiver, interpolated normal on the side that the light came from;
    `direction_ws` (n, 3): of travel; `throughput` (n, 3): share of the flux that arrives, per channel.
    """

    signature: IntArray
    point_ws: FloatArray
    normal_ws: FloatArray
    direction_ws: FloatArray
    throughput: FloatArray


@dataclass(eq=False)
class _Rays:
    """Rays on their way. `index`: in the batch; `sigma`: absorption coefficient of the medium they run in, 1/m."""

    index: IntArray
    origin: FloatArray
    direction: FloatArray
    throughput: FloatArray
    sigma: FloatArray
    signature: IntArray
    last_object: IntArray

    def pick(self, chosen: BoolArray) -> _Rays:
        return _Rays(
            self.index[chosen],
            self.origin[chosen],
            self.direction[chosen],
            self.throughput[chosen],
            self.sigma[chosen],
            self.signature[chosen],
            self.last_object[chosen],
        )


class PathTracer:
    """Rays through a scene, for one colour channel's index of refraction and one sample of rough surfaces' facets."""

    def __init__(self, scene: BeamScene, caster: RayCaster, channel: int = 1, facets: Facets | None = None) -> None:
        self.caster = caster
        self._facets = facets
        optics = scene.optics()
        self._kind = np.array([int(o.kind) for o in optics])
        self._ior = np.array([o.ior_rgb[channel] for o in optics])
        self._sigma = np.array([o.sigma_a_per_m for o in optics], np.float64)
        self._transmission = np.array([o.transmission for o in optics], np.float64)
        self._alpha = np.array([o.roughness**2 if isinstance(o, RoughOptics) else 0.0 for o in optics], np.float64)
        self._reflectance = np.array([o.reflectance for o in optics], np.float64)

    def branches(self, max_events: int, *, reflect: bool = True) -> list[str]:
        """Sequences of at most `max_events` events that some light may take, shortest first.

        Args:
            reflect: False leaves out branches with a reflection, unless mirrors ask for them.
        """
        dielectric = bool((self._kind == SurfaceKind.DIELECTRIC).any())
        mirror = bool((self._kind == SurfaceKind.MIRROR).any())
        letters = ("T" if dielectric else "") + ("R" if mirror or reflect else "")
        return ["".join(p) for n in range(1, max_events + 1) for p in product(letters, repeat=n)]

    def follow(self, origin_ws: FloatArray, direction_ws: FloatArray, branch: str, *, from_light: bool) -> Landings:
        """Rays (n, 3), unit directions, along the events of `branch`, then on to a diffuse receiver.

        Args:
            from_light: the first segment starts at a finite light (its absorption counts if it lies in a medium).
        """
        n = len(origin_ws)
        out = Landings(np.full(n, -1), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)))
        rays = _Rays(
            np.arange(n),
            origin_ws,
            direction_ws,
            np.ones((n, 3)),
            np.zeros((n, 3)),
            np.zeros(n, np.int64),
            np.full(n, -1),
        )
        for step, event in enumerate(branch):
            rays, hits, normal, entering = self._advance(rays, event)
            if step == 0 and from_light:
                rays.throughput = rays.throughput * self._source_medium(hits, entering)
            facet = self._facet_normals(step, rays.direction, normal, hits.object_id)
            direction, share, sigma = self._scatter(event, rays.direction, facet, hits.object_id, entering)
            share = share * self._way_out(event, direction, normal, hits.object_id)[:, None]
            rays.origin, rays.direction, rays.sigma = hits.point_ws, direction, sigma
            rays.throughput = rays.throughput * share
            rays.last_object = hits.object_id
            rays = rays.pick(share.max(axis=1) > 0.0)
        rays, hits, normal, _ = self._advance(rays, "")
        out.signature[rays.index], out.point_ws[rays.index], out.normal_ws[rays.index] = (
            rays.signature,
            hits.point_ws,
            normal,
        )
        out.direction_ws[rays.index], out.throughput[rays.index] = rays.direction, rays.throughput
        return out

    def _advance(self, rays: _Rays, event: str) -> tuple[_Rays, Hits, FloatArray, BoolArray]:
        """To the next hit, if it allows the event ('' = a receiver): rays left, hits, normals, whether they enter."""
        hits = self.caster.first_hits(rays.origin, rays.direction, rays.last_object)
        kind = np.where(hits.object_id >= 0, self._kind[hits.object_id], -1)
        go_on = kind == SurfaceKind.DIFFUSE if event == "" else kind > SurfaceKind.DIFFUSE
        if event == "T":
            go_on &= kind == SurfaceKind.DIELECTRIC
        rays, hits = rays.pick(go_on), hits.pick(go_on)
        rays.throughput = rays.throughput * np.exp(-rays.sigma * hits.t[:, None])
        entering = np.einsum("ij,ij->i", rays.direction, hits.geometric_ws) < 0.0
        rays.signature = (rays.signature * HASH + 2 * hits.object_id + entering + 1) & HASH_MASK
        return rays, hits, _facing(hits, rays.direction, entering), entering

    def _source_medium(self, hits: Hits, entering: BoolArray) -> FloatArray:
        """Absorption between a light inside a medium and the first interface."""
        absorbed = np.exp(-self._sigma[hits.object_id] * hits.t[:, None])
        inside = ~entering & (self._kind[hits.object_id] == SurfaceKind.DIELECTRIC)
        return np.where(inside[:, None], absorbed, 1.0)

    def _facet_normals(self, step: int, direction: FloatArray, normal: FloatArray, object_id: IntArray) -> FloatArray:
        """(n, 3): of the microfacets that the rays meet at their event number `step`."""
        alpha = self._alpha[object_id]
        if self._facets is None or not alpha.any():
            return normal
        rough = visible_normals(normal, direction, alpha, self._facets.samples[step], self._facets.axis_ws)
        return np.where((alpha > 0.0)[:, None], rough, normal)

    def _way_out(self, event: str, direction: FloatArray, normal: FloatArray, object_id: IntArray) -> FloatArray:
        """Share (n,) that other microfacets let out: G2 / G1 with separable masking; 0 into the surface."""
        alpha = self._alpha[object_id]
        cosine = np.einsum("ij,ij->i", direction, normal) * (1.0 if event == "R" else -1.0)
        share = ggx_visible_share(np.clip(cosine, 1e-9, 1.0), alpha)
        return np.where(alpha > 0.0, np.where(cosine > 0.0, share, 0.0), 1.0)

    def _scatter(
        self, event: str, direction: FloatArray, normal: FloatArray, object_id: IntArray, entering: BoolArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """New direction (n, 3), share (n, 3), absorption coefficient (n, 3) of the medium that it runs in."""
        cos_i = np.clip(-np.einsum("ij,ij->i", direction, normal), 0.0, 1.0)
        ior = self._ior[object_id]
        n_from, n_to = np.where(entering, 1.0, ior), np.where(entering, ior, 1.0)
        reflected = fresnel_dielectric(cos_i, n_from, n_to)
        dielectric = self._kind[object_id] == SurfaceKind.DIELECTRIC
        inside = self._sigma[object_id]
        if event == "T":
            out, tir = refract(direction, normal, n_from, n_to)
            share = np.where(tir, 0.0, (1.0 - reflected) * self._transmission[object_id])
            return out, np.repeat(share[:, None], 3, axis=1), np.where(entering[:, None], inside, 0.0)
        f0 = self._reflectance[object_id]
        metal = f0 + (1.0 - f0) * ((1.0 - cos_i) ** 5)[:, None]
        out = direction + 2.0 * cos_i[:, None] * normal
        share = np.where(dielectric[:, None], reflected[:, None], metal)
        return out, share, np.where((dielectric & ~entering)[:, None], inside, 0.0)


def _facing(hits: Hits, direction: FloatArray, entering: BoolArray) -> FloatArray:
    """Interpolated normals on the side that the ray comes from; the geometric one where smoothing points away."""
    side = np.where(entering, 1.0, -1.0)[:, None]
    normal = hits.normal_ws * side
    away = np.einsum("ij,ij->i", direction, normal) >= -1e-9
    return np.where(away[:, None], hits.geometric_ws * side, normal)
