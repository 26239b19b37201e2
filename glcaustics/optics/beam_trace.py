"""Traces a light's beams, triangles of light, through a scene into a receiver; see `reference` for the method."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from glcaustics.optics.beam_paths import Landings, PathTracer
from glcaustics.optics.beam_scene import BeamScene
from glcaustics.optics.beam_spread import spread
from glcaustics.optics.light_mesh import LightPatch, light_patches
from glcaustics.optics.raycast import RayCaster
from glcaustics.optics.receivers import Receiver

FloatArray = npt.NDArray[np.float64]
TILE = 128  # cells; a tile's arrays stay below 100 MB through all refinements
MIN_COSINE = 0.8  # between the normals at a triangle's landed corners: beyond, it lies across an edge


@dataclass(frozen=True)
class BeamSettings:
    """How finely beams are traced.

    `cells`: of the light mesh per side, over the rectangle around the casters. `max_events`: specular events followed.
    `reflect`: reflection at dielectrics too. `split_levels`: halvings of a triangle across a silhouette or an edge.
    `bend_levels`: halvings of one that lands wider than `wide_px` and bends by more than `bend_px`.
    """

    cells: int = 1024
    max_events: int = 2
    reflect: bool = True
    split_levels: int = 5
    bend_levels: int = 3
    wide_px: float = 3.0
    bend_px: float = 0.02
    seed: int = 0


@dataclass
class FluxBalance:
    """Where the flux went, W per channel (3,). `emitted`: of the whole light mesh. `landed`: on any receiver.
    `caught`: of it, on the receiver asked for. `unsplit`: landed as points, from triangles at the finest level."""

    emitted: FloatArray = field(default_factory=lambda: np.zeros(3))
    landed: FloatArray = field(default_factory=lambda: np.zeros(3))
    caught: FloatArray = field(default_factory=lambda: np.zeros(3))
    unsplit: FloatArray = field(default_factory=lambda: np.zeros(3))
    rays: int = 0


@dataclass(frozen=True, eq=False)
class _Corners:
    """The three corners of n light triangles: `uv` (n, 3, 2), and their landings, each array (n, 3, ...)."""

    uv: FloatArray
    landings: Landings

    def pick(self, chosen: npt.NDArray[np.generic]) -> _Corners:
        fields = (getattr(self.landings, name)[chosen] for name in Landings.__dataclass_fields__)
        return _Corners(self.uv[chosen], Landings(*fields))


class _BranchTrace:
    """One light patch, one branch of events, one set of colour channels, into one receiver."""

    def __init__(
        self,
        tracer: PathTracer,
        patch: LightPatch,
        branch: str,
        color: FloatArray,
        receiver: Receiver,
        settings: BeamSettings,
        balance: FluxBalance,
    ) -> None:
        self.tracer, self.patch, self.branch, self.color = tracer, patch, branch, color
        self.receiver, self.settings, self.balance = receiver, settings, balance

    def _trace(self, uv: FloatArray) -> Landings:
        origin, direction = self.patch.rays(uv.reshape(-1, 2))
        self.balance.rays += len(origin)
        from_light = self.patch.light.position_ws is not None
        return self.tracer.follow(origin, direction, self.branch, from_light=from_light)

    def tile(self, u: FloatArray, v: FloatArray) -> None:
        """All triangles of the grid with these lines."""
        grid_u, grid_v = np.meshgrid(u, v)
        uv = np.stack([grid_u, grid_v], axis=-1).reshape(-1, 2)
        landings = self._trace(uv)
        if not (landings.signature >= 0).any():
            return
        i, j = np.meshgrid(np.arange(u.size - 1), np.arange(v.size - 1))
        a = (j * u.size + i).ravel()
        b, c, d = a + 1, a + u.size, a + u.size + 1
        corners = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])
        self._settle(_Corners(uv, landings).pick(corners), 0, np.zeros(len(corners), bool))

    def _settle(self, corners: _Corners, level: int, straight: npt.NDArray[np.bool_]) -> None:
        """Add up what can be added; split the rest. `straight`: known to land as flat as it should."""
        signature = corners.landings.signature
        some = (signature[:, 0] >= 0) | (signature[:, 1] >= 0) | (signature[:, 2] >= 0)
        if not some.all():
            corners, straight, signature = corners.pick(some), straight[some], signature[some]
        if len(signature) == 0:
            return
        land = corners.landings
        caught = self.receiver.catches(land.point_ws.reshape(-1, 3), land.normal_ws.reshape(-1, 3)).reshape(-1, 3)
        caught &= signature >= 0
        whole = np.ones(len(signature), bool)
        for k in (1, 2):
            whole &= (signature[:, 0] == signature[:, k]) & (caught[:, 0] == caught[:, k])
            whole &= np.einsum("ij,ij->i", land.normal_ws[:, 0], land.normal_ws[:, k]) > MIN_COSINE
        wide = self.receiver.size_px(land.point_ws) > self.settings.wide_px
        split = np.where(whole, wide & caught[:, 0] & ~straight, caught[:, 0] | caught[:, 1] | caught[:, 2])
        split &= level < np.where(whole, self.settings.bend_levels, self.settings.split_levels)
        self._add(corners.pick(~split), whole[~split], caught[~split])
        if split.any():
            self._split(corners.pick(split), whole[split], level)

    def _add(self, corners: _Corners, whole: npt.NDArray[np.bool_], caught: npt.NDArray[np.bool_]) -> None:
        if len(whole) == 0:
            return
        land = corners.landings
        flux = self.patch.flux(corners.uv)[:, None] * (self.color / 3.0)
        each = flux[:, None, :] * land.throughput  # zero where nothing landed
        self.balance.landed += np.einsum("nkc->c", each)
        self.balance.caught += np.einsum("nkc,nk->c", each, caught.astype(np.float64))
        full = whole & caught[:, 0]
        self.receiver.add_triangles(land.point_ws[full], land.normal_ws[full, 0], np.einsum("nkc->nc", each[full]))
        single = caught & ~whole[:, None]
        self.balance.unsplit += each[single].sum(axis=0)
        self.receiver.add_points(land.point_ws[single], land.normal_ws[single], each[single])

    def _split(self, corners: _Corners, whole: npt.NDArray[np.bool_], level: int) -> None:
        """Four triangles from each, by the midpoints of its edges."""
        middle_uv = 0.5 * (corners.uv + np.roll(corners.uv, -1, axis=1))  # edges 01, 12, 20
        n = len(middle_uv)
        traced = self._trace(middle_uv)
        middle = _Corners(middle_uv, Landings(*(a.reshape(n, 3, *a.shape[1:]) for a in vars(traced).values())))
        straight = whole & (middle.landings.signature == corners.landings.signature[:, :1]).all(axis=1)
        straight &= self._bend_px(corners, middle) < self.settings.bend_px
        children = _regroup(_join(corners, middle), [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
        self._settle(children, level + 1, np.repeat(straight, 4))

    def _bend_px(self, corners: _Corners, middle: _Corners) -> FloatArray:
        """How far the midpoints land from the middle of the landed edges, (n,)."""
        p = corners.landings.point_ws
        chord = 0.5 * (p + np.roll(p, -1, axis=1))
        off = np.stack([chord, middle.landings.point_ws], axis=2)
        return np.asarray(
            np.max([self.receiver.size_px(np.concatenate([off[:, k], off[:, k, :1]], 1)) for k in range(3)], axis=0)
        )


def _join(corners: _Corners, middle: _Corners) -> _Corners:
    """Six points (n, 6, ...) a triangle: corners, then midpoints."""
    a, b = corners.landings, middle.landings
    landings = Landings(
        np.concatenate([a.signature, b.signature], axis=1),
        np.concatenate([a.point_ws, b.point_ws], axis=1),
        np.concatenate([a.normal_ws, b.normal_ws], axis=1),
        np.concatenate([a.direction_ws, b.direction_ws], axis=1),
        np.concatenate([a.throughput, b.throughput], axis=1),
    )
    return _Corners(np.concatenate([corners.uv, middle.uv], axis=1), landings)


def _regroup(six: _Corners, parts: list[list[int]]) -> _Corners:
    """Triangles of the named points, one after another for each six."""

    def take(a: npt.NDArray[np.generic]) -> npt.NDArray[np.generic]:
        return a[:, parts].reshape(-1, 3, *a.shape[2:])

    fields = {name: take(getattr(six.landings, name)) for name in Landings.__dataclass_fields__}
    return _Corners(np.asarray(take(six.uv), np.float64), Landings(**fields))  # type: ignore[arg-type]


def trace_beams(scene: BeamScene, receiver: Receiver, settings: BeamSettings) -> FluxBalance:
    """Trace every light's beams once and add them up in `receiver`.

    Raises:
        UsageError: embreex is missing, or nothing in the scene is specular.
    """
    caster, balance = RayCaster(scene), FluxBalance()
    specular = scene.specular_points_ws()
    everything = np.concatenate([specular, *(m.positions_ws for m in scene.meshes)])
    bounds = np.stack([everything.min(axis=0), everything.max(axis=0)])
    groups = [(c, np.eye(3)[c]) for c in range(3)] if scene.has_dispersion() else [(1, np.ones(3))]
    parts = (
        part
        for number, light in enumerate(scene.lights)
        for part in spread(light, scene, specular, settings.max_events, settings.seed * 1009 + number)
    )
    for number, (light, facets) in enumerate(parts):
        for patch in light_patches(light, specular, bounds, settings.seed * 1009 + number):
            size = patch.high_uv - patch.low_uv
            cell = float(np.sqrt(size.prod())) / settings.cells
            lines = [
                np.linspace(low, low + extent, max(2, round(extent / cell) + 1))
                for low, extent in zip(patch.low_uv, size, strict=True)
            ]
            balance.emitted += _emitted(patch, lines) * np.asarray(light.intensity_rgb)
            for channel, mask in groups:
                tracer = PathTracer(scene, caster, channel, facets)
                color = mask * np.asarray(light.intensity_rgb, np.float64)
                for branch in tracer.branches(settings.max_events, reflect=settings.reflect):
                    trace = _BranchTrace(tracer, patch, branch, color, receiver, settings, balance)
                    _tiles(trace, lines)
    return balance


def _tiles(trace: _BranchTrace, lines: list[FloatArray]) -> None:
    for v in range(0, lines[1].size - 1, TILE):
        for u in range(0, lines[0].size - 1, TILE):
            trace.tile(lines[0][u : u + TILE + 1], lines[1][v : v + TILE + 1])


def _emitted(patch: LightPatch, lines: list[FloatArray]) -> float:
    u, v = lines[0][[0, -1]], lines[1][[0, -1]]
    corners = np.array([[u[0], v[0]], [u[1], v[0]], [u[0], v[1]], [u[1], v[1]]])
    if patch.light.outer_cone_rad is None:
        return float(patch.flux(corners[[[0, 1, 2], [1, 3, 2]]]).sum())
    fine_u, fine_v = np.meshgrid(np.linspace(float(u[0]), float(u[1]), 129), np.linspace(float(v[0]), float(v[1]), 129))
    uv = np.stack([fine_u, fine_v], axis=-1)
    lower = np.stack([uv[:-1, :-1], uv[:-1, 1:], uv[1:, :-1]], axis=2).reshape(-1, 3, 2)
    upper = np.stack([uv[1:, 1:], uv[1:, :-1], uv[:-1, 1:]], axis=2).reshape(-1, 3, 2)
    return float(patch.flux(lower).sum() + patch.flux(upper).sum())
