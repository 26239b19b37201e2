"""Water surfaces: sums of sine or Gerstner waves and height-map images, on a rectangular grid, with exact normals.

Object space of a water: x, z in metres from the centre of its rectangle, y up, mean level at y = 0. The phase of a wave
is `theta = kx x + kz z - omega t + phase`; heights are computed in float64 and stored as float32.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from glcaustics.errors import SceneError
from glcaustics.scene.limits import check_limit
from glcaustics.scene.model import Material, Mesh, WaterBody

Array = npt.NDArray[np.float64]

STANDARD_GRAVITY = 9.80665  # m/s^2
MAX_GRID = 4096  # vertices along one side
MAX_GRID_VERTICES = 1 << 22  # in all; evaluating the waves takes about 150 bytes a vertex


def dispersion_omega(k: float, depth_m: float = math.inf, gravity: float = STANDARD_GRAVITY) -> float:
    """Angular frequency (rad/s) of a gravity wave of wave number k (rad/m): omega^2 = g k tanh(k h) (Airy 1845).

    In deep water (`depth_m` = inf) that is sqrt(g k).
    """
    return math.sqrt(gravity * k * (1.0 if math.isinf(depth_m) else math.tanh(k * depth_m)))


@dataclass(frozen=True)
class Wave:
    """One plane wave, y = a sin(theta).

    `kx`, `kz`: wave vector, rad/m. `omega`: rad/s. `phase`: rad. `steepness`: 0 = sine, 1 = Gerstner's full trochoid.
    """

    amplitude_m: float
    kx: float
    kz: float
    phase: float = 0.0
    omega: float = 0.0
    steepness: float = 0.0

    @property
    def k(self) -> float:
        """Wave number, rad/m."""
        return math.hypot(self.kx, self.kz)

    @staticmethod
    def from_wavelength(
        amplitude_m: float,
        wavelength_m: float,
        direction_deg: float,
        phase: float = 0.0,
        *,
        steepness: float = 0.0,
        depth_m: float = math.inf,
    ) -> Wave:
        """A wave by its length and direction (degrees from +x towards +z), moving as gravity makes it move."""
        k = 2.0 * math.pi / wavelength_m
        angle = math.radians(direction_deg)
        omega = dispersion_omega(k, depth_m)
        return Wave(amplitude_m, k * math.cos(angle), k * math.sin(angle), phase, omega, steepness)


class WaterSurface(Protocol):
    """What the grid needs of a surface. x, z are float64 arrays of one shape, metres, object space."""

    animated: bool

    def points(self, x: Array, z: Array, time_s: float) -> tuple[Array, Array]:
        """Position (..., 3) and unit normal (..., 3) of the surface point that rests at (x, z)."""

    def height(self, x: Array, z: Array, time_s: float) -> Array:
        """Height above (x, z), metres."""

    def gradient(self, x: Array, z: Array, time_s: float) -> tuple[Array, Array]:
        """(dy/dx, dy/dz) of `height` at (x, z)."""


class WaveSurface:
    """A sum of sine waves, or of Gerstner waves where `steepness` > 0 (Fournier and Reeves 1986, eq. 5-7).

    A particle that rests at (x0, z0) stands at
    x = x0 + sum(Q a kx/k cos theta),  y = sum(a sin theta),  z = z0 + sum(Q a kz/k cos theta), theta taken at (x0, z0).

    Raises:
        SceneError: if the surface would cross itself: sum(Q |a| k) > 1.
    """

    def __init__(self, waves: Sequence[Wave]) -> None:
        self.waves = tuple(waves)
        self.animated = any(w.omega != 0.0 for w in self.waves)
        self._gerstner = any(w.steepness > 0.0 for w in self.waves)
        fold = sum(w.steepness * abs(w.amplitude_m) * w.k for w in self.waves)
        if fold > 1.0:
            raise SceneError(
                f"Gerstner waves cross themselves: sum of steepness * amplitude * k is {fold:.3g}",
                remedy="lower steepness or amplitude until it is at most 1",
            )

    def _thetas(self, x: Array, z: Array, time_s: float) -> list[Array]:
        return [w.kx * x + w.kz * z - w.omega * time_s + w.phase for w in self.waves]

    def _displace(self, x: Array, z: Array, time_s: float) -> tuple[Array, Array, Array, list[Array]]:
        """Displacement (dx, y, dz) of rest points; derivatives [xx, xz, zz, y_x, y_z] of (x, z), y by (x0, z0)."""
        dx, y, dz, xx, xz, zz, y_x, y_z = (np.zeros_like(x) for _ in range(8))
        xx, zz = xx + 1.0, zz + 1.0
        for wave, theta in zip(self.waves, self._thetas(x, z, time_s), strict=True):
            sin, cos = np.sin(theta), np.cos(theta)
            y += wave.amplitude_m * sin
            y_x += wave.amplitude_m * wave.kx * cos
            y_z += wave.amplitude_m * wave.kz * cos
            if wave.steepness > 0.0:
                q = wave.steepness * wave.amplitude_m / wave.k
                dx += q * wave.kx * cos
                dz += q * wave.kz * cos
                xx -= q * wave.kx * wave.kx * sin
                xz -= q * wave.kx * wave.kz * sin
                zz -= q * wave.kz * wave.kz * sin
        return dx, y, dz, [xx, xz, zz, y_x, y_z]

    def points(self, x: Array, z: Array, time_s: float) -> tuple[Array, Array]:
        """Positions and analytic unit normals (..., 3) of the particles that rest at (x, z)."""
        dx, y, dz, (xx, xz, zz, y_x, y_z) = self._displace(x, z, time_s)
        # dP/dz0 x dP/dx0, with dP/dx0 = (xx, y_x, xz) and dP/dz0 = (xz, y_z, zz).
        normal = np.stack([y_z * xz - zz * y_x, zz * xx - xz * xz, xz * y_x - y_z * xx], axis=-1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return np.stack([x + dx, y, z + dz], axis=-1), normal

    def _rest(self, x: Array, z: Array, time_s: float) -> tuple[Array, Array]:
        """The rest points of the particles above (x, z): Newton's method on the horizontal displacement."""
        x0, z0 = x.copy(), z.copy()
        if not self._gerstner:
            return x0, z0
        for _ in range(50):
            dx, _y, dz, (xx, xz, zz, _a, _b) = self._displace(x0, z0, time_s)
            ex, ez = x0 + dx - x, z0 + dz - z
            if max(float(np.abs(ex).max()), float(np.abs(ez).max())) < 1e-13:
                return x0, z0
            det = np.maximum(xx * zz - xz * xz, 1e-3)  # at a cusp the determinant vanishes: take a bounded step
            x0 = x0 - (zz * ex - xz * ez) / det
            z0 = z0 - (xx * ez - xz * ex) / det
        return x0, z0

    def height(self, x: Array, z: Array, time_s: float = 0.0) -> Array:
        """Height above (x, z), metres, float64."""
        x, z = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(z, np.float64))
        return self._displace(*self._rest(x, z, time_s), time_s)[1]

    def gradient(self, x: Array, z: Array, time_s: float = 0.0) -> tuple[Array, Array]:
        """Slopes (dy/dx, dy/dz) above (x, z), float64."""
        x, z = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(z, np.float64))
        _, normal = self.points(*self._rest(x, z, time_s), time_s)
        return -normal[..., 0] / normal[..., 1], -normal[..., 2] / normal[..., 1]


