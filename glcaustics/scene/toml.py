"""Scene files in TOML: what glTF cannot carry (water, camera path, sky, method), and scenes of procedural shapes.

The reading is strict: an unknown key or table, a wrong type or a value out of range is a SceneError that names file,
table, key, value and remedy. Lengths are metres, angles degrees where the key says `_deg`, colours linear RGB.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as PillowImage

from glcaustics.errors import SceneError
from glcaustics.quality import QUALITIES
from glcaustics.scene.camera_path import CameraKey, camera_path
from glcaustics.scene.defaults import complete
from glcaustics.scene.gltf import GltfContents, read_gltf
from glcaustics.scene.limits import MAX_ANGULAR_DIAMETER_DEG, MAX_COORDINATE_M, check_image_size, check_limits
from glcaustics.scene.model import (
    MIN_TRANSMISSION,
    Camera,
    Image,
    Instance,
    Light,
    LightKind,
    Material,
    Scene,
    Sky,
)
from glcaustics.scene.strict_table import StrictTable
from glcaustics.scene.toml_objects import existing_file, read_object
from glcaustics.scene.toml_water import read_water
from glcaustics.scene.validate import validate_scene


def load_toml(path: str | Path, overrides: Mapping[str, Any] | None = None) -> Scene:
    """Read a scene file.

    Args:
        path: the .toml file; the files it names are looked up beside it.
        overrides: values to put in place of the file's, by dotted path, e.g. {"water[0].amplitude_scale": 0.5}.

    Objects of a glTF file named by `gltf` in [scene] come first; its lights and its camera count where the TOML has
    none of its own. What is missing then is supplied and announced; `light = []` says that darkness is meant.

    Raises:
        SceneError: file missing, not TOML, or not a valid scene.
        ResourceLimitError: larger than `scene.limits` allow.
    """
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as cause:
        raise SceneError(f"cannot be read ({cause.strerror})", where=str(path), remedy="check the path") from cause
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as cause:
        raise SceneError(f"is not TOML ({cause})", where=str(path), remedy="mend the syntax there") from cause
    for key, value in (overrides or {}).items():
        _override(data, key, value, str(path))
    scene = _read_scene(StrictTable(data, str(path)), path)
    check_limits(scene, where=str(path))
    validate_scene(scene, where=str(path))
    return scene


def _override(data: dict[str, Any], key: str, value: Any, file: str) -> None:
    parts = re.findall(r"[^.\[\]]+", key)
    here: Any = data
    for part in parts[:-1]:
        try:
            here = here[int(part)] if isinstance(here, list) else here[part]
        except (KeyError, IndexError, ValueError, TypeError):
            what = f"override '{key}': there is no '{part}'"
            raise SceneError(what, where=file, remedy="name a table of the file") from None
    if not isinstance(here, dict):
        raise SceneError(f"override '{key}' does not name a key of a table", where=file, remedy="write table[0].key")
    here[parts[-1]] = list(value) if isinstance(value, tuple) else value


def _read_scene(root: StrictTable, path: Path) -> Scene:
    folder = path.parent
    head = root.table("scene") or StrictTable({}, root.file, "scene")
    base = _read_gltf(head, folder)
    values: dict[str, Any] = {
        "name": head.text("name", folder.name if path.stem == "scene" else path.stem),
        "purpose": head.text("purpose", ""),
        "licence": head.text("licence", base.copyright),
        "method": head.text("method", None),
        "quality": head.text("quality", None, choices=QUALITIES),
        "exposure": head.number("exposure", None, above=0.0),
    }
    head.finish()
    sky_table, camera_table = root.table("sky"), root.table("camera")
    sky = _read_sky(sky_table) if sky_table is not None else None
    camera, camera_at = _read_camera(camera_table) if camera_table is not None else (base.camera, None)
    unlit = root.has("light") and root.data["light"] == []  # `light = []`: darkness is meant
    lights = tuple(_read_light(t, f"light{i}") for i, t in enumerate(root.tables("light"))) or base.lights
    materials = _read_materials(root, folder)
    instances = base.instances + _read_objects(root, folder, materials)
    waters = tuple(read_water(t, folder, materials, f"water{i}") for i, t in enumerate(root.tables("water")))
    root.finish()
    everything = (*instances, *(Instance(w.name, w.mesh_at(0.0), w.material, w.world_from_object) for w in waters))
    if not everything:
        raise root.error("the scene has no objects", "add [[object]], [[water]] or a gltf file")
    supplied = complete(everything, lights, camera, sky)
    announcements = supplied.announcements
    if unlit:
        announcements = tuple(note for note in announcements if "no light" not in note)
    return Scene(
        instances=instances,
        waters=waters,
        lights=() if unlit else supplied.lights,
        camera=supplied.camera,
        camera_at=camera_at,
        sky=supplied.sky,
        announcements=base.announcements + announcements,
        **values,
    )


def _read_gltf(head: StrictTable, folder: Path) -> GltfContents:
    """The glTF file that the scene builds on, or nothing."""
    if not head.has("gltf"):
        return GltfContents((), (), None, (), "")
    return read_gltf(existing_file(head, "gltf", folder))


def _read_sky(table: StrictTable) -> Sky:
    black = (0.0, 0.0, 0.0)
    zenith = table.vector("zenith", 3, black, low=0.0)
    sky = Sky(zenith, table.vector("horizon", 3, zenith, low=0.0), table.vector("ground", 3, black, low=0.0))
    table.finish()
    return sky


def _read_camera(table: StrictTable) -> tuple[Camera, Any]:
    up = table.vector("up", 3, (0.0, 1.0, 0.0))
    if not any(up):
        raise table.error("'up' is zero", "give a direction such as [0, 1, 0]")
    orthographic = table.boolean("orthographic", False)
    keys = table.tables("key")
    if keys:
        if orthographic:
            raise table.error("'orthographic' does not go with a path of keys", "leave one of them out")
        frames = _read_keys(table, keys)
        at = camera_path(frames, up)
        return at(frames[0].time_s), at
    eye, target = _eye_target(table)
    if orthographic:
        camera = Camera.look_at(eye, target, up, orthographic=True, ymag_m=table.number("ymag_m", above=0.0))
    else:
        camera = Camera.look_at(eye, target, up, yfov_rad=_yfov(table, 45.0))
    table.finish()
    return camera, None


def _eye_target(table: StrictTable) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    eye, target = table.vector("eye", 3), table.vector("target", 3)
    if math.dist(eye, target) == 0.0:
        raise table.error(f"'eye' and 'target' are both {list(eye)}", "move one of them")
    return eye, target


def _yfov(table: StrictTable, default_deg: float) -> float:
    return math.radians(table.number("yfov_deg", default_deg, above=0.0, high=175.0))


def _read_keys(table: StrictTable, keys: list[StrictTable]) -> list[CameraKey]:
    default = math.degrees(_yfov(table, 45.0))
    table.finish()
    frames: list[CameraKey] = []
    for key in keys:
        frame = CameraKey(key.number("time_s"), *_eye_target(key), _yfov(key, default))
        if frames and frame.time_s <= frames[-1].time_s:
            remedy = f"it must be greater than the one before, {frames[-1].time_s:g}"
            raise key.error(f"'time_s' is {frame.time_s:g}", remedy)
        key.finish()
        frames.append(frame)
    return frames


def _read_light(table: StrictTable, default_name: str) -> Light:
    kind = LightKind(table.text("kind", choices=[k.value for k in LightKind]))
    values: dict[str, Any] = {
        "name": table.text("name", default_name),
        "color": table.vector("color", 3, (1.0, 1.0, 1.0), low=0.0),
        "intensity": table.number("intensity", low=0.0),
    }
    if kind is not LightKind.DIRECTIONAL:
        values["position_ws"] = table.vector("position", 3)
        values["radius_m"] = table.number("radius_m", 0.0, low=0.0, high=MAX_COORDINATE_M)
    else:
        degrees = table.number("angular_diameter_deg", 0.0, low=0.0, high=MAX_ANGULAR_DIAMETER_DEG)
        values["angular_diameter_rad"] = math.radians(degrees)
    if kind is not LightKind.POINT:
        direction = np.array(table.vector("direction", 3))
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            raise table.error("'direction' is zero", "give the direction that the light travels along")
        values["direction_ws"] = tuple(float(d) for d in direction / length)
    if kind is LightKind.SPOT:
        outer = table.number("outer_cone_deg", 45.0, above=0.0, high=90.0)
        inner = table.number("inner_cone_deg", 0.0, low=0.0, high=90.0)
        if inner >= outer:
            raise table.error(f"'inner_cone_deg' is {inner:g}", f"it must be smaller than outer_cone_deg = {outer:g}")
        values["inner_cone_rad"], values["outer_cone_rad"] = math.radians(inner), math.radians(outer)
    table.finish()
    return Light(kind, **values)


def read_image(path: Path, *, srgb: bool) -> Image:
    """An image file as uint8 RGB or RGBA. Raises SceneError if Pillow cannot read it."""
    try:
        with PillowImage.open(path) as picture:
            check_image_size(path.name, *picture.size, where=str(path))
            alpha = picture.has_transparency_data
            pixels = np.asarray(picture.convert("RGBA" if alpha else "RGB"))
    except (OSError, ValueError, PillowImage.DecompressionBombError) as cause:
        raise SceneError(f"image cannot be read ({cause})", where=str(path), remedy="use a PNG or JPEG") from cause
    return Image(path.name, pixels, srgb)


def _read_materials(root: StrictTable, folder: Path) -> dict[str, Material]:
    materials: dict[str, Material] = {}
    for table in root.tables("material"):
        material = _read_material(table, folder)
        if material.name in materials:
            raise table.error(f"'name' is '{material.name}' a second time", "give each material its own name")
        materials[material.name] = material
    return materials


def _read_material(table: StrictTable, folder: Path) -> Material:
    def image(key: str, srgb: bool) -> Image | None:
        return read_image(existing_file(table, key, folder), srgb=srgb) if table.has(key) else None

    default = Material()
    transmission = table.number("transmission", default.transmission, low=0.0, high=1.0)
    rough = (
        default.roughness if transmission < MIN_TRANSMISSION else 0.0
    )  # who writes glass and no more means clear glass
    material = Material(
        name=table.text("name"),
        base_color=table.vector("base_color", 3, default.base_color, low=0.0, high=1.0),
        base_color_image=image("base_color_image", True),
        metallic=table.number("metallic", default.metallic, low=0.0, high=1.0),
        roughness=table.number("roughness", rough, low=0.0, high=1.0),
        metallic_roughness_image=image("metallic_roughness_image", False),
        emissive=table.vector("emissive", 3, default.emissive, low=0.0),
        emissive_image=image("emissive_image", True),
        transmission=transmission,
        ior=table.number("ior", default.ior, low=1.0, high=4.0),
        attenuation_color=table.vector("attenuation_color", 3, default.attenuation_color, low=0.0, high=1.0),
        attenuation_distance_m=table.number("attenuation_distance_m", math.inf, above=0.0, high=math.inf),
        dispersion=table.number("dispersion", default.dispersion, low=0.0, high=20.0),
        double_sided=table.boolean("double_sided", default.double_sided),
    )
    table.finish()
    return material


def _read_objects(root: StrictTable, folder: Path, materials: Mapping[str, Material]) -> tuple[Instance, ...]:
    instances: list[Instance] = []
    for i, table in enumerate(root.tables("object")):
        instances += read_object(table, folder, materials, f"object{i}")
    return tuple(instances)
