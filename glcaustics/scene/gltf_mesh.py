"""glTF mesh primitives as `Mesh`: triangulation, normals, texture coordinates, watertightness."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from glcaustics.scene import mesh_tools
from glcaustics.scene.gltf_accessor import read_floats, read_indices
from glcaustics.scene.gltf_file import GltfFile
from glcaustics.scene.gltf_json import Json
from glcaustics.scene.gltf_material import MaterialReader, ReadMaterial
from glcaustics.scene.limits import MAX_MESH_VERTICES, check_limit
from glcaustics.scene.model import (
    MIN_TRANSMISSION,
    MIRROR_MAX_ROUGHNESS,
    MIRROR_MIN_METALLIC,
    FloatArray,
    IntArray,
    Material,
    Mesh,
)

TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN = 4, 5, 6
CLOSED_LOOK = 0.75  # `mesh_tools.enclosure` above which an open transmissive mesh was surely meant as a solid
MENDED_AREA, MENDED_EDGES = 0.02, 0.02  # shares of the surface that may lack, or face the wrong way, in a solid
AGAIN = "export the file again"


@dataclass(frozen=True, eq=False)
class Primitive:
    """A mesh with its material. `mesh` is None when nothing can be drawn (points, lines, no area)."""

    name: str
    mesh: Mesh | None
    material: Material


@dataclass(frozen=True, eq=False)
class _Raw:
    """A primitive as read: positions (V, 3), normals (V, 3) or None, uv (V, 2), triangles (T, 3)."""

    positions_m: FloatArray
    normals: FloatArray | None
    uv: FloatArray
    triangles: IntArray


class MeshReader:
    """Reads each primitive of a file once, however many nodes show it."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._items = file.root.objects("meshes")
        self._materials = MaterialReader(file)
        self._read: dict[tuple[int, bool], tuple[Primitive, ...]] = {}

    @property
    def count(self) -> int:
        return len(self._items)

    def name(self, number: int) -> str:
        return self._items[number].name

    def primitives(self, number: int, mirrored: bool) -> tuple[Primitive, ...]:
        """The primitives of mesh `number`; `mirrored`: with x negated, so that its transform needs no reflection."""
        key = (number, mirrored)
        if key not in self._read:
            item = self._items[number]
            parts = item.objects("primitives")
            if item.value.get("weights") or any(part.value.get("targets") for part in parts):
                self._file.announce(f"mesh '{item.name}': morph targets are not supported, its base shape is drawn")
            self._read[key] = tuple(self._primitive(item, part, len(parts), mirrored) for part in parts)
        return self._read[key]

    def _primitive(self, item: Json, part: Json, parts: int, mirrored: bool) -> Primitive:
        which = part.index("material", self._materials.count, "materials")
        material = self._materials.material(which)
        name = item.name if parts == 1 else f"{item.name}/{material.material.name}"
        raw = self._raw(part, name, material)
        if raw is None:
            return Primitive(name, None, material.material)
        if mirrored:
            raw = _mirrored(raw)
        return Primitive(name, self._finished(name, raw, material), material.material)

    def _raw(self, part: Json, name: str, material: ReadMaterial) -> _Raw | None:
        """Attributes and triangles as they stand in the file; None if there are no triangles."""
        mode = part.integer("mode", TRIANGLES)
        if mode not in (TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN):
            self._file.announce(f"mesh '{name}': points and lines are not drawn")
            return None
        attributes = part.obj("attributes") or Json({}, f"{part.path}.attributes", part.where)
        positions = self._attribute(attributes, "POSITION", (3,))
        if positions is None:
            self._file.announce(f"mesh '{name}' has no positions and is not drawn")
            return None
        self._check_positions(attributes, name, positions)
        normals = self._attribute(attributes, "NORMAL", (3,), len(positions))
        uv = self._uv(attributes, name, material, len(positions))
        if "COLOR_0" in attributes.value:
            self._file.announce(f"mesh '{name}': vertex colours are not supported and left out")
        triangles = triangulate(self._corner_indices(part, len(positions)), mode)
        if triangles is None:
            raise part.error(f"mesh '{name}': its index count is not a multiple of three", AGAIN)
        used, flat = np.unique(triangles, return_inverse=True)  # primitives often share one big vertex buffer
        return _Raw(
            positions[used].astype(np.float64),
            None if normals is None else normals[used].astype(np.float64),
            uv[used],
            flat.reshape(-1, 3),
        )

    def _attribute(
        self, attributes: Json, key: str, components: tuple[int, ...], count: int | None = None
    ) -> FloatArray | None:
        number = attributes.index(key, len(self._file.accessor_list), "accessors")
        if number is None:
            return None
        if count is None and "bufferView" not in self._file.accessor_list[number].value:
            if "sparse" not in self._file.accessor_list[number].value:
                raise self._file.accessor_list[number].error(
                    f"{key} has no data (a compressed mesh?)", "export the file without mesh compression"
                )
        values = read_floats(self._file, number, components, key)
        if count is not None and len(values) != count:
            raise attributes.error(f"{key} has {len(values)} elements, POSITION has {count}", AGAIN)
        return values

    def _check_positions(self, attributes: Json, name: str, positions: FloatArray) -> None:
        what = f"mesh '{name}': vertices"
        check_limit(len(positions), MAX_MESH_VERTICES, what, "decimate the mesh", where=attributes.where)
        finite = np.isfinite(positions).all(axis=1)
        if not finite.all():
            number, bad = attributes.value["POSITION"], int(np.flatnonzero(~finite)[0])
            raise attributes.error(
                f"mesh '{name}': POSITION of vertex {bad} in accessors[{number}] is not finite "
                f"({int((~finite).sum())} such vertices)",
                "remove these vertices in the modeller and export again",
            )

    def _corner_indices(self, part: Json, vertices: int) -> IntArray:
        number = part.index("indices", len(self._file.accessor_list), "accessors")
        if number is None:
            return np.arange(vertices)
        indices = read_indices(self._file, number)
        highest = int(indices.max())
        if highest >= vertices:
            place = self._file.accessor_list[number].path
            raise part.error(f"index {highest} in {place} is out of range, there are {vertices} vertices", AGAIN)
        return indices

    def _uv(self, attributes: Json, name: str, material: ReadMaterial, vertices: int) -> FloatArray:
        """Texture coordinates (V, 2) of the set that the material uses, transformed; zeros if there are none."""
        uv = self._attribute(attributes, f"TEXCOORD_{material.texcoord}", (2,), vertices)
        m = material.material
        if uv is None:
            if m.base_color_image or m.metallic_roughness_image or m.emissive_image:
                self._file.announce(f"mesh '{name}' has no texture coordinates; its images show one colour")
            return np.zeros((vertices, 2), np.float32)
        if not np.isfinite(uv).all():
            self._file.announce(f"mesh '{name}': texture coordinates that are not finite are set to 0")
            uv = np.where(np.isfinite(uv), uv, 0.0)
        if material.uv_transform is not None:
            uv = uv @ material.uv_transform[:2, :2].T + material.uv_transform[:2, 2]
        return np.asarray(uv, np.float32)

    def _finished(self, name: str, raw: _Raw, material: ReadMaterial) -> Mesh | None:
        """Check the surface, wind it outwards, drop what has no area, and give it normals."""
        labels = mesh_tools.weld(raw.positions_m)
        topology = mesh_tools.topology(raw.positions_m, raw.triangles, labels)
        transmissive = is_transmissive(material.material)
        closed = topology.watertight
        if transmissive and not closed:
            closed = self._all_but_closed(name, raw, topology, material.thickness)
        kept = mesh_tools.nondegenerate(raw.positions_m, raw.triangles)
        if not kept.any():
            self._file.announce(f"mesh '{name}' has no area and is not drawn")
            return None
        if not kept.all():
            self._file.announce(f"mesh '{name}': {int((~kept).sum())} degenerate triangles removed")
            raw = replace(raw, triangles=raw.triangles[kept])
        raw = self._wound(name, raw, labels, solid=transmissive and closed)
        if raw.normals is None:
            smooth = transmissive or is_mirror(material.material)
            split = (
                mesh_tools.crease_normals(raw.positions_m, raw.triangles, labels=labels)
                if smooth
                else mesh_tools.flat_normals(raw.positions_m, raw.triangles)
            )
            raw = _Raw(raw.positions_m[split.source], split.normals, raw.uv[split.source], split.triangles)
        assert raw.normals is not None
        return Mesh(
            name=name,
            positions_m=raw.positions_m.astype(np.float32),
            normals=raw.normals.astype(np.float32),
            uv=raw.uv.astype(np.float32),
            triangles=raw.triangles.astype(np.uint32),
            watertight=closed,
        )

    def _all_but_closed(self, name: str, raw: _Raw, topology: mesh_tools.Topology, thickness: float) -> bool:
        """Whether an open transmissive mesh is taken as a solid; announced, but for sheets meant as such."""
        enclosure = mesh_tools.enclosure(raw.positions_m, raw.triangles)
        if thickness <= 0.0 and enclosure < CLOSED_LOOK:
            return False  # such as water
        if topology.open_edges:
            why = f"has {topology.open_edges} open edges"
        else:
            why = f"has {topology.miswound_edges} edges between triangles that face opposite ways"
        few = topology.open_edges + topology.miswound_edges <= MENDED_EDGES * 3 * len(raw.triangles) + 3
        closed = enclosure > 1.0 - MENDED_AREA and few
        what = f"mesh '{name}' transmits but is not watertight ({why})"
        self._file.announce(
            f"{what}; it is treated as a {'solid, being all but closed' if closed else 'single interface'}"
        )
        return closed

    def _wound(self, name: str, raw: _Raw, labels: IntArray, *, solid: bool) -> _Raw:
        """Normals made unit, and triangles wound counter-clockwise from outside.

        A solid's outside follows from its volume; of any other surface the normals in the file decide.
        """
        triangles = raw.triangles
        if solid and mesh_tools.signed_volume(raw.positions_m, triangles) < 0.0:
            triangles = triangles[:, ::-1]
            self._file.announce(f"mesh '{name}' is inside out; its triangles are turned round")
        if raw.normals is None:
            return replace(raw, triangles=triangles)
        normals = self._unit_normals(name, raw, triangles, labels)
        faces = mesh_tools.face_normals(raw.positions_m, triangles)
        agreement = np.einsum("ti,ti->t", faces, normals[triangles].sum(axis=1))
        if np.sign(agreement).sum() < 0.0:
            if solid:
                normals = -normals
            else:
                triangles = triangles[:, ::-1]
            turned = "normals" if solid else "triangles"
            self._file.announce(f"mesh '{name}': its {turned} are turned round, as normals and winding disagree")
        return replace(raw, normals=normals, triangles=triangles)

    def _unit_normals(self, name: str, raw: _Raw, triangles: IntArray, labels: IntArray) -> FloatArray:
        assert raw.normals is not None
        length = np.linalg.norm(raw.normals, axis=1, keepdims=True)
        usable = (np.isfinite(length) & (length > 1e-6))[:, 0]
        if usable.all():
            return np.asarray(raw.normals / length)
        self._file.announce(f"mesh '{name}': {int((~usable).sum())} normals of zero length recomputed")
        fresh = mesh_tools.smooth_normals(raw.positions_m, triangles, labels)
        return np.where(usable[:, None], raw.normals / np.where(usable[:, None], length, 1.0), fresh)


