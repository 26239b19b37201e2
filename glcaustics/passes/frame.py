"""What every pass and method knows of the frame: the scene's analysis, the light views, and the state of one frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import moderngl
import numpy as np

from glcaustics.errors import GraphError
from glcaustics.gpu import Device
from glcaustics.graph import Step, check_history, check_read, check_write
from glcaustics.passes.eye_medium import EyeMedium
from glcaustics.passes.geometry import SPECULAR_KINDS, GpuScene, boxes_of, points_of
from glcaustics.passes.light_views import LightView, fit_view, orthographic, perspective, unit
from glcaustics.scene.model import Camera, FloatArray, Instance, IntArray, Light, LightKind, OpticalKind, Scene

SAMPLE_TIMES_S = (0.0, 1.3, 2.9, 5.3)  # where an animated water is looked at to bound its motion


BESIDE, BELOW = (
    "beside",
    "below",
)  # receiver views: from the light itself; along the refracted light under a water surface


@dataclass(frozen=True, eq=False)
class ReceiverView:
    """The receivers as the light that lands on them sees them.

    `view.light` may be a virtual light: under water the light comes along the refracted direction (directional), or
    from the surface's image of the lamp (point, spot). Seen from the real light the deck would hide what it does reach.
    `inner_ndc`: of a core, the half extents of the part that counts, in clip space; light beyond it is looked up in the
    map around. `clip_plane`: (a, b, c, d); receivers where a x + b y + c z + d < 0 (above the water) are not drawn.
    """

    name: str
    view: LightView
    clip_plane: tuple[float, float, float, float] | None = None
    inner_ndc: tuple[float, float] | None = None

    @property
    def base(self) -> str:
        """BESIDE or BELOW: the view of which this is a core (or a core's core), or itself."""
        return self.name.split(CORE)[0]


CORE = ".core"  # suffix of the view over the small part of a window in which most of the light lands


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
        setup.grounds = _grounds(everything, light)
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


def _grounds(everything: tuple[Instance, ...], light: Light) -> frozenset[int]:
    """Identities of the instances that can throw no shadow: floors and walls at the scene's far side.

    A plane separates such a convex body from everything else and from the light, so that no ray from the light to
    anything else meets it; and a convex body throws no shadow on its own lit side. Kept out of the shadow map, a wide
    floor does not thin out its texels.
    """
    parts = [instance.positions_ws() for instance in everything]
    found = set()
    for index, (instance, points) in enumerate(zip(everything, parts, strict=True)):
        others = parts[:index] + parts[index + 1 :]
        if len(instance.mesh.triangles) <= 64 and _is_behind_all(points, instance.mesh.triangles, others, light):
            found.add(id(instance))
    return frozenset(found)


def _is_behind_all(points: FloatArray, triangles: IntArray, others: list[FloatArray], light: Light) -> bool:
    a, b, c = (points[triangles[:, i].astype(np.int64)] for i in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    faces = lengths > 1e-12 * extent * extent
    normals, origins = normals[faces] / lengths[faces, None], a[faces]
    beyond = points @ normals.T - np.sum(normals * origins, axis=1)
    if not len(normals) or float(beyond.max()) > 1e-4 * extent:
        return False  # not convex
    for normal, origin in _unique_planes(normals, origins, flat=float(np.abs(beyond).max()) <= 1e-4 * extent):
        if light.kind is LightKind.DIRECTIONAL:
            side = -float(np.asarray(light.direction_ws) @ normal)
        else:
            side = float((np.asarray(light.position_ws) - origin) @ normal)
        if side > 0.0 and all(float(((p - origin) @ normal).min()) > -1e-4 * extent for p in others):
            return True
    return False


def _unique_planes(normals: FloatArray, origins: FloatArray, *, flat: bool) -> list[tuple[FloatArray, FloatArray]]:
    """Face planes without repetition; a flat sheet has two sides."""
    _, first = np.unique(np.round(normals, 5), axis=0, return_index=True)
    planes = [(normals[k], origins[k]) for k in first]
    return planes + [(-n, o) for n, o in planes] if flat else planes


def receiver_views(everything: tuple[Instance, ...], light: Light, texels: int) -> dict[str, ReceiverView]:
    """The receiver views that the scene's specular surfaces call for, fitted to all receivers."""
    diffuse = [i for i in everything if i.optical_kind is OpticalKind.DIFFUSE]
    receivers, boxes = points_of(diffuse), boxes_of(diffuse)
    interfaces = [i for i in everything if i.optical_kind is OpticalKind.INTERFACE]
    views = {BESIDE: ReceiverView(BESIDE, fit_view(light, receivers, texels, boxes_ws=boxes))}
    if interfaces:
        virtual, plane = light_below(interfaces, light)
        under = receivers if plane is None else receivers[receivers @ np.asarray(plane[:3]) + plane[3] > 0.0]
        if plane is not None and len(under) == 0:
            under = receivers
        views[BELOW] = ReceiverView(BELOW, fit_view(virtual, under, texels, boxes_ws=boxes), plane)
    return views


def light_below(interfaces: list[Instance], light: Light) -> tuple[Light, tuple[float, float, float, float] | None]:
    """The light as it comes through a nearly flat water surface, and the plane above which nothing receives it.

    Directional: refracted at the mean normal. Point and spot: the paraxial image of the lamp, n times as
    high above the surface (Hecht 2017, sec. 5.2). Surfaces that are not nearly one plane: the light itself, no plane.
    """
    points = points_of(interfaces)
    normal = unit(sum((_mean_normal(i) for i in interfaces), np.zeros(3)) + 1e-12)
    heights = points @ normal
    low, high = float(heights.min()), float(heights.max())
    if high - low > 0.25 * float(np.linalg.norm(np.ptp(points, axis=0))):
        return light, None
    ior = float(np.mean([i.material.ior for i in interfaces]))
    if light.kind is LightKind.DIRECTIONAL:
        d = unit(np.asarray(light.direction_ws, np.float64))
        above = float(d @ normal) < 0.0
    else:
        above = float(np.asarray(light.position_ws) @ normal) > high
        if not above and float(np.asarray(light.position_ws) @ normal) > low:
            return light, None  # the lamp hangs among the waves
    n, eta = (normal, ior) if above else (-normal, 1.0 / ior)
    edge = high if above else -low
    plane = (-float(n[0]), -float(n[1]), -float(n[2]), edge)
    if light.kind is LightKind.DIRECTIONAL:
        cos_i = max(-float(d @ n), 1e-3)
        k = 1.0 - (1.0 - cos_i * cos_i) / (eta * eta)
        if k <= 0.0:
            return light, plane  # mean surface reflects totally; waves may still let some through
        bent = d / eta + n * (cos_i / eta - np.sqrt(k))
        return replace(light, direction_ws=(float(bent[0]), float(bent[1]), float(bent[2]))), plane
    position = np.asarray(light.position_ws, np.float64)
    height = float(position @ n) - edge
    image = position + n * (height * (eta - 1.0))
    # A spot's axis and cone bend too; a cone that is too wide costs texels, one that is too narrow would cost light.
    virtual = replace(light, kind=LightKind.POINT, position_ws=(float(image[0]), float(image[1]), float(image[2])))
    return virtual, plane


def _mean_normal(instance: Instance) -> FloatArray:
    """Area-weighted normal of an open surface, by its vertex normals' side, not of unit length."""
    points, triangles = instance.positions_ws(), instance.mesh.triangles.astype(np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.asarray(np.cross(b - a, c - a).sum(axis=0))


def _near_m(world_from_camera: FloatArray, lens: tuple[float, float], boxes_ws: FloatArray) -> float:
    """How far off the near plane may stand, metres: before the nearest box (N, 2, 3) that reaches in front of the eye.

    The scene's size alone would push the plane past everything that stands on a huge ground. Inside of a box its own
    size decides.
    """
    eye, forward = world_from_camera[:3, 3], -world_from_camera[:3, 2]
    low, high = boxes_ws[:, 0], boxes_ws[:, 1]
    reach = np.where(forward > 0.0, high, low) @ forward - eye @ forward
    start = np.where(forward > 0.0, low, high) @ forward - eye @ forward
    away = np.linalg.norm(np.maximum(np.maximum(low - eye, eye - high), 0.0), axis=1)
    corner = 1.0 / np.sqrt(1.0 + lens[0] ** 2 + lens[1] ** 2)  # cosine of the ray farthest off the axis
    inside = 5e-4 * np.linalg.norm(high - low, axis=1)
    near = np.maximum(0.999 * np.maximum(start, away * corner), np.where(away > 0.0, 0.0, inside))
    near = np.where(reach > 0.0, near, np.inf)
    touching = 2e-4 * float(
        np.quantile(np.linalg.norm(high - low, axis=1), 0.25, method="lower")
    )  # the eye on a surface
    return max(float(near.min()), touching)


def _box(points: FloatArray) -> FloatArray:
    """(2, 3) bounding box, with a little air so that flat boxes have an inside."""
    if len(points) == 0:
        return np.array([[-1.0] * 3, [1.0] * 3])
    low, high = points.min(axis=0), points.max(axis=0)
    air = 1e-3 * float(np.linalg.norm(high - low))
    return np.stack([low - air, high + air])


@dataclass(eq=False)
class CameraState:
    """Matrices of one camera at one time, column-vector form; uniforms of `interface/camera.glsl`."""

    world_from_camera: FloatArray
    camera_from_world: FloatArray
    clip_from_world: FloatArray
    lens: tuple[float, float, float, float]
    orthographic: bool
    jitter_uv: tuple[float, float] = (0.0, 0.0)

    @staticmethod
    def make(
        camera: Camera,
        size: tuple[int, int],
        bounds_ws: FloatArray,
        jitter_px: tuple[float, float] = (0.0, 0.0),
        boxes_ws: FloatArray | None = None,
    ) -> CameraState:
        """Clip planes fitted to the scene's box, so that depth is well conditioned at any scale.

        Args:
            boxes_ws: (N, 2, 3), a box an object: the near plane stands before the nearest, however large the scene is.
            jitter_px: shift of the picture by a part of a pixel, for anti-aliasing over several samples.
        """
        world_from_camera = np.asarray(camera.world_from_camera, np.float64)
        camera_from_world = np.linalg.inv(world_from_camera)
        corners = np.array(
            [[bounds_ws[i, 0], bounds_ws[j, 1], bounds_ws[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
        )
        depth = -(corners @ camera_from_world[2, :3] + camera_from_world[2, 3])
        extent = float(np.linalg.norm(bounds_ws[1] - bounds_ws[0]))
        far = max(float(depth.max()), 1e-3 * extent) * 1.001 + 1e-3 * extent
        aspect = size[0] / size[1]
        if camera.orthographic:
            near = float(depth.min()) - 1e-3 * extent
            lens = (camera.ymag_m * aspect, camera.ymag_m)
            projection = orthographic(-lens[0], lens[0], -lens[1], lens[1], near, far)
        else:
            tangent = float(np.tan(0.5 * camera.yfov_rad))
            lens = (tangent * aspect, tangent)
            boxes = bounds_ws[None] if boxes_ws is None or len(boxes_ws) == 0 else boxes_ws
            near = max(float(depth.min()) * 0.999, min(_near_m(world_from_camera, lens, boxes), 0.5 * far), 1e-7 * far)
            projection = perspective(-lens[0], lens[0], -lens[1], lens[1], near, far)
        jitter_uv = (jitter_px[0] / size[0], jitter_px[1] / size[1])
        shift = np.eye(4)
        shift[0, 3], shift[1, 3] = 2.0 * jitter_uv[0], 2.0 * jitter_uv[1]
        return CameraState(
            world_from_camera,
            camera_from_world,
            shift @ projection @ camera_from_world,
            (*lens, 1.0 if camera.orthographic else 0.0, 0.0),
            camera.orthographic,
            jitter_uv,
        )

    def uniforms(self) -> dict[str, Any]:
        forward = -unit(self.world_from_camera[:3, 2])
        return {
            "u_world_from_camera": self.world_from_camera,
            "u_camera_lens": self.lens,
            "u_camera_jitter": self.jitter_uv,
            "u_camera_clip_from_world": self.clip_from_world,
            "u_camera_from_world": self.camera_from_world,
            "u_eye_ws": tuple(self.world_from_camera[:3, 3]),
            "u_eye_direction": (*forward, 1.0 if self.orthographic else 0.0),
        }


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
        return self.camera.uniforms()


class PassContext:
    """What a pass gets to execute with: its textures and targets, and nothing that it did not declare."""

    def __init__(
        self,
        step: Step,
        device: Device,
        setup: FrameSetup,
        frame: FrameState,
        textures: Mapping[str, moderngl.Texture],
        framebuffers: dict[tuple[int, ...], moderngl.Framebuffer],
        history: Mapping[str, moderngl.Texture] | None = None,
    ) -> None:
        self.step = step
        self.device = device
        self.setup = setup
        self.frame = frame
        self._textures = textures
        self._framebuffers = framebuffers
        self._history = history or {}

    def history(self, resource: str) -> moderngl.Texture:
        """A declared history: the resource as the last frame left it, zero before the first.

        Raises:
            GraphError: not declared.
        """
        check_history(self.step, resource)
        return self._history[resource]

    def texture(self, resource: str) -> moderngl.Texture:
        """A declared read, or what an earlier draw of the same pass wrote. Raises GraphError otherwise."""
        if resource not in self.step.live_writes:
            check_read(self.step, resource)
        return self._textures[resource]

    def has(self, resource: str) -> bool:
        """Whether a declared optional read is there."""
        return resource in self.step.readable

    def live(self, resource: str) -> bool:
        """Whether somebody reads this attachment."""
        if resource not in self.step.decl.writes:
            raise GraphError(f"pass '{self.step.name}' asks for '{resource}', which it does not write")
        return resource in self.step.live_writes

    def target(self, *resources: str, depth: str | None = None) -> moderngl.Framebuffer:
        """A framebuffer of the live ones among the attachments, in order. Kept from frame to frame.

        `depth`: written by this pass, or a declared read to test against (draw without writing it).
        """
        for resource in (*resources, *([depth] if depth and depth not in self.step.readable else [])):
            if resource not in self.step.decl.writes:
                check_write(self.step, resource)
        colors = [self._textures[r] for r in resources if r in self.step.live_writes]
        depth_texture = self._textures[depth] if depth is not None else None
        key = tuple(t.glo for t in (*colors, *([depth_texture] if depth_texture else [])))
        found = self._framebuffers.get(key)
        if found is None:
            found = self._framebuffers[key] = self.device.framebuffer(colors, depth_texture, self.step.name)
        return found

    def locations(self, **outputs: str) -> dict[str, int]:
        """Defines HAS_X and LOCATION_X for each live attachment, HAS_X 0 for the others; outputs: X -> resource."""
        defines: dict[str, int] = {}
        location = 0
        for name, resource in outputs.items():
            defines[f"HAS_{name}"] = int(self.live(resource))
            if self.live(resource):
                defines[f"LOCATION_{name}"] = location
                location += 1
        return defines
