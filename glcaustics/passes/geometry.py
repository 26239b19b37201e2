"""The scene's meshes on the GPU, and the one way to draw them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from glcaustics.gpu import Device, Program
from glcaustics.scene.model import FloatArray, Image, Instance, Mesh, OpticalKind

KIND_INDEX = {OpticalKind.DIFFUSE: 0, OpticalKind.MIRROR: 1, OpticalKind.SOLID: 2, OpticalKind.INTERFACE: 3}
_LAYOUT = (("3f", "3x4", "in_position"), ("3f", "3x4", "in_normal"), ("2f", "2x4", "in_uv"))


@dataclass(eq=False)
class GpuMesh:
    """Interleaved position, normal, uv (8 float32 a vertex) and 32-bit indices.

    `previous`: the vertices of the frame before, of a mesh that changes; `changed`: whether this frame's are others.
    """

    mesh: Mesh
    vertices: moderngl.Buffer
    indices: moderngl.Buffer
    arrays: dict[Program, moderngl.VertexArray]
    previous: moderngl.Buffer | None = None
    changed: bool = False

    def array(self, device: Device, program: Program) -> moderngl.VertexArray:
        """The vertex array of this mesh for a program: only the inputs that the program has."""
        found = self.arrays.get(program)
        if found is None:
            inputs = program.source.attributes
            layout = " ".join(read if name in inputs else skip for read, skip, name in _LAYOUT)
            names = [name for _, _, name in _LAYOUT if name in inputs]
            content: list[tuple[Any, ...]] = [(self.vertices, layout, *names)]
            if self.previous is not None and "in_previous_position" in inputs:
                content.append((self.previous, "3f 5x4", "in_previous_position"))
            found = device.vertex_array(program, content, self.indices)
            self.arrays[program] = found
        return found

    def release(self) -> None:
        for array in self.arrays.values():
            array.release()
        self.vertices.release()
        self.indices.release()
        if self.previous is not None:
            self.previous.release()


@dataclass(eq=False)
class DrawItem:
    """One instance to draw. `index`: its row in the object table. `bounds_ws`: (2, 3) minimum and maximum, metres."""

    instance: Instance
    index: int
    kind: OpticalKind
    mesh: GpuMesh
    world_from_object: FloatArray
    normal_from_object: FloatArray
    bounds_ws: FloatArray


def interleave(mesh: Mesh) -> np.ndarray:
    """(V, 8) float32: position, normal, uv."""
    return np.concatenate([mesh.positions_m, mesh.normals, mesh.uv], axis=1).astype(np.float32)


def bounds_ws(instance: Instance) -> FloatArray:
    """(2, 3) float64: minimum and maximum of the instance's vertices, world space, metres."""
    positions = instance.positions_ws()
    return np.stack([positions.min(axis=0), positions.max(axis=0)])


def _unchanged(item: DrawItem, instance: Instance) -> bool:
    old = item.instance
    same = old.mesh is instance.mesh and old.material is instance.material
    return same and old.world_from_object is instance.world_from_object and old.name == instance.name


def boxes_of(instances: Iterable[Instance]) -> FloatArray:
    """`bounds_ws` of each, (N, 2, 3)."""
    boxes = [bounds_ws(instance) for instance in instances]
    return np.stack(boxes) if boxes else np.zeros((0, 2, 3))


def screen_boxes_px(boxes_ws: FloatArray, clip_from_world: FloatArray, size: tuple[int, int]) -> FloatArray:
    """Where boxes (N, 2, 3) lie in the picture: (N, 2, 2) least and most x, y in pixels, cut at its border.

    Least is not below most where a box is out of sight. One that reaches behind the eye takes the whole picture.
    """
    ends = np.asarray(boxes_ws, np.float64)
    picks = np.indices((2, 2, 2)).reshape(3, 8).T
    corners = np.stack([ends[:, picks[:, axis], axis] for axis in range(3)], axis=2)
    clip = np.concatenate((corners, np.ones((*corners.shape[:2], 1))), axis=2) @ clip_from_world.T
    behind = clip[..., 3] <= 0.0
    ndc = clip[..., :2] / np.where(behind, 1.0, clip[..., 3])[..., None]
    some, none = np.any(behind, axis=1, keepdims=True), np.all(behind, axis=1, keepdims=True)
    low = np.where(none, 2.0, np.where(some, -1.0, ndc.min(axis=1)))
    high = np.where(none, -2.0, np.where(some, 1.0, ndc.max(axis=1)))
    return np.clip(0.5 + 0.5 * np.stack((low, high), axis=1), 0.0, 1.0) * np.asarray(size, np.float64)


