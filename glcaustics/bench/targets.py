"""Where irradiance is measured: a square of a flat receiver in each scene, and the scene as every tool gets it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from glcaustics.errors import UsageError
from glcaustics.scene.load import load_scene
from glcaustics.scene.model import Camera, Instance, Material, OpticalKind, Scene

FloatArray = npt.NDArray[np.float64]
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709, linear
SPECULAR = (OpticalKind.MIRROR, OpticalKind.SOLID, OpticalKind.INTERFACE)


@dataclass(frozen=True)
class Target:
    """A square of a horizontal receiver that faces up.

    Images of it have row 0 at -z and column 0 at -x. `centre_ws`: its middle, metres; `half_m`: half its side;
    `pinhole_ws`: a point that sees the whole square past the casters, for tools that need a camera;
    `interfaces`: most interfaces that light meets on its way (water and mirrors 1, solids 2).
    """

    scene: str
    centre_ws: tuple[float, float, float]
    half_m: float
    pinhole_ws: tuple[float, float, float]
    interfaces: int

    def camera(self) -> Camera:
        """An orthographic camera that sees exactly the square, straight from above."""
        x, y, z = self.centre_ws
        return Camera.look_at((x, y + 1.0, z), self.centre_ws, (0, 0, -1), orthographic=True, ymag_m=self.half_m)

    def edges_m(self, pixels: int) -> tuple[FloatArray, FloatArray]:
        """Pixel edges along x and z, each (pixels + 1,)."""
        x, _, z = self.centre_ws
        span = np.linspace(-self.half_m, self.half_m, pixels + 1)
        return x + span, z + span


TARGETS: dict[str, Target] = {
    t.scene: t
    for t in (
        Target("pool", (0.0, -1.66, -1.25), 1.0, (0.0, -0.9, -1.25), 1),
        Target("peer-pool", (0.15, -1.0, 0.08), 0.5, (0.15, -0.5, 0.08), 1),
        Target("glass-sphere", (0.6, 0.0, -0.03), 0.35, (1.3, 0.6, 0.0), 2),
        Target("glass-bunny", (0.15, 0.0, 0.0), 0.08, (0.28, 0.18, 0.0), 2),
        Target("metal-ring", (0.3, 0.0, 0.1), 0.25, (0.1, 0.3, 0.05), 1),
    )
}


def target_of(scene: str) -> Target:
    """The target of a built-in scene. Raises UsageError for a scene that has none."""
    if scene not in TARGETS:
        raise UsageError(f"scene '{scene}' has no target", where="bench", remedy=f"measured are: {', '.join(TARGETS)}")
    return TARGETS[scene]


def bench_scene(name: str) -> Scene:
    """The scene that every tool gets: water at rest at time 0, media clear, surfaces smooth.

    Absorption is left out, since Mitsuba's `ptracer` knows no media, and roughness, which not every method follows; our
    own tests hold both.
    """
    scene = load_scene(name)
    instances = tuple(
        replace(i, material=_plain(i.material)) if i.optical_kind in SPECULAR else i for i in scene.instances_at(0.0)
    )
    return replace(scene, instances=instances, waters=(), camera_at=None)


def _plain(material: Material) -> Material:
    return replace(material, attenuation_color=(1.0, 1.0, 1.0), attenuation_distance_m=math.inf, roughness=0.0)


def casters(scene: Scene) -> list[Instance]:
    """The instances that refract or reflect light."""
    return [i for i in scene.instances_at(0.0) if i.optical_kind in SPECULAR]


def luminance(image: npt.ArrayLike) -> FloatArray:
    """(H, W, 3) -> (H, W), Rec. 709 weights; float64."""
    return np.asarray(np.asarray(image, np.float64) @ LUMINANCE)
