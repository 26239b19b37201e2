"""What every pass and method knows of the frame: the scene's analysis, the light views, and the state of one frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from glcaustics.passes.camera import CameraState
from glcaustics.passes.eye_medium import EyeMedium
from glcaustics.passes.fit_view import fit_view
from glcaustics.passes.geometry import SPECULAR_KINDS, GpuScene, boxes_of, points_of
from glcaustics.passes.grounds import grounds
from glcaustics.passes.light_views import LightView
from glcaustics.passes.receiver_views import ReceiverView, receiver_views
from glcaustics.passes.solid_contents import holds_opaque
from glcaustics.scene.model import FloatArray, Instance, Light, OpticalKind, Scene

SAMPLE_TIMES_S = (0.0, 1.3, 2.9, 5.3)  # where an animated water is looked at to bound its motion


@dataclass(eq=False)
class LightSetup:
    """One light and its views; a view is None where the scene does not need it.

    `receivers`: by name, BESIDE for reflected light and the light through solids, BELOW for the light through open
    surfaces.
    """

    index: int
    light: Light
    shadow: LightView | None = None
    caster: LightView | None = None
    receivers: dict[str, ReceiverView] = field(default_factory=dict)
    grounds: frozenset[int] = frozenset()  # identities of the instances that can throw no shadow

    def resource(self, name: str) -> str:
        """A resource of this light: "caster.normal_ws@0"."""
        return f"{name}@{self.index}"


@dataclass(eq=False)
class FrameSetup:
    """What stays the same from frame to frame: the scene, the size, the options, the light views.

    `shadow_size`: the shadow maps have about that^2 texels. `transmissive_shadows`: water and glass cut direct light,
    since a caustics method brings what arrives. `bounds_ws`: (2, 3), the receivers' box.
    """

    scene: Scene
    size: tuple[int, int]
    options: Mapping[str, Any]
    transmissive_shadows: bool
    seed: int = 0
    collect_stats: bool = True
    lights: list[LightSetup] = field(default_factory=list)
    static_instances: tuple[Instance, ...] = ()
    sampled_instances: tuple[Instance, ...] = ()
    bounds_ws: FloatArray = field(default_factory=lambda: np.zeros((2, 3)))
    scene_bounds_ws: FloatArray = field(default_factory=lambda: np.zeros((2, 3)))

    @staticmethod
    def analyse(
        scene: Scene, size: tuple[int, int], options: Mapping[str, Any], *, transmissive_shadows: bool, seed: int = 0
    ) -> FrameSetup:
        """Classify the scene and fit the views of its lights (NumPy only)."""
        setup = FrameSetup(scene, size, options, transmissive_shadows, seed)
        times = SAMPLE_TIMES_S if any(w.animated for w in scene.waters) else SAMPLE_TIMES_S[:1]
        setup.sampled_instances = tuple(
            Instance(w.name, w.mesh_at(t), w.material, w.world_from_object) for w in scene.waters for t in times
        )
        setup.static_instances = scene.instances
        everything = setup.instances()
        receivers = [i for i in everything if i.optical_kind is OpticalKind.DIFFUSE]
        setup.scene_bounds_ws = _box(points_of(everything))
        setup.bounds_ws = _box(points_of(receivers)) if receivers else setup.scene_bounds_ws
        setup.lights = [setup._light(i, light, everything) for i, light in enumerate(scene.lights)]
        return setup

    def instances(self) -> tuple[Instance, ...]:
        """All instances, animated waters at several times: what views must hold."""
        return self.static_instances + self.sampled_instances

    def kinds(self) -> set[OpticalKind]:
        """The optical kinds that occur."""
        return {instance.optical_kind for instance in self.instances()}

    @cached_property
    def opaque_inside(self) -> bool:
        """Whether the eye's rays may end on something opaque before they leave a solid."""
        return holds_opaque(self.instances())

    @property
    def has_specular(self) -> bool:
        return any(kind in SPECULAR_KINDS for kind in self.kinds())

    @property
    def has_receivers(self) -> bool:
        return OpticalKind.DIFFUSE in self.kinds()

    @property
    def is_animated(self) -> bool:
        return any(w.animated for w in self.scene.waters)

    def _light(self, index: int, light: Light, everything: tuple[Instance, ...]) -> LightSetup:
        setup = LightSetup(index, light)
        if not light.shines:
            return setup
        points = points_of(everything)
        setup.grounds = grounds(everything, light)
        blockers = [i for i in everything if self.throws_shadow(i, setup)]
        if blockers:
            setup.shadow = fit_view(
                light, points_of(blockers), int(self.options["shadow_size"]), boxes_ws=boxes_of(blockers)
            )
        casters = [i for i in everything if i.optical_kind in SPECULAR_KINDS]
        if casters and self.has_receivers and "caster_size" in self.options:
            size = int(self.options["caster_size"])
            boxes = boxes_of(everything)
            setup.caster = fit_view(light, points_of(casters), size, depth_points_ws=points, boxes_ws=boxes)
            setup.receivers = receiver_views(everything, light, int(self.options["map_size"]))
        return setup

    def blocks_light(self, instance: Instance) -> bool:
        """Whether direct light ends at this instance."""
        return self.transmissive_shadows or instance.optical_kind in (OpticalKind.DIFFUSE, OpticalKind.MIRROR)

    def throws_shadow(self, instance: Instance, light: LightSetup) -> bool:
        """Whether an instance can cut this light off from something."""
        return self.blocks_light(instance) and id(instance) not in light.grounds


def _box(points: FloatArray) -> FloatArray:
    """(2, 3) bounding box, with a little air so that flat boxes have an inside."""
    if len(points) == 0:
        return np.array([[-1.0] * 3, [1.0] * 3])
    low, high = points.min(axis=0), points.max(axis=0)
    air = 1e-3 * float(np.linalg.norm(high - low))
    return np.stack([low - air, high + air])


@dataclass(eq=False)
class FrameState:
    """One frame: its time, its camera, the geometry on the GPU, the exposure, and the solves' statistics."""

    time_s: float
    camera: CameraState
    previous_camera: CameraState
    gpu: GpuScene
    exposure: float
    previous_transforms: Mapping[str, FloatArray] = field(default_factory=dict)
    index: int = 0  # frames and shifted samples drawn before this one
    eye_medium: EyeMedium | None = None  # the water or glass that the eye is in; None: air
    history_camera: CameraState | None = None  # of the last picture drawn, shifted or not: what histories were seen by

    def uniforms(self) -> dict[str, Any]:
        """Uniforms of `interface/camera.glsl`."""
        return self.camera.uniforms()