def is_transmissive(material: Material) -> bool:
    """Light goes through it (`Instance.optical_kind` SOLID or INTERFACE)."""
    return material.transmission >= MIN_TRANSMISSION and material.metallic < MIRROR_MIN_METALLIC


def is_mirror(material: Material) -> bool:
    """It reflects caustics (`Instance.optical_kind` MIRROR)."""
    return material.metallic >= MIRROR_MIN_METALLIC and material.roughness <= MIRROR_MAX_ROUGHNESS


def triangulate(indices: IntArray, mode: int) -> IntArray | None:
    """Triangles (T, 3) of a list, strip or fan (glTF 2.0, 3.7.2.1); None if a list does not come in threes."""
    if mode == TRIANGLES:
        return indices.reshape(-1, 3) if len(indices) % 3 == 0 and len(indices) else None
    if len(indices) < 3:
        return None
    i = np.arange(len(indices) - 2)
    if mode == TRIANGLE_STRIP:
        return np.asarray(np.stack((indices[i], indices[i + 1 + i % 2], indices[i + 2 - i % 2]), axis=1))
    return np.asarray(np.stack((indices[i + 1], indices[i + 2], np.broadcast_to(indices[0], i.shape)), axis=1))


def _mirrored(raw: _Raw) -> _Raw:
    """The primitive with x negated; the winding is reversed to keep its outside outside."""
    flip = np.array([-1.0, 1.0, 1.0])
    normals = None if raw.normals is None else raw.normals * flip
    return replace(raw, positions_m=raw.positions_m * flip, normals=normals, triangles=raw.triangles[:, ::-1])
