"""The project's limits: beyond them a scene is refused with a clear line instead of running out of memory half-way."""

from __future__ import annotations

from glcaustics.errors import ResourceLimitError
from glcaustics.scene.model import Image, Scene

MAX_FILE_BYTES = 2 << 30  # one scene file or buffer
MAX_MESH_VERTICES = 16_000_000  # one mesh: 32 bytes a vertex, so half a gigabyte
MAX_SCENE_VERTICES = 32_000_000  # the whole scene, instances counted
MAX_SCENE_TRIANGLES = 64_000_000
MAX_INSTANCES = 20_000  # one draw call each
MAX_ANGULAR_DIAMETER_DEG = 90.0  # of a directional light
MAX_LIGHTS = 64  # a shadow map each, six for a point light
MAX_COORDINATE_M = 1e15  # float32 squares of lengths on the GPU stay finite
MAX_IMAGE_SIDE = 16_384  # texels; what OpenGL drivers commonly take
MAX_SCENE_TEXELS = 1 << 28  # a gigabyte as RGBA8


def check_limit(value: int, limit: int, what: str, remedy: str, *, where: str = "") -> None:
    """Raise ResourceLimitError if `value` is above `limit`; `what` names the thing counted ("mesh 'sea': vertices")."""
    if value > limit:
        raise ResourceLimitError(f"{what}: {value} is above the limit of {limit}", where=where, remedy=remedy)


def check_image_size(name: str, width: int, height: int, *, where: str = "") -> None:
    """Raise ResourceLimitError if an image of `width` x `height` texels is too large to load."""
    remedy = "scale the image down"
    check_limit(max(width, height), MAX_IMAGE_SIDE, f"image '{name}': longest side in texels", remedy, where=where)
    check_limit(width * height, MAX_SCENE_TEXELS, f"image '{name}': texels", remedy, where=where)


def check_limits(scene: Scene, *, where: str = "") -> None:
    """Raise ResourceLimitError if the scene has too many vertices, triangles, texels, instances or lights."""
    check_limit(len(scene.lights), MAX_LIGHTS, "lights", "keep the brightest ones", where=where)
    check_limit(len(scene.instances), MAX_INSTANCES, "instances", "join meshes that share a material", where=where)
    vertices = triangles = 0
    for instance in scene.instances:
        count = len(instance.mesh.positions_m)
        what = f"mesh '{instance.mesh.name}': vertices"
        check_limit(count, MAX_MESH_VERTICES, what, "decimate the mesh or split it", where=where)
        vertices += count
        triangles += len(instance.mesh.triangles)
    check_limit(vertices, MAX_SCENE_VERTICES, "vertices of the scene", "decimate its meshes", where=where)
    check_limit(triangles, MAX_SCENE_TRIANGLES, "triangles of the scene", "decimate its meshes", where=where)
    texels = 0
    for image in scene_images(scene):
        height, width = image.pixels.shape[:2]
        check_image_size(image.name, width, height, where=where)
        texels += width * height
    check_limit(texels, MAX_SCENE_TEXELS, "texels of all images", "scale the images down", where=where)


def scene_images(scene: Scene) -> tuple[Image, ...]:
    """The images that the scene's materials use, each once."""
    materials = [i.material for i in scene.instances] + [w.material for w in scene.waters]
    images: dict[int, Image] = {}
    for material in materials:
        for image in (material.base_color_image, material.metallic_roughness_image, material.emissive_image):
            if image is not None:
                images[id(image)] = image
    return tuple(images.values())
