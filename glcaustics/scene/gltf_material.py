"""glTF materials and images as `Material` and `Image`: metallic-roughness with the extensions caustics need."""

from __future__ import annotations

import io
import math
import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage
from PIL import UnidentifiedImageError

from glcaustics.errors import ResourceLimitError
from glcaustics.scene.gltf_file import GltfFile
from glcaustics.scene.gltf_json import Json
from glcaustics.scene.limits import check_image_size
from glcaustics.scene.model import MIN_TRANSMISSION, FloatArray, Image, Material

PAINT_ROUGHNESS = 0.8  # a surface this rough that does not say that it is a metal is none
REPEAT = 10497  # OpenGL's GL_REPEAT, glTF's default wrap mode
LEFT_OUT_TEXTURES = ("normalTexture", "occlusionTexture")


@dataclass(frozen=True, eq=False)
class ReadMaterial:
    """A material with how its textures address the mesh.

    `texcoord`: number of the TEXCOORD set. `uv_transform`: 3x3 matrix from the file's uv to the image's
    (KHR_texture_transform), None for the identity. `thickness`: thicknessFactor of KHR_materials_volume.
    """

    material: Material
    texcoord: int = 0
    uv_transform: FloatArray | None = None
    thickness: float = 0.0


class MaterialReader:
    """Reads each material and image of a file once, however many meshes use it."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._items = file.root.objects("materials")
        self._textures = file.root.objects("textures")
        self._images = file.root.objects("images")
        self._samplers = file.root.objects("samplers")
        self._read: dict[int | None, ReadMaterial] = {}
        self._decoded: dict[tuple[int, bool], Image] = {}

    @property
    def count(self) -> int:
        return len(self._items)

    def material(self, number: int | None) -> ReadMaterial:
        """Material `number` of the file; None: that of a primitive which names none."""
        if number not in self._read:
            if number is None:
                self._read[None] = ReadMaterial(Material(name="default", base_color=(0.8, 0.8, 0.8)))
                self._file.announce("a mesh has no material; it is taken as diffuse grey (0.8)")
            else:
                self._read[number] = self._read_material(self._items[number])
        return self._read[number]

    def _read_material(self, item: Json) -> ReadMaterial:
        pbr = item.obj("pbrMetallicRoughness") or Json({}, f"{item.path}.pbrMetallicRoughness", item.where)
        color = pbr.floats("baseColorFactor", (1.0, 1.0, 1.0, 1.0))
        strength = _extension_number(item, "KHR_materials_emissive_strength", "emissiveStrength", 1.0)
        emissive = item.floats("emissiveFactor", (0.0, 0.0, 0.0))
        transmission = self._transmission(item)
        metallic, roughness = self._metallic_roughness(item, pbr, transmission)
        slots = _TextureSlots(self, item)
        volume = item.extension("KHR_materials_volume") or Json({}, item.path, item.where)
        material = Material(
            name=item.name,
            base_color=(color[0], color[1], color[2]),
            base_color_image=slots.image(pbr.obj("baseColorTexture"), srgb=True),
            metallic=metallic,
            roughness=roughness,
            metallic_roughness_image=slots.image(pbr.obj("metallicRoughnessTexture"), srgb=False),
            emissive=(emissive[0] * strength, emissive[1] * strength, emissive[2] * strength),
            emissive_image=slots.image(item.obj("emissiveTexture"), srgb=True) if any(emissive) else None,
            transmission=transmission,
            ior=self._ior(item),
            dispersion=_extension_number(item, "KHR_materials_dispersion", "dispersion", 0.0),
            double_sided=item.flag("doubleSided"),
            **self._absorption(volume),
        )
        self._announce_left_out(item, color[3])
        thickness = volume.number("thicknessFactor", 0.0, low=0.0)
        return ReadMaterial(_with_constants_folded(material), slots.texcoord, slots.uv_transform, thickness)

    def _transmission(self, item: Json) -> float:
        extension = item.extension("KHR_materials_transmission")
        if extension is None:
            return 0.0
        transmission = extension.number("transmissionFactor", 0.0, 0.0, 1.0)
        texture = extension.obj("transmissionTexture")
        if texture is not None and transmission > 0.0:
            number = self.image_number(texture)
            if number is not None:
                transmission *= float(self.image(number, srgb=False).pixels[..., 0].mean()) / 255.0
            self._file.announce(
                f"material '{item.name}': the mean of its transmissionTexture is used, {transmission:.3g}"
            )
        return transmission

    def _metallic_roughness(self, item: Json, pbr: Json, transmission: float) -> tuple[float, float]:
        """Factors, where an unwritten factor is read as what the author most likely meant.

        glTF's default is metallic 1 and roughness 1; a file that leaves out the former on a rough or a transmitting
        surface means paint or glass: as a rough metal it would swallow every caustic.
        """
        metallic = pbr.number("metallicFactor", 1.0, 0.0, 1.0)
        roughness = pbr.number("roughnessFactor", 1.0, 0.0, 1.0)
        if "metallicRoughnessTexture" in pbr.value:
            return metallic, roughness
        glass = transmission >= MIN_TRANSMISSION
        if "metallicFactor" not in pbr.value and (glass or roughness >= PAINT_ROUGHNESS):
            metallic = 0.0
            self._file.announce(f"material '{item.name}' has no metallicFactor; it is taken as not metallic")
        if glass and "roughnessFactor" not in pbr.value:
            roughness = 0.0
            self._file.announce(f"material '{item.name}' transmits and has no roughnessFactor; it is taken as smooth")
        return metallic, roughness

    def _ior(self, item: Json) -> float:
        ior = _extension_number(item, "KHR_materials_ior", "ior", 1.5)
        if ior == 0.0:  # the extension's escape for specular-glossiness files
            self._file.announce(f"material '{item.name}': ior 0 is read as 1.5")
            return 1.5
        return ior

    def _absorption(self, volume: Json) -> dict[str, Any]:
        distance_m = volume.number("attenuationDistance", math.inf, low=0.0)
        if distance_m == 0.0:
            raise volume.error("'attenuationDistance' is 0", "give the metres after which light has attenuationColor")
        color = volume.floats("attenuationColor", (1.0, 1.0, 1.0))
        return {"attenuation_distance_m": distance_m, "attenuation_color": color}

    def _announce_left_out(self, item: Json, alpha: float) -> None:
        left_out = [key for key in LEFT_OUT_TEXTURES if key in item.value]
        if left_out:
            self._file.announce(f"material '{item.name}': {' and '.join(left_out)} not supported and left out")
        mode = item.text("alphaMode", "OPAQUE")
        if mode != "OPAQUE":
            shown = f"alphaMode {mode} (alpha {alpha:g})"
            self._file.announce(f"material '{item.name}': {shown} is not supported, it is taken as opaque")

    def image_number(self, slot: Json) -> int | None:
        """The image that a textureInfo names; None if the texture has none (announced)."""
        number = slot.index("index", len(self._textures), "textures")
        if number is None:
            raise slot.error("it names no texture", "export the file again")
        texture = self._textures[number]
        webp = texture.extension("EXT_texture_webp")
        chosen = texture if webp is None else webp
        source = chosen.index("source", len(self._images), "images")
        if source is None:
            self._file.announce(f"{texture.path} has no image that can be read and is left out")
        which = texture.index("sampler", len(self._samplers), "samplers")
        if which is not None:
            wraps = {self._samplers[which].integer(key, REPEAT) for key in ("wrapS", "wrapT")}
            if wraps != {REPEAT}:
                self._file.announce(f"{texture.path}: its wrap mode is not supported, the image is repeated")
        return source

    def image(self, number: int, *, srgb: bool) -> Image:
        """Image `number` as (H, W, 3) uint8, decoded once."""
        key = (number, srgb)
        if key not in self._decoded:
            other = self._decoded.get((number, not srgb))
            item = self._images[number]
            pixels = other.pixels if other is not None else self._decode(item)
            self._decoded[key] = Image(item.name, pixels, srgb)
        return self._decoded[key]

    def _decode(self, item: Json) -> npt.NDArray[np.uint8]:
        if "uri" in item.value:
            data = self._file.uri_bytes(item)
        else:
            view = item.index("bufferView", len(self._file.view_list), "buffer views")
            if view is None:
                raise item.error("it has neither a uri nor a bufferView", "export the file again")
            data = self._file.view(view)[0].tobytes()
        try:
            with warnings.catch_warnings():  # our own limit is checked below
                warnings.simplefilter("ignore", PillowImage.DecompressionBombWarning)
                picture = PillowImage.open(io.BytesIO(data))
            check_image_size(item.name, picture.width, picture.height, where=item.where)
            if picture.mode.startswith("I"):  # 16 bits a texel; Pillow's own conversion would clip
                wide = np.asarray(picture).astype(np.uint32)
                return np.repeat((wide[:, :, None] // 257).astype(np.uint8), 3, axis=2)
            return np.asarray(picture.convert("RGB"), np.uint8)
        except ResourceLimitError:
            raise
        except PillowImage.DecompressionBombError:
            raise ResourceLimitError(f"{item.path} is too large", where=item.where, remedy="scale it down") from None
        except (UnidentifiedImageError, OSError, SyntaxError, ValueError, EOFError) as error:
            reason = str(error).replace(repr(data), "data")[:80] if not _is_unknown(error) else "unknown format"
            raise item.error(f"the image cannot be decoded ({reason})", "save it as PNG or JPEG") from None


def _is_unknown(error: Exception) -> bool:
    return isinstance(error, UnidentifiedImageError)


def _extension_number(item: Json, name: str, key: str, default: float) -> float:
    extension = item.extension(name)
    return default if extension is None else extension.number(key, default, low=0.0)


class _TextureSlots:
    """The textures of one material, which share one uv set and one transform: those of the first."""

    def __init__(self, reader: MaterialReader, item: Json) -> None:
        self._reader = reader
        self._item = item
        self._used = False
        self.texcoord = 0
        self.uv_transform: FloatArray | None = None

    def image(self, slot: Json | None, *, srgb: bool) -> Image | None:
        """The image of a textureInfo (None if there is none), and note how it is addressed."""
        number = self._reader.image_number(slot) if slot is not None else None
        if slot is None or number is None:
            return None
        texcoord, transform = _addressing(slot)
        if not self._used:
            self.texcoord, self.uv_transform, self._used = texcoord, transform, True
        elif texcoord != self.texcoord or not _same(transform, self.uv_transform):
            self._reader._file.announce(
                f"material '{self._item.name}': its textures differ in uv set or transform, the first one's is used"
            )
        return self._reader.image(number, srgb=srgb)


def _addressing(slot: Json) -> tuple[int, FloatArray | None]:
    """uv set and matrix of a textureInfo (KHR_texture_transform: translation x rotation x scale)."""
    texcoord = slot.integer("texCoord", 0)
    extension = slot.extension("KHR_texture_transform")
    if extension is None:
        return texcoord, None
    (u, v), (su, sv) = extension.floats("offset", (0.0, 0.0)), extension.floats("scale", (1.0, 1.0))
    angle = extension.number("rotation", 0.0)
    c, s = math.cos(angle), math.sin(angle)
    matrix = np.array([[c * su, s * sv, u], [-s * su, c * sv, v], [0.0, 0.0, 1.0]])
    return extension.integer("texCoord", texcoord), None if np.array_equal(matrix, np.eye(3)) else matrix


def _same(one: FloatArray | None, two: FloatArray | None) -> bool:
    if one is None or two is None:
        return one is two
    return bool(np.array_equal(one, two))


def _with_constants_folded(material: Material) -> Material:
    """A metallic-roughness image of one value becomes factors, so that a metal baked into it is seen to be one."""
    image = material.metallic_roughness_image
    if image is None:
        return material
    channels = image.pixels[..., 1:3]
    if np.any(channels != channels[0, 0]):
        return material
    roughness, metallic = (float(x) / 255.0 for x in channels[0, 0])
    return replace(
        material,
        metallic_roughness_image=None,
        roughness=material.roughness * roughness,
        metallic=material.metallic * metallic,
    )