class GpuScene:
    """Keeps the meshes of a scene on the GPU; meshes of equal identity are uploaded once, moving ones in place.

    `keep_previous`: copy the vertices of a changing mesh before they are overwritten, for motion vectors.
    """

    keep_previous = False

    def __init__(self, device: Device) -> None:
        self.device = device
        self.items: list[DrawItem] = []
        self._meshes: dict[int, GpuMesh] = {}
        self._images: dict[int, moderngl.Texture] = {}
        self._kept_images: list[Image] = []
        self.objects: moderngl.Texture | None = None
        self.version = 0  # counts the updates that changed something
        self._touch_version = -1
        self._touches: dict[tuple[OpticalKind, ...], bool] = {}

    def update(self, instances: tuple[Instance, ...]) -> None:
        """Upload what is new. An instance of the same name and the same vertex count reuses its buffers."""
        if len(instances) == len(self.items) and all(map(_unchanged, self.items, instances)):
            return
        self.version += 1
        self.hold()
        old_by_name = {item.instance.name: item for item in self.items}
        wanted = {id(instance.mesh) for instance in instances}
        items = []
        for index, instance in enumerate(instances):
            old = old_by_name.get(instance.name)
            if old is not None and old.instance is instance:
                old.index = index
                items.append(old)
                continue
            gpu_mesh = self._mesh(
                instance.mesh, old.mesh if old is not None and id(old.mesh.mesh) not in wanted else None
            )
            m = instance.world_from_object
            linear = m[:3, :3]
            normal = np.linalg.inv(linear).T * np.cbrt(abs(np.linalg.det(linear)))
            items.append(DrawItem(instance, index, instance.optical_kind, gpu_mesh, m, normal, bounds_ws(instance)))
        self.items = items
        self._drop_unused(wanted)
        self._write_objects()

    def hold(self) -> None:
        """The next frame shows the same meshes as the last one."""
        for mesh in self._meshes.values():
            mesh.changed = False

    def _mesh(self, mesh: Mesh, reuse: GpuMesh | None) -> GpuMesh:
        found = self._meshes.get(id(mesh))
        if found is not None:
            return found
        data = interleave(mesh)
        if reuse is not None and reuse.vertices.size == data.nbytes and reuse.mesh.triangles is mesh.triangles:
            self._meshes.pop(id(reuse.mesh), None)
            if self.keep_previous:
                if reuse.previous is None:
                    label = f"mesh {mesh.name}, the frame before"
                    reuse.previous = self.device.buffer(reserve=data.nbytes, label=label, dynamic=True)
                self.device.ctx.copy_buffer(reuse.previous, reuse.vertices)
                reuse.changed = True
            reuse.vertices.write(data.tobytes())
            reuse.mesh = mesh
            self._meshes[id(mesh)] = reuse
            return reuse
        label = f"mesh {mesh.name}"
        made = GpuMesh(
            mesh,
            self.device.buffer(data, label, dynamic=True),
            self.device.buffer(mesh.triangles.astype(np.uint32), f"{label} indices"),
            {},
        )
        self._meshes[id(mesh)] = made
        return made

    def _drop_unused(self, wanted: set[int]) -> None:
        for key in [key for key in self._meshes if key not in wanted]:
            self._meshes.pop(key).release()

    def _write_objects(self) -> None:
        rows = np.zeros((max(len(self.items), 1), 4, 4), np.float32)
        for item in self.items:
            material = item.instance.material
            rows[item.index, 0] = (*material.base_color, KIND_INDEX[item.kind])
            rows[item.index, 1] = (*material.ior_rgb(), material.roughness)
            rows[item.index, 2] = (*material.sigma_a, material.transmission)
            rows[item.index, 3] = (*material.emissive, material.metallic)
        if self.objects is None or self.objects.size != (4, len(rows)):
            if self.objects is not None:
                self.objects.release()
            self.objects = self.device.texture((4, len(rows)), "rgba32f", label="object table")
        self.objects.write(rows.tobytes())

    def image(self, image: Image) -> moderngl.Texture:
        """An image as a mip-mapped, repeating texture; row 0 of the image at v = 0, as glTF has it."""
        found = self._images.get(id(image))
        if found is None:
            pixels = np.asarray(image.pixels)
            if pixels.dtype != np.uint8:
                pixels = np.clip(np.asarray(pixels, np.float32) * 255.0 + 0.5, 0, 255).astype(np.uint8)
            if pixels.shape[2] == 3:
                pixels = np.concatenate([pixels, np.full_like(pixels[..., :1], 255)], axis=2)
            size = (pixels.shape[1], pixels.shape[0])
            format = "srgba8" if image.srgb else "rgba8"
            found = self.device.texture(
                size, format, filter="linear", label=f"image {image.name}", data=pixels, repeat=True, mipmaps=True
            )
            found.anisotropy = 8.0
            self._images[id(image)] = found
            self._kept_images.append(image)  # the key is the identity: the image must stay alive
        return found

    def select(self, *kinds: OpticalKind) -> list[DrawItem]:
        """The items of some optical kinds."""
        return [item for item in self.items if item.kind in kinds]

    def touch(self, one: OpticalKind, *others: OpticalKind) -> bool:
        """Whether the box of an item of one kind meets that of another item of some kinds. Kept while nothing moves."""
        key = (one, *others)
        if self._touch_version != self.version:
            self._touch_version, self._touches = self.version, {}
        if key not in self._touches:
            ones, rest = self.select(one), self.select(*others)
            a = np.reshape([item.bounds_ws for item in ones], (-1, 1, 2, 3))
            b = np.reshape([item.bounds_ws for item in rest], (1, -1, 2, 3))
            meet = np.all((a[..., 0, :] <= b[..., 1, :]) & (b[..., 0, :] <= a[..., 1, :]), axis=-1)
            same = np.reshape([i.index for i in ones], (-1, 1)) == np.reshape([i.index for i in rest], (1, -1))
            self._touches[key] = bool(np.any(meet & ~same))
        return self._touches[key]

    def draw(
        self,
        program: Program | Callable[[DrawItem], Program],
        target: moderngl.Framebuffer,
        items: Iterable[DrawItem],
        *,
        cull: str | None = None,
        viewport: tuple[int, int, int, int] | None = None,
        per_item: Callable[[Program, DrawItem], None] | None = None,
        depth_func: str = "<",
    ) -> None:
        """Draw items with depth testing; `program` may depend on the item (material permutations)."""
        for item in items:
            chosen = program if isinstance(program, Program) else program(item)
            common: dict[str, Any] = {
                "u_world_from_object": item.world_from_object,
                "u_normal_from_object": item.normal_from_object,
                "u_object": float(item.index),
            }
            chosen.set_all(common)
            if per_item is not None:
                per_item(chosen, item)
            self.device.draw(
                item.mesh.array(self.device, chosen),
                chosen,
                target,
                depth_func=depth_func,
                cull=cull,
                viewport=viewport,
            )

    def release(self) -> None:
        """Give everything back."""
        for mesh in self._meshes.values():
            mesh.release()
        for texture in self._images.values():
            texture.release()
        if self.objects is not None:
            self.objects.release()
        self._meshes.clear()
        self._images.clear()
        self.items = []


SPECULAR_KINDS = (OpticalKind.MIRROR, OpticalKind.SOLID, OpticalKind.INTERFACE)
TRANSMISSIVE_KINDS = (OpticalKind.SOLID, OpticalKind.INTERFACE)


def points_of(instances: Iterable[Instance]) -> FloatArray:
    """All vertices of some instances, (N, 3) float64, metres, world space; (0, 3) without any."""
    parts = [instance.positions_ws() for instance in instances]
    return np.concatenate(parts) if parts else np.zeros((0, 3))