class HeightMapSurface:
    """A still surface from heights on a regular lattice whose outer samples lie on the rectangle's border.

    Between the samples the height is bilinear, and the slope is the bilinear blend of the samples' central differences
    (second-order one-sided ones at the border), so that the shading normal is continuous.

    Args:
        heights_m: (rows, columns) float64; columns run along +x, rows along +z.
        size_m: (width along x, depth along z) of the rectangle.
    """

    animated = False

    def __init__(self, heights_m: npt.ArrayLike, size_m: tuple[float, float]) -> None:
        self.heights_m = np.asarray(heights_m, dtype=np.float64)
        if self.heights_m.ndim != 2 or min(self.heights_m.shape) < 3:
            raise SceneError(f"height map has shape {self.heights_m.shape}", remedy="give at least 3 x 3 samples")
        self.size_m = size_m
        rows, columns = self.heights_m.shape
        self.step_m = (size_m[0] / (columns - 1), size_m[1] / (rows - 1))
        self.slope_x: Array = np.asarray(np.gradient(self.heights_m, self.step_m[0], axis=1, edge_order=2))
        self.slope_z: Array = np.asarray(np.gradient(self.heights_m, self.step_m[1], axis=0, edge_order=2))

    def _bilinear(self, field: Array, x: Array, z: Array) -> Array:
        rows, columns = field.shape
        u = np.clip((x + 0.5 * self.size_m[0]) / self.step_m[0], 0.0, columns - 1.0)
        v = np.clip((z + 0.5 * self.size_m[1]) / self.step_m[1], 0.0, rows - 1.0)
        i, j = np.minimum(u.astype(np.int64), columns - 2), np.minimum(v.astype(np.int64), rows - 2)
        fu, fv = u - i, v - j
        near = field[j, i] * (1 - fu) + field[j, i + 1] * fu
        far = field[j + 1, i] * (1 - fu) + field[j + 1, i + 1] * fu
        return np.asarray(near * (1 - fv) + far * fv)

    def height(self, x: Array, z: Array, time_s: float = 0.0) -> Array:
        """Bilinear height above (x, z), metres; clamped to the border outside."""
        x, z = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(z, np.float64))
        return self._bilinear(self.heights_m, x, z)

    def gradient(self, x: Array, z: Array, time_s: float = 0.0) -> tuple[Array, Array]:
        """Blended central differences (dy/dx, dy/dz) at (x, z)."""
        x, z = np.asarray(x, np.float64), np.asarray(z, np.float64)
        return self._bilinear(self.slope_x, x, z), self._bilinear(self.slope_z, x, z)

    def points(self, x: Array, z: Array, time_s: float = 0.0) -> tuple[Array, Array]:
        """Positions and unit normals (..., 3) above (x, z)."""
        slope_x, slope_z = self.gradient(x, z)
        normal = np.stack([-slope_x, np.ones_like(slope_x), -slope_z], axis=-1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return np.stack([x, self.height(x, z), z], axis=-1), normal


class WaterGrid:
    """A surface sampled on nx x nz vertices over a rectangle; call it with a time in seconds to get the Mesh.

    The triangles and texture coordinates are made once and shared by all meshes; a surface that does not move gives the
    same Mesh object every time.

    Raises:
        SceneError, ResourceLimitError: for a resolution out of range.
    """

    def __init__(
        self, name: str, surface: WaterSurface, size_m: tuple[float, float], resolution: tuple[int, int]
    ) -> None:
        nx, nz = resolution
        if not (2 <= nx <= MAX_GRID and 2 <= nz <= MAX_GRID):
            raise SceneError(
                f"water '{name}': resolution {nx} x {nz}", remedy=f"both numbers must lie in [2, {MAX_GRID}]"
            )
        check_limit(nx * nz, MAX_GRID_VERTICES, f"water '{name}': vertices", "lower its resolution")
        self.name, self.surface, self.size_m, self.resolution = name, surface, size_m, resolution
        x = np.linspace(-0.5 * size_m[0], 0.5 * size_m[0], nx)
        z = np.linspace(-0.5 * size_m[1], 0.5 * size_m[1], nz)
        self._x, self._z = np.meshgrid(x, z)  # (nz, nx)
        u, v = np.meshgrid(np.linspace(0.0, 1.0, nx), np.linspace(0.0, 1.0, nz))
        self._uv = np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32)
        self._triangles = _grid_triangles(nx, nz)
        self._still: Mesh | None = None

    def __call__(self, time_s: float) -> Mesh:
        """The mesh at a time: positions and normals (nx * nz, 3) float32, open sheet, normals up."""
        if self._still is not None:
            return self._still
        positions, normals = self.surface.points(self._x, self._z, float(time_s))
        mesh = Mesh(
            self.name,
            positions.reshape(-1, 3).astype(np.float32),
            normals.reshape(-1, 3).astype(np.float32),
            self._uv,
            self._triangles,
            watertight=False,
        )
        if not self.surface.animated:
            self._still = mesh
        return mesh


