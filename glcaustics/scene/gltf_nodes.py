"""glTF's node hierarchy, lights and cameras: what stands where in the world."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from glcaustics.scene.gltf_file import GltfFile
from glcaustics.scene.gltf_json import Json
from glcaustics.scene.limits import MAX_ANGULAR_DIAMETER_DEG, MAX_COORDINATE_M
from glcaustics.scene.model import Camera, FloatArray, Light, LightKind

AGAIN = "export the file again"
IDENTITY = tuple(float(x) for x in np.eye(4).ravel())


@dataclass(frozen=True, eq=False)
class PlacedNode:
    """A node of the scene with its world transform, 4x4 float64."""

    item: Json
    world_from_node: FloatArray


def placed_nodes(file: GltfFile) -> Iterator[PlacedNode]:
    """The nodes of the file's scene, parents before children.

    Raises:
        SceneError: a node that does not exist, or is reached twice (a cycle, or two parents).
    """
    nodes = file.root.objects("nodes")
    children = [node.indices("children", len(nodes), "nodes") for node in nodes]
    seen: set[int] = set()
    stack = [(number, np.eye(4)) for number in reversed(_roots(file, children))]
    while stack:
        number, world_from_parent = stack.pop()
        if number in seen:
            raise nodes[number].error("it is reached twice: the nodes are not a tree but have a cycle", AGAIN)
        seen.add(number)
        world_from_node = world_from_parent @ _local_matrix(nodes[number])
        if not np.abs(world_from_node).max() <= MAX_COORDINATE_M:
            raise nodes[number].error(f"its world transform goes beyond {MAX_COORDINATE_M:g} m", "scale the scene down")
        yield PlacedNode(nodes[number], world_from_node)
        stack.extend((child, world_from_node) for child in reversed(children[number]))


def _roots(file: GltfFile, children: list[list[int]]) -> list[int]:
    scenes = file.root.objects("scenes")
    chosen = file.root.index("scene", len(scenes), "scenes")
    if scenes:
        if len(scenes) > 1:
            file.announce(f"the file has {len(scenes)} scenes; '{scenes[chosen or 0].name}' is shown")
        return scenes[chosen or 0].indices("nodes", len(children), "nodes")
    with_parent = {child for some in children for child in some}
    roots = [number for number in range(len(children)) if number not in with_parent]
    if children and not roots:
        raise file.root.objects("nodes")[0].error("every node has a parent: the nodes have a cycle", AGAIN)
    return roots


def _local_matrix(node: Json) -> FloatArray:
    """parent_from_node, 4x4, from `matrix` (column by column) or translation, rotation and scale."""
    if "matrix" in node.value:
        matrix = np.array(node.floats("matrix", IDENTITY)).reshape(4, 4).T
        if np.any(np.abs(matrix[3] - (0.0, 0.0, 0.0, 1.0)) > 1e-6):
            raise node.error("the last row of 'matrix' is not 0 0 0 1", AGAIN)
        return matrix
    matrix = np.eye(4)
    x, y, z, w = node.floats("rotation", (0.0, 0.0, 0.0, 1.0))
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if length == 0.0:
        raise node.error("'rotation' is a zero quaternion", AGAIN)
    x, y, z, w = x / length, y / length, z / length, w / length
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix[:3, :3] = rotation * np.array(node.floats("scale", (1.0, 1.0, 1.0)))
    matrix[:3, 3] = node.floats("translation", (0.0, 0.0, 0.0))
    return matrix


def read_light(file: GltfFile, node: PlacedNode) -> Light | None:
    """The punctual light of a node (KHR_lights_punctual: looks down the node's -Z); None if there is none."""
    extension = node.item.extension("KHR_lights_punctual")
    if extension is None:
        return None
    root = file.root.extension("KHR_lights_punctual")
    items = root.objects("lights") if root is not None else []
    number = extension.index("light", len(items), "lights")
    if number is None:
        raise extension.error("it names no light", AGAIN)
    item = items[number]
    kind = item.text("type")
    if kind not in ("directional", "point", "spot"):
        raise item.error(f"light type '{kind}' is unknown", "use directional, point or spot")
    intensity = item.number("intensity", 1.0, low=0.0)
    color = item.floats("color", (1.0, 1.0, 1.0))
    if intensity == 0.0 or not any(color):
        file.announce(f"light '{item.name}' is dark and left out")
        return None
    if "range" in item.value and kind != "directional":
        file.announce(f"light '{item.name}': its range is left out, light falls off with the square of the distance")
    forward = -node.world_from_node[:3, 2]
    length = float(np.linalg.norm(forward))
    if kind != "point" and not length > 0.0:
        raise node.item.error("its light has no direction, as its scale is 0", "set the scale to 1")
    x, y, z = (forward / length if length > 0.0 else np.array([0.0, -1.0, 0.0])).tolist()
    px, py, pz = node.world_from_node[:3, 3].tolist()
    inner, outer = _cone(file, item) if kind == "spot" else (0.0, math.pi / 4)
    name = item.name if item.value.get("name") else node.item.name
    rgb = (color[0], color[1], color[2])
    size = _size(file, item, node.item, kind)
    return Light(LightKind(kind), name, rgb, intensity, (px, py, pz), (x, y, z), inner, outer, **size)


def _size(file: GltfFile, item: Json, node: Json, kind: str) -> dict[str, float]:
    """A light's size from `extras` of the light, else of its node: KHR_lights_punctual has none, and Blender does not
    write its lights' radius and angle, but it writes custom properties as extras.
    """
    key, other = ("angular_diameter_deg", "radius_m") if kind == "directional" else ("radius_m", "angular_diameter_deg")
    value = None
    for owner in (item, node):
        extras = owner.value.get("extras")
        if not isinstance(extras, dict):  # any JSON is allowed there
            continue
        if value is None and key in extras:
            high = MAX_ANGULAR_DIAMETER_DEG if kind == "directional" else MAX_COORDINATE_M
            value = Json(extras, f"{owner.path}.extras", owner.where).number(key, 0.0, 0.0, high)
        if owner is item and other in extras:
            file.announce(f"light '{item.name}': its {other} is left out, as a {kind} light has {key}")
    if not value:
        return {}
    return {"angular_diameter_rad": math.radians(value)} if kind == "directional" else {"radius_m": value}


def _cone(file: GltfFile, item: Json) -> tuple[float, float]:
    """Inner and outer half angle, radians."""
    spot = item.obj("spot") or Json({}, f"{item.path}.spot", item.where)
    inner = spot.number("innerConeAngle", 0.0, 0.0)
    outer = spot.number("outerConeAngle", math.pi / 4, 0.0)
    if not 0.0 < outer <= math.pi / 2 + 1e-6:
        raise spot.error(f"'outerConeAngle' is {outer:g} rad", "give a half angle above 0 and up to pi/2")
    outer = min(outer, math.pi / 2)
    if inner >= outer:
        file.announce(f"light '{item.name}': its inner cone is as wide as the outer one and made a little narrower")
        inner = 0.99 * outer
    return inner, outer


def read_camera(file: GltfFile, node: PlacedNode) -> Camera | None:
    """The camera of a node, its scale taken out; None if there is none."""
    cameras = file.root.objects("cameras")
    number = node.item.index("camera", len(cameras), "cameras")
    if number is None:
        return None
    item = cameras[number]
    matrix = _rigid(node)
    kind = item.text("type")
    lens = item.obj(kind) if kind in ("perspective", "orthographic") else None
    if lens is None:
        raise item.error(f"camera type '{kind}' is unknown or has no values", "use perspective or orthographic")
    if kind == "perspective":
        yfov_rad = lens.number("yfov", math.nan)
        if not 0.0 < yfov_rad < math.pi:
            raise lens.error(f"'yfov' is {yfov_rad:g} rad", "give an angle between 0 and pi")
        return Camera(matrix, yfov_rad=yfov_rad)
    ymag_m = abs(lens.number("ymag", 0.0))
    if ymag_m == 0.0:
        raise lens.error("'ymag' is missing or 0", "give half the height of the view, metres")
    return Camera(matrix, orthographic=True, ymag_m=ymag_m)


def _rigid(node: PlacedNode) -> FloatArray:
    """world_from_camera with orthonormal axes: the view direction is kept, then up."""
    back, up = node.world_from_node[:3, 2], node.world_from_node[:3, 1]
    right = np.cross(up, back)
    if not (np.linalg.norm(right) > 1e-6 * np.linalg.norm(up) * np.linalg.norm(back)):
        raise node.item.error("its camera's transform is singular", "set the scale to 1")
    back, right = back / np.linalg.norm(back), right / np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = right, np.cross(back, right), back
    matrix[:3, 3] = node.world_from_node[:3, 3]
    return matrix
