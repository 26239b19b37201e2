"""The scene as plain data: frozen dataclasses of NumPy arrays, no OpenGL.

Conventions (one place): metres, right-handed, +Y up (glTF). Matrices are 4x4 float64 in column-vector form
(`p_ws = M @ p`, translation in the last column). A camera and a spot light look down their own -Z. Colours are linear
RGB. Photometric units: lux for directional lights, candela for point and spot lights, so that irradiance is in lux and
radiance in cd/m^2; read W/m^2, W/sr and W/(m^2 sr) if the lights are given radiometrically. The code never converts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.floating]
IntArray = npt.NDArray[np.integer]

MIRROR_MAX_ROUGHNESS = 0.3  # metallic with roughness <= 0.3 reflects caustics
MIRROR_MIN_METALLIC = 0.5
MIN_TRANSMISSION = 0.5  # a surface that lets less than half of the light through is treated as opaque


class OpticalKind(Enum):
    """What light does at a surface."""

    DIFFUSE = "diffuse"  # receives caustics
    MIRROR = "mirror"  # metal, roughness <= 0.3: one reflection
    SOLID = "solid"  # watertight transmissive mesh: two interfaces
    INTERFACE = "interface"  # open transmissive sheet: one interface, denser medium opposite its normals


@dataclass(frozen=True, eq=False)
class Image:
    """A texture image. `pixels`: (H, W, 3|4) uint8 or float32, row 0 on top. `srgb`: colours are sRGB encoded.

    Texture coordinates follow glTF: (0, 0) is the upper left corner of the image; wrap mode is repeat.
    """

    name: str
    pixels: npt.NDArray[np.generic]
    srgb: bool


@dataclass(frozen=True, eq=False)
class Material:
    """glTF 2.0 metallic-roughness with the transmission, ior, volume, dispersion and emissive-strength extensions.

    `emissive`: radiance, cd/m^2 (strength already multiplied in). `attenuation_distance_m`: distance at which white
    light has become `attenuation_color`; `inf` = clear. `dispersion`: KHR_materials_dispersion, 20 / Abbe number; 0 =
    none.
    """

    name: str = "default"
    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)
    base_color_image: Image | None = None
    metallic: float = 0.0
    roughness: float = 1.0
    metallic_roughness_image: Image | None = None  # G = roughness, B = metallic
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emissive_image: Image | None = None
    transmission: float = 0.0
    ior: float = 1.5
    attenuation_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    attenuation_distance_m: float = math.inf
    dispersion: float = 0.0
    double_sided: bool = False

    @property
    def sigma_a(self) -> FloatArray:
        """Absorption coefficient (3,), 1/m: `exp(-sigma_a d)` is Beer-Lambert's transmittance over d metres."""
        if math.isinf(self.attenuation_distance_m):
            return np.zeros(3)
        color = np.clip(np.asarray(self.attenuation_color, dtype=np.float64), 1e-6, 1.0)
        return -np.log(color) / self.attenuation_distance_m

    def ior_rgb(self) -> FloatArray:
        """Index of refraction (3,) of the red, green and blue channel (KHR_materials_dispersion)."""
        half = (self.ior - 1.0) * 0.025 * self.dispersion
        return np.array([self.ior - half, self.ior, self.ior + half])


@dataclass(frozen=True, eq=False)
class Mesh:
    """Indexed triangles in object space.

    `positions_m`, `normals`: (V, 3) float32, normals of unit length; `uv`: (V, 2) float32; `triangles`: (T, 3) uint32,
    counter-clockwise seen from outside. `watertight`: every edge shared by two triangles with opposite directions
    (after welding vertices of equal position).
    """

    name: str
    positions_m: FloatArray
    normals: FloatArray
    uv: FloatArray
    triangles: IntArray
    watertight: bool


@dataclass(frozen=True, eq=False)
class Instance:
    """A mesh with a material, placed in the world."""

    name: str
    mesh: Mesh
    material: Material
    world_from_object: FloatArray = field(default_factory=lambda: np.eye(4))

    @property
    def optical_kind(self) -> OpticalKind:
        material = self.material
        if material.transmission >= MIN_TRANSMISSION and material.metallic < MIRROR_MIN_METALLIC:
            return OpticalKind.SOLID if self.mesh.watertight else OpticalKind.INTERFACE
        if material.metallic >= MIRROR_MIN_METALLIC and material.roughness <= MIRROR_MAX_ROUGHNESS:
            return OpticalKind.MIRROR
        return OpticalKind.DIFFUSE

    def positions_ws(self) -> FloatArray:
        """Vertex positions in world space, (V, 3) float64, metres."""
        m = self.world_from_object
        return self.mesh.positions_m.astype(np.float64) @ m[:3, :3].T + m[:3, 3]