def _grid_triangles(nx: int, nz: int) -> npt.NDArray[np.uint32]:
    """Two triangles a cell, counter-clockwise seen from above (+y); vertex index = row * nx + column."""
    i, j = np.meshgrid(np.arange(nx - 1), np.arange(nz - 1))
    a = (j * nx + i).ravel()  # (x, z)
    b, c, d = a + 1, a + nx, a + nx + 1  # (x+, z), (x, z+), (x+, z+)
    return np.stack([a, c, b, b, c, d], axis=-1).reshape(-1, 3).astype(np.uint32)


def make_water(
    name: str,
    material: Material,
    surface: WaterSurface,
    *,
    size_m: tuple[float, float],
    resolution: tuple[int, int],
    center_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> WaterBody:
    """A WaterBody whose rectangle `size_m` (x, z) is centred at `center_m` (world space, metres).

    Raises:
        SceneError: for a resolution out of range.
    """
    world_from_object = np.eye(4)
    world_from_object[:3, 3] = center_m
    grid = WaterGrid(name, surface, size_m, resolution)
    return WaterBody(name, material, grid, world_from_object, animated=surface.animated)


def surface_of(water: WaterBody) -> WaterSurface:
    """The surface (height, gradient) behind a water made by `make_water`, for oracles and tests.

    Raises:
        SceneError: if the water was made otherwise.
    """
    if not isinstance(water.mesh_at, WaterGrid):
        raise SceneError(f"water '{water.name}' has no analytic surface", remedy="make it with make_water")
    return water.mesh_at.surface
