"""glTF 2.0 scenes (.gltf, .glb), as Blender and other tools export them.

Read from JSON and binary chunks directly: trimesh drops the material extensions and invents lights. What a watertight,
an open and a metallic mesh become is told by `Instance.optical_kind`; what a file lacks comes from `scene.defaults`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glcaustics.errors import SceneError
from glcaustics.scene.defaults import complete
from glcaustics.scene.gltf_file import GltfFile, open_gltf
from glcaustics.scene.gltf_mesh import MeshReader
from glcaustics.scene.gltf_nodes import PlacedNode, placed_nodes, read_camera, read_light
from glcaustics.scene.limits import check_limits
from glcaustics.scene.model import Camera, FloatArray, Instance, Light, Mesh, Scene
from glcaustics.scene.validate import validate_scene

SINGULAR = 1e-7  # smallest over largest scale below which a transform flattens


@dataclass(frozen=True, eq=False)
class GltfContents:
    """What stands in a glTF file, nothing added. `camera`: the first one, None if there is none."""

    instances: tuple[Instance, ...]
    lights: tuple[Light, ...]
    camera: Camera | None
    announcements: tuple[str, ...]
    copyright: str


def load_gltf(path: str | Path) -> Scene:
    """Load a glTF 2.0 file; lights, camera and sky that it lacks are supplied and announced.

    Args:
        path: a .gltf (buffers and images in files beside it or in data URIs) or a .glb file.

    Raises:
        SceneError: missing, broken or unsupported; the line names the file, the object and the remedy.
        ResourceLimitError: larger than `scene.limits` allow.
    """
    contents = read_gltf(path)
    where = Path(path).name
    defaults = complete(contents.instances, contents.lights, contents.camera, None)
    scene = Scene(
        name=Path(path).stem,
        instances=contents.instances,
        lights=defaults.lights,
        camera=defaults.camera,
        sky=defaults.sky,
        announcements=contents.announcements + defaults.announcements,
        licence=contents.copyright,
    )
    check_limits(scene, where=where)
    validate_scene(scene, where=where)
    return scene


def read_gltf(path: str | Path) -> GltfContents:
    """Read a glTF 2.0 file and add nothing to it: for scenes that take their objects from it.

    Raises:
        SceneError, ResourceLimitError: as `load_gltf`.
    """
    file = open_gltf(path)
    meshes = MeshReader(file)
    instances: list[Instance] = []
    lights: list[Light] = []
    cameras: list[tuple[str, Camera]] = []
    for node in placed_nodes(file):
        instances.extend(_instances(file, meshes, node))
        light = read_light(file, node)
        if light is not None:
            lights.append(light)
        camera = read_camera(file, node)
        if camera is not None:
            cameras.append((node.item.name, camera))
    if not instances:
        raise SceneError("it has no triangles to draw", where=file.root.where, remedy="add a mesh to its scene")
    if len(cameras) > 1:
        file.announce(f"the file has {len(cameras)} cameras; the first one, '{cameras[0][0]}', is used")
    if file.root.objects("animations"):
        file.announce("animations are not supported; the scene stands still")
    asset = file.root.obj("asset")
    return GltfContents(
        tuple(instances),
        tuple(lights),
        cameras[0][1] if cameras else None,
        tuple(file.announcements),
        asset.text("copyright") if asset is not None else "",
    )


def _instances(file: GltfFile, meshes: MeshReader, node: PlacedNode) -> list[Instance]:
    """One instance for every drawable primitive of the node's mesh."""
    item = node.item
    number = item.index("mesh", meshes.count, "meshes")
    if number is None:
        return []
    if "skin" in item.value:
        file.announce(f"node '{item.name}': skinning is not supported, the mesh is drawn unbent")
    matrix = node.world_from_node
    mirrored = bool(np.linalg.det(matrix[:3, :3] / max(np.abs(matrix[:3, :3]).max(), 1e-300)) < 0.0)
    if mirrored:  # the mesh is mirrored instead, so that every transform keeps its handedness
        matrix = matrix @ np.diag([-1.0, 1.0, 1.0, 1.0])
    found = []
    primitives = meshes.primitives(number, mirrored)
    name = item.name if item.value.get("name") else meshes.name(number)
    for part, primitive in enumerate(primitives):
        if primitive.mesh is None:
            continue
        placement = _regular(matrix, primitive.mesh)
        if placement is None:
            file.announce(f"node '{item.name}' is left out, as its scale flattens it to nothing")
            continue
        label = name if len(primitives) == 1 else f"{name}/{part}"
        found.append(Instance(label, primitive.mesh, primitive.material, placement))
    return found


def _regular(matrix: FloatArray, mesh: Mesh) -> FloatArray | None:
    """A transform that can be inverted and places the mesh as `matrix` does; None if there is none.

    Modellers may scale a flat mesh by 0 along its normal. It is as flat with any other scale there, so it gets one.
    """
    u, scale, v = np.linalg.svd(matrix[:3, :3])
    if scale[2] > SINGULAR * scale[0]:
        return matrix
    if scale[0] == 0.0 or scale[1] <= SINGULAR * scale[0]:
        return None
    points = mesh.positions_m.astype(np.float64)
    heights = points @ v[2]
    extent = float(np.ptp(points, axis=0).max())
    if np.ptp(heights) > 1e-5 * extent:
        return None
    sign = np.sign(np.linalg.det(u) * np.linalg.det(v))
    regular = matrix.copy()
    regular[:3, :3] += np.outer(sign * scale[1] * u[:, 2], v[2])
    regular[:3, 3] -= sign * scale[1] * u[:, 2] * heights.mean()
    return regular