class LightKind(Enum):
    DIRECTIONAL = "directional"
    POINT = "point"
    SPOT = "spot"


@dataclass(frozen=True)
class Light:
    """KHR_lights_punctual, and a size. `intensity`: lux (directional: irradiance on a perpendicular plane) or candela.

    `direction_ws`: unit vector the light travels along (unused by point lights). Cone angles are half angles, radians;
    the fall-off between them is glTF's, about the light's centre.

    Size, 0 = none: `radius_m` of a point or spot light makes it a sphere of even radiance intensity / (pi radius^2),
    which has that intensity in every direction; `angular_diameter_rad` of a directional one makes it an even disc in
    the sky of the same irradiance on a plane perpendicular to `direction_ws`.
    """

    kind: LightKind
    name: str = "light"
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    position_ws: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction_ws: tuple[float, float, float] = (0.0, -1.0, 0.0)
    inner_cone_rad: float = 0.0
    outer_cone_rad: float = math.pi / 4
    radius_m: float = 0.0
    angular_diameter_rad: float = 0.0

    @property
    def has_size(self) -> bool:
        """Whether it is more than a point: its shadows and caustics are soft."""
        is_directional = self.kind is LightKind.DIRECTIONAL
        return (self.angular_diameter_rad if is_directional else self.radius_m) > 0.0

    @property
    def shines(self) -> bool:
        """Whether it gives any light at all."""
        return self.intensity > 0.0 and any(c > 0.0 for c in self.color)


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole or an orthographic camera, looking down its own -Z with +Y up.

    `yfov_rad`: full vertical angle (perspective). `ymag_m`: half the height of the view (orthographic); the width
    follows from the aspect ratio of the picture. The clip planes are fitted to the scene by the renderer.
    """

    world_from_camera: FloatArray
    yfov_rad: float = math.radians(45.0)
    orthographic: bool = False
    ymag_m: float = 1.0

    @staticmethod
    def look_at(
        eye: npt.ArrayLike,
        target: npt.ArrayLike,
        up: npt.ArrayLike = (0.0, 1.0, 0.0),
        *,
        yfov_rad: float = math.radians(45.0),
        orthographic: bool = False,
        ymag_m: float = 1.0,
    ) -> Camera:
        """A camera at `eye` (3,) that looks at `target` (3,), metres, world space."""
        eye_ws, target_ws = np.asarray(eye, np.float64), np.asarray(target, np.float64)
        back = eye_ws - target_ws
        back /= np.linalg.norm(back)
        up_ws = np.asarray(up, np.float64)
        right = np.cross(up_ws, back)
        if np.linalg.norm(right) < 1e-6 * np.linalg.norm(up_ws):  # looking along `up`: any other axis will do
            right = np.cross(np.array([0.0, 0.0, -1.0]), back)
        right /= np.linalg.norm(right)
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, np.cross(back, right), back, eye_ws
        return Camera(matrix, yfov_rad=yfov_rad, orthographic=orthographic, ymag_m=ymag_m)

    @property
    def position_ws(self) -> FloatArray:
        return np.asarray(self.world_from_camera[:3, 3])


@dataclass(frozen=True)
class Sky:
    """Radiance of what lies beyond the scene, cd/m^2: a blend from `ground` over `horizon` to `zenith`."""

    zenith: tuple[float, float, float] = (0.0, 0.0, 0.0)
    horizon: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ground: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class WaterBody:
    """A water surface that moves: `mesh_at(time_s)` gives its mesh (an open sheet, normals up) in object space."""

    name: str
    material: Material
    mesh_at: Callable[[float], Mesh]
    world_from_object: FloatArray = field(default_factory=lambda: np.eye(4))
    animated: bool = True


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that the renderer needs, and where it came from.

    `camera_at(time_s)` overrides `camera` when given. `announcements`: what the loader had to assume, one line each.
    `exposure`: factor from radiance to the tone mapper's input; None = from the lights, by the renderer.
    """

    name: str
    instances: tuple[Instance, ...]
    lights: tuple[Light, ...]
    camera: Camera
    waters: tuple[WaterBody, ...] = ()
    sky: Sky = Sky()
    camera_at: Callable[[float], Camera] | None = None
    exposure: float | None = None
    method: str | None = None
    quality: str | None = None
    announcements: tuple[str, ...] = ()
    licence: str = ""
    purpose: str = ""

    def instances_at(self, time_s: float) -> tuple[Instance, ...]:
        """The instances at a time: static ones keep their identity, waters get a fresh mesh."""
        waters = (Instance(w.name, w.mesh_at(time_s), w.material, w.world_from_object) for w in self.waters)
        return self.instances + tuple(waters)

    def view_at(self, time_s: float) -> Camera:
        """The camera at a time."""
        return self.camera_at(time_s) if self.camera_at is not None else self.camera
