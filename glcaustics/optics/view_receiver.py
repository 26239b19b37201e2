"""Reference beams added up at a camera's pixels: irradiance of all that an eye sees past specular surfaces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from glcaustics.optics.area_raster import AreaRaster
from glcaustics.optics.beam_scene import BeamScene, SurfaceKind
from glcaustics.optics.raycast import Hits, RayCaster

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
NEAR = 1e-4  # of the scene's extent: what is nearer to the eye's plane is behind it
SAME_POINT = 1e-5  # of the scene's extent: an eye ray that ends within it of a point sees the point
MARGIN_PX = 4.0  # beyond the picture that still counts, so that triangles across its edge need no splitting
RAYS_PER_CHUNK = 1 << 20


@dataclass(frozen=True, eq=False)
class PinholeView:
    """A perspective camera with pixels: it looks down its own -z with +y up; row 0 on top.

    `world_from_camera`: (4, 4), metres. `tan_half_y`: of half the vertical angle.
    """

    world_from_camera: FloatArray
    tan_half_y: float
    width: int
    height: int

    @property
    def eye_ws(self) -> FloatArray:
        return np.asarray(self.world_from_camera[:3, 3], np.float64)

    def pixels(self, point_ws: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points (..., 3) -> (x, y) in pixels (..., 2), and their depth (...,) along the view axis, metres."""
        local = (point_ws - self.eye_ws) @ np.asarray(self.world_from_camera[:3, :3], np.float64)
        depth = -local[..., 2]
        per_m = 0.5 * self.height / (self.tan_half_y * np.where(depth > 0.0, depth, np.inf))
        x = 0.5 * self.width + local[..., 0] * per_m
        return np.stack([x, 0.5 * self.height - local[..., 1] * per_m], axis=-1), depth

    def rays(self, samples: int, rows: slice) -> tuple[FloatArray, FloatArray]:
        """Unit directions (n, 3) through `samples`^2 even points of each pixel of these rows, and their solid angles
        (n,); ordered by sub-row."""
        step = 2.0 * self.tan_half_y / (self.height * samples)
        x = (np.arange(self.width * samples) + 0.5) * step - self.tan_half_y * self.width / self.height
        y = self.tan_half_y - (np.arange(rows.start * samples, rows.stop * samples) + 0.5) * step
        x, y = np.meshgrid(x, y)
        local = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3)
        length = np.linalg.norm(local, axis=1)
        turn = np.asarray(self.world_from_camera[:3, :3], np.float64)
        return np.asarray((local / length[:, None]) @ turn.T), step**2 / length**3


class ViewReceiver:
    """Adds beams up at a camera's pixels: flux over the area of receiver that a pixel shows, by exact area coverage.

    Specular surfaces are invisible to this eye. Light counts where the eye sees the side that it falls on. A pixel
    across an edge holds the mean over all that it shows, by area.

    Args:
        samples: eye rays per side of a pixel for its receiver's area.

    Raises:
        UsageError: embreex is not installed.
    """

    def __init__(self, scene: BeamScene, view: PinholeView, samples: int = 2) -> None:
        opaque = tuple(m for m in scene.meshes if m.optics.kind == SurfaceKind.DIFFUSE)
        self.view = view
        self._caster = RayCaster(replace(scene, meshes=opaque, waters=()))
        self._near_m = NEAR * self._caster.extent_m
        self._raster = AreaRaster(view.width, view.height)
        self.area_m2, self.plain, self.point_ws = self._look(samples)

    def _look(self, samples: int) -> tuple[FloatArray, BoolArray, FloatArray]:
        """Area (H, W) of receiver, m^2; whether a pixel shows one surface alone (H, W); a point of it (H, W, 3)."""
        width, height = self.view.width, self.view.height
        area, plain, point = np.zeros((height, width)), np.zeros((height, width), bool), np.zeros((height, width, 3))
        rows = max(1, RAYS_PER_CHUNK // (width * samples**2))
        for first in range(0, height, rows):
            part = slice(first, min(first + rows, height))
            direction, solid_angle = self.view.rays(samples, part)
            hits = self._first(direction)
            cosine = np.abs(np.einsum("ij,ij->i", direction, hits.geometric_ws))
            found = hits.object_id >= 0
            each = np.where(found, np.where(found, hits.t, 0.0) ** 2 * solid_angle / np.maximum(cosine, 1e-9), 0.0)
            shape = (part.stop - part.start, samples, width, samples)
            area[part] = each.reshape(shape).sum(axis=(1, 3))
            number = hits.object_id.reshape(shape)
            same = (number == number[:, :1, :, :1]).all(axis=(1, 3)) & (number[:, 0, :, 0] >= 0)
            normal = hits.geometric_ws.reshape(*shape, 3)
            turned = np.einsum("arcsk,ack->arcs", normal, normal[:, 0, :, 0]) < 0.9
            plain[part] = same & ~turned.any(axis=(1, 3))
            point[part] = np.where(found[:, None], hits.point_ws, 0.0).reshape(*shape, 3)[:, 0, :, 0]
        return area, plain, point

    def _first(self, direction: FloatArray) -> Hits:
        return self._caster.first_hits(np.broadcast_to(self.view.eye_ws, direction.shape), direction)

    # -- what beams ask for -------------------------------------------------------------------------------------------

    def catches(self, point_ws: FloatArray, normal_ws: FloatArray) -> BoolArray:
        """Whether the eye sees the points (n, 3) from the side of their normals, within or beside the picture."""
        xy, depth = self.view.pixels(point_ws)
        size = np.array([self.view.width, self.view.height])
        seen = (depth > self._near_m) & ((xy > -MARGIN_PX) & (xy < size + MARGIN_PX)).all(axis=1)
        towards = point_ws - self.view.eye_ws
        seen &= np.einsum("ij,ij->i", towards, normal_ws) < 0.0
        index = np.flatnonzero(seen)
        distance = np.linalg.norm(towards[index], axis=1)
        hits = self._first(towards[index] / distance[:, None])
        seen[index] = np.abs(hits.t - distance) < SAME_POINT * self._caster.extent_m
        return seen

    def size_px(self, triangle_ws: FloatArray) -> FloatArray:
        """Longest edge (n,) in the picture; 0 where the triangle misses it or lies behind the eye."""
        xy, depth = self.view.pixels(triangle_ws)
        low, high = xy.min(axis=1), xy.max(axis=1)
        away = (high < 0.0).any(axis=1) | (low > [self.view.width, self.view.height]).any(axis=1)
        away |= (depth <= self._near_m).any(axis=1)
        longest = np.linalg.norm(xy - np.roll(xy, 1, axis=1), axis=2).max(axis=1)
        return np.where(away, 0.0, longest)

    def add_triangles(self, triangle_ws: FloatArray, normal_ws: FloatArray, flux: FloatArray) -> None:
        self._raster.add_triangles(self.view.pixels(triangle_ws)[0], flux)

    def add_points(self, point_ws: FloatArray, normal_ws: FloatArray, flux: FloatArray) -> None:
        self._raster.add_points(self.view.pixels(point_ws)[0], flux)

    def irradiance(self) -> FloatArray:
        """(height, width, 3), W/m^2; 0 where the eye sees no receiver."""
        area = self.area_m2[..., None]
        return np.divide(self._raster.flux(), area, out=np.zeros((*area.shape[:2], 3)), where=area > 0.0)
