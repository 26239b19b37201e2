"""The container of a glTF 2.0 file: JSON and binary chunks, buffers, buffer views, extensions."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
import numpy.typing as npt

from glcaustics.errors import SceneError
from glcaustics.scene.gltf_json import Json
from glcaustics.scene.limits import MAX_FILE_BYTES, check_limit

GLB_MAGIC = b"glTF"
CHUNK_JSON = 0x4E4F534A
CHUNK_BIN = 0x004E4942
READ_EXTENSIONS = frozenset(
    {
        "KHR_lights_punctual",
        "KHR_materials_transmission",
        "KHR_materials_ior",
        "KHR_materials_volume",
        "KHR_materials_dispersion",
        "KHR_materials_emissive_strength",
        "KHR_texture_transform",
        "KHR_mesh_quantization",
        "EXT_texture_webp",
    }
)
REMEDY = {
    "KHR_draco_mesh_compression": "export the file without Draco compression",
    "EXT_meshopt_compression": "unpack it first, e.g. gltf-transform copy in.glb out.glb",
    "KHR_meshopt_compression": "unpack it first, e.g. gltf-transform copy in.glb out.glb",
    "KHR_texture_basisu": "save its textures as PNG or JPEG",
    "KHR_materials_pbrSpecularGlossiness": "convert it, e.g. gltf-transform metalrough in.glb out.glb",
}
Bytes = npt.NDArray[np.uint8]


class GltfFile:
    """An opened glTF file: checked JSON, and its buffers, which are read when first asked for.

    Attributes:
        root: the file's JSON. announcements: what was assumed or left out so far, one line each.
    """

    def __init__(self, path: Path, root: Json, binary: Bytes | None) -> None:
        self.path = path
        self.root = root
        self.announcements: list[str] = []
        self._binary = binary
        self._buffers: dict[int, Bytes] = {}
        self.buffer_list = root.objects("buffers")
        self.view_list = root.objects("bufferViews")
        self.accessor_list = root.objects("accessors")

    def announce(self, text: str) -> None:
        """Note one line for the user, once."""
        if text not in self.announcements:
            self.announcements.append(text)

    def buffer(self, number: int) -> Bytes:
        """The bytes of a buffer: the GLB's binary chunk, a data URI or a file beside the scene's."""
        if number not in self._buffers:
            item = self.buffer_list[number]
            length = item.integer("byteLength", low=1)
            if "uri" in item.value:
                data: Bytes = np.frombuffer(self.uri_bytes(item), np.uint8)
            elif number == 0 and self._binary is not None:
                data = self._binary
            else:
                raise item.error("it has neither a uri nor a binary chunk", "export the file again without compression")
            if len(data) < length:
                raise item.error(
                    f"it has {len(data)} of the {length} bytes it declares, the file is truncated", "export it again"
                )
            self._buffers[number] = data[:length]
        return self._buffers[number]

    def view(self, number: int) -> tuple[Bytes, int]:
        """The bytes of a buffer view, and its byteStride (0 = tightly packed)."""
        item = self.view_list[number]
        which = item.index("buffer", len(self.buffer_list), "buffers")
        if which is None:
            raise item.error("it names no buffer", "export the file again")
        data = self.buffer(which)
        offset, length = item.integer("byteOffset", 0), item.integer("byteLength", low=1)
        if offset + length > len(data):
            raise item.error(
                f"bytes {offset} to {offset + length} lie beyond the {len(data)} bytes of its buffer",
                "export the file again",
            )
        return data[offset : offset + length], item.integer("byteStride", 0)

    def uri_bytes(self, item: Json) -> bytes:
        """What an item's `uri` stands for: a data URI or a file, relative to the scene's folder."""
        uri = item.text("uri")
        if uri.startswith("data:"):
            header, comma, body = uri.partition(",")
            try:
                if not comma:
                    raise ValueError("no comma")
                return base64.b64decode(body, validate=True) if header.endswith(";base64") else unquote_to_bytes(body)
            except (binascii.Error, ValueError) as error:
                raise item.error(f"its data URI cannot be decoded ({error})", "export the file again") from None
        if "://" in uri:
            raise item.error(f"uri '{uri[:80]}' is on the network", "download the file and put it beside the scene")
        file = self.path.parent / unquote(uri)
        return _read_file(file, f"{item.path} names '{uri}', which", self.root.where)


def open_gltf(path: str | Path) -> GltfFile:
    """Open a .gltf or .glb file and check its container, version and required extensions.

    Raises:
        SceneError: missing, truncated, not glTF 2.0, or in need of an extension that is not read.
        ResourceLimitError: the file is too large.
    """
    path = Path(path)
    where = path.name
    data = _read_file(path, "the scene file", str(path))
    binary: Bytes | None = None
    if data[:4] == GLB_MAGIC:
        text, binary = _split_glb(data, where)
    elif path.suffix.lower() == ".glb":
        raise SceneError(
            f"it does not start with the magic 'glTF' but with {data[:4]!r}", where=where, remedy="export it as .glb"
        )
    else:
        text = data
    file = GltfFile(path, Json(_parse(text, where), "", where), binary)
    _check_version(file.root)
    _check_extensions(file)
    return file


def _read_file(path: Path, what: str, where: str) -> bytes:
    try:
        check_limit(path.stat().st_size, MAX_FILE_BYTES, f"{what}: bytes", "split the scene", where=where)
        return path.read_bytes()
    except FileNotFoundError:
        raise SceneError(f"{what} does not exist", where=where, remedy=f"put it at {path}") from None
    except OSError as error:
        reason = error.strerror or "unknown error"
        raise SceneError(f"{what} cannot be read: {reason}", where=where, remedy=f"check {path}") from None
    except ValueError as error:  # a path with a null character
        raise SceneError(f"{what} has an unusable path: {error}", where=where, remedy="rename it") from None


def _split_glb(data: bytes, where: str) -> tuple[bytes, Bytes | None]:
    """JSON text and binary chunk of a GLB container (glTF 2.0, section 4.4)."""

    def broken(what: str) -> SceneError:
        return SceneError(what, where=where, remedy="export or copy the file again")

    if len(data) < 12:
        raise broken(f"truncated: {len(data)} bytes are less than a GLB header")
    _, version, length = struct.unpack_from("<4sII", data)
    if version != 2:
        raise SceneError(f"GLB version {version} is not supported", where=where, remedy="export it as glTF 2.0")
    if length > len(data):
        raise broken(f"truncated: {len(data)} of {length} bytes are there")
    chunks: dict[int, memoryview] = {}
    offset = 12
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<II", data, offset)
        offset += 8
        if offset + size > length:
            raise broken(f"truncated: the chunk at byte {offset - 8} declares {size} bytes, {length - offset} are left")
        if not chunks and kind != CHUNK_JSON:
            raise broken("its first chunk is not JSON")
        chunks.setdefault(kind, memoryview(data)[offset : offset + size])
        offset += size + (-size) % 4
    if CHUNK_JSON not in chunks:
        raise broken("it has no JSON chunk")
    binary = chunks.get(CHUNK_BIN)
    return bytes(chunks[CHUNK_JSON]), None if binary is None else np.frombuffer(binary, np.uint8)


def _parse(text: bytes, where: str) -> dict[str, Any]:
    def refuse(constant: str) -> NoReturn:
        raise ValueError(f"{constant} is not a number in JSON")

    try:
        found = json.loads(text.decode("utf-8-sig"), parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise SceneError(f"its JSON cannot be read ({error})", where=where, remedy="export it as glTF 2.0") from None
    if not isinstance(found, dict):
        raise SceneError("its JSON is not an object", where=where, remedy="export it as glTF 2.0")
    return found


def _check_version(root: Json) -> None:
    asset = root.obj("asset")
    version = asset.text("version") if asset is not None else ""
    needed = asset.text("minVersion", version) if asset is not None else ""
    if not version.startswith("2.") or needed not in ("2.0", version):
        shown = needed if version.startswith("2.") else version
        raise SceneError(
            f"glTF version '{shown}' is not supported" if version else "it names no glTF version (asset.version)",
            where=root.where,
            remedy="export it as glTF 2.0",
        )


def _check_extensions(file: GltfFile) -> None:
    root = file.root
    for name in root.texts("extensionsRequired"):
        if name not in READ_EXTENSIONS:
            raise SceneError(
                f"it requires the extension {name}, which is not supported",
                where=root.where,
                remedy=REMEDY.get(name, "export the file without it"),
            )
    for name in root.texts("extensionsUsed"):
        if name not in READ_EXTENSIONS:
            file.announce(f"extension {name} is not supported and is left out")
