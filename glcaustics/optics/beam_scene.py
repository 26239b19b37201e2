"""What the reference beams see: surfaces, lights and receivers as plain float64 arrays in world space, metres.

Stands alone, so that an error in the renderer's own scene code cannot hide here; `bench/scene_export.py` fills it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError
from glcaustics.optics.beams import HeightField

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class SurfaceKind(IntEnum):
    """What light does at a surface."""

    DIFFUSE = 0  # receives; light ends here
    MIRROR = 1  # metal: one reflection, Schlick's Fresnel from `reflectance` as glTF defines it
    DIELECTRIC = 2  # refracts and reflects; the denser medium lies opposite the geometric normal


@dataclass(frozen=True)
class SurfaceOptics:
    """Optical constants, per colour channel. `transmission`: share of the refracted light that passes."""

    kind: SurfaceKind
    ior_rgb: tuple[float, float, float] = (1.5, 1.5, 1.5)
    sigma_a_per_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    transmission: float = 1.0
    reflectance: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class BeamMesh:
    """Triangles with smooth normals: `positions_ws`, `normals_ws` (V, 3) float64, `triangles` (T, 3), CCW outside."""

    positions_ws: FloatArray
    normals_ws: FloatArray
    triangles: IntArray
    optics: SurfaceOptics


@dataclass(frozen=True, eq=False)
class BeamWater:
    """An analytic dielectric height field y = centre.y + field(x - centre.x, z - centre.z) over a rectangle.

    `size_m`: (x, z). `max_height_m`: bound of |field|. A ray meets it at most once; waves do not shade one another.
    """

    field: HeightField
    centre_ws: tuple[float, float, float]
    size_m: tuple[float, float]
    max_height_m: float
    optics: SurfaceOptics


@dataclass(frozen=True)
class BeamLight:
    """`position_ws` None: directional, `intensity_rgb` in W/m^2 on a perpendicular plane; else W/sr, with glTF's cone
    fall-off between the half angles when `outer_cone_rad` is given."""

    intensity_rgb: tuple[float, float, float]
    direction_ws: tuple[float, float, float] = (0.0, -1.0, 0.0)
    position_ws: tuple[float, float, float] | None = None
    inner_cone_rad: float = 0.0
    outer_cone_rad: float | None = None

    def cone(self, directions_ws: FloatArray) -> FloatArray:
        """Angular fall-off (n,) for unit directions (n, 3) (KHR_lights_punctual); 1 without a cone."""
        if self.outer_cone_rad is None:
            return np.ones(len(directions_ws))
        cos_outer = math.cos(self.outer_cone_rad)
        scale = 1.0 / max(0.001, math.cos(self.inner_cone_rad) - cos_outer)
        cosine = directions_ws @ (np.asarray(self.direction_ws) / np.linalg.norm(self.direction_ws))
        return np.asarray(np.clip((cosine - cos_outer) * scale, 0.0, 1.0) ** 2)


@dataclass(frozen=True, eq=False)
class BeamScene:
    """Everything that beams meet. Object numbers: meshes first, then waters."""

    meshes: tuple[BeamMesh, ...]
    lights: tuple[BeamLight, ...]
    waters: tuple[BeamWater, ...] = ()
    name: str = "scene"
    notes: tuple[str, ...] = field(default=())

    def optics(self) -> list[SurfaceOptics]:
        """Optics by object number."""
        return [m.optics for m in self.meshes] + [w.optics for w in self.waters]

    def specular_points_ws(self) -> FloatArray:
        """Points (n, 3) whose convex hull holds every specular surface.

        Raises:
            UsageError: nothing is specular.
        """
        parts = [m.positions_ws for m in self.meshes if m.optics.kind != SurfaceKind.DIFFUSE]
        for water in self.waters:
            signs = np.array(np.meshgrid([-0.5, 0.5], [-1.0, 1.0], [-0.5, 0.5])).reshape(3, -1).T
            parts.append(np.asarray(water.centre_ws) + signs * [water.size_m[0], water.max_height_m, water.size_m[1]])
        if not parts:
            raise UsageError("nothing in the scene is specular", where=self.name, remedy="there is no caustic to trace")
        return np.concatenate(parts)

    def has_dispersion(self) -> bool:
        """Whether the colour channels take different paths."""
        return any(o.kind == SurfaceKind.DIELECTRIC and len(set(o.ior_rgb)) > 1 for o in self.optics())
