"""glTF accessors as NumPy arrays: all component and element types, byteStride, normalised, sparse (glTF 2.0, 3.6.2)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.scene.gltf_file import Bytes, GltfFile
from glcaustics.scene.gltf_json import Json
from glcaustics.scene.limits import MAX_MESH_VERTICES, check_limit
from glcaustics.scene.model import IntArray

COMPONENT_TYPES: dict[int, type[np.generic]] = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
# element type -> (columns, rows): a column of a matrix starts at a multiple of four bytes
ELEMENT_TYPES = {
    "SCALAR": (1, 1),
    "VEC2": (1, 2),
    "VEC3": (1, 3),
    "VEC4": (1, 4),
    "MAT2": (2, 2),
    "MAT3": (3, 3),
    "MAT4": (4, 4),
}
AGAIN = "export the file again"
Array = npt.NDArray[Any]


def read_accessor(file: GltfFile, number: int) -> Array:
    """The elements (count, components) in the accessor's own component type; matrices column by column.

    Raises:
        SceneError: unknown type, or bytes beyond the buffer view. ResourceLimitError: too many elements.
    """
    item = file.accessor_list[number]
    dtype, columns, rows = _layout(item)
    count = item.integer("count", low=1)
    check_limit(count, 6 * MAX_MESH_VERTICES, f"{item.path}: elements", "decimate the mesh", where=item.where)
    view = item.index("bufferView", len(file.view_list), "buffer views")
    if view is None:
        values = np.zeros((count, columns * rows), dtype)
    else:
        data, stride = file.view(view)
        values = _elements(item, data, stride, item.integer("byteOffset", 0), count, dtype, columns, rows)
    sparse = item.obj("sparse")
    return values if sparse is None else _with_sparse(file, sparse, values, columns, rows)


def read_floats(file: GltfFile, number: int, components: tuple[int, ...], what: str) -> npt.NDArray[np.float32]:
    """An accessor as float32 (count, components), integers normalised if it says so.

    Args:
        components: the allowed numbers of components. what: name of the attribute, for the error.
    """
    item = file.accessor_list[number]
    values = read_accessor(file, number)
    if values.shape[1] not in components:
        raise item.error(f"{what} has {values.shape[1]} components instead of {components[0]}", AGAIN)
    if values.dtype == np.float32:
        return np.array(values, np.float32)
    floats = values.astype(np.float32)
    if item.flag("normalized"):
        floats = np.maximum(floats / np.float32(np.iinfo(values.dtype).max), np.float32(-1.0))
    return np.asarray(floats, np.float32)


def read_indices(file: GltfFile, number: int) -> IntArray:
    """An accessor of vertex indices as (count,) int64."""
    item = file.accessor_list[number]
    values = read_accessor(file, number)
    if values.shape[1] != 1 or values.dtype not in (np.uint8, np.uint16, np.uint32):
        raise item.error("indices are not scalars of an unsigned integer type", AGAIN)
    return np.asarray(values[:, 0].astype(np.int64))


def _layout(item: Json) -> tuple[type[np.generic], int, int]:
    component, element = item.integer("componentType"), item.text("type")
    if component not in COMPONENT_TYPES:
        raise item.error(f"componentType {component} is unknown", AGAIN)
    if element not in ELEMENT_TYPES:
        raise item.error(f"type '{element}' is unknown", AGAIN)
    return COMPONENT_TYPES[component], *ELEMENT_TYPES[element]


def _elements(
    item: Json, data: Bytes, stride: int, offset: int, count: int, dtype: type[np.generic], columns: int, rows: int
) -> Array:
    """Copy `count` elements out of a buffer view."""
    size = np.dtype(dtype).itemsize
    column_bytes = rows * size if columns == 1 else (rows * size + 3) // 4 * 4
    element_bytes = (columns - 1) * column_bytes + rows * size
    step = stride or columns * column_bytes
    if step < element_bytes:
        raise item.error(f"its elements of {element_bytes} bytes are wider than the byteStride {step}", AGAIN)
    end = offset + (count - 1) * step + element_bytes
    if end > len(data):
        raise item.error(f"{count} elements end at byte {end}, beyond the {len(data)} bytes of its buffer view", AGAIN)
    little_endian = np.dtype(dtype).newbyteorder("<")
    shape, strides = (count, columns, rows), (step, column_bytes, size)
    values: Array = np.ndarray(shape, little_endian, buffer=data.data, offset=offset, strides=strides)
    return values.reshape(count, columns * rows).astype(dtype)


def _with_sparse(file: GltfFile, sparse: Json, values: Array, columns: int, rows: int) -> Array:
    """Overwrite the elements that a sparse accessor replaces."""
    count = sparse.integer("count", low=1)
    if count > len(values):
        raise sparse.error(f"it replaces {count} of {len(values)} elements", AGAIN)
    parts: list[Array] = []
    for key in ("indices", "values"):
        part = sparse.obj(key)
        view = part.index("bufferView", len(file.view_list), "buffer views") if part is not None else None
        if part is None or view is None:
            raise sparse.error(f"'{key}' names no buffer view", AGAIN)
        data, _ = file.view(view)
        if key == "indices":
            component = part.integer("componentType")
            if component not in (5121, 5123, 5125):
                raise part.error(f"componentType {component} is not an unsigned integer type", AGAIN)
            dtype, shape = COMPONENT_TYPES[component], (1, 1)
        else:
            dtype, shape = values.dtype.type, (columns, rows)
        parts.append(_elements(part, data, 0, part.integer("byteOffset", 0), count, dtype, *shape))
    where = parts[0][:, 0].astype(np.int64)
    if int(where.max()) >= len(values):
        raise sparse.error(f"index {int(where.max())} is out of range, there are {len(values)} elements", AGAIN)
    replaced = values.copy()
    replaced[where] = parts[1]
    return replaced
