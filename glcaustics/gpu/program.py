"""A linked program with strict uniforms and textures that find their own units."""

from __future__ import annotations

import difflib
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from glcaustics.errors import ShaderError
from glcaustics.gpu.shader_source import ShaderSource

_SCALAR_TYPES = {"f": np.float32, "i": np.int32, "I": np.uint32, "u": np.uint32}
_STAGE_IN_MESSAGE = re.compile(r"^(\w+)_shader$", re.M)
Textures = moderngl.Texture | moderngl.TextureArray | moderngl.TextureCube | moderngl.Texture3D


@dataclass
class _Slot:
    """How to upload one active uniform: its type, its shape in column-vector form, and the bytes it holds now."""

    uniform: Any
    dtype: type
    array_length: int
    shape: tuple[int, ...]
    matrix: bool
    glsl_type: str
    current: bytes = b""


class Program:
    """A linked program. Made by `Device.program`.

    Set uniforms through `set` alone: it skips values that have not changed, so writes through `gl` would be overlooked.

    Args:
        ctx: the moderngl context, current.
        source: assembled stages.
        label: path and defines, for messages.
        varyings: outputs captured by transform feedback; the program then has no fragment stage.

    Raises:
        ShaderError: it does not compile or link; file and line are those of the shader's own file.
    """

    def __init__(self, ctx: moderngl.Context, source: ShaderSource, label: str, varyings: tuple[str, ...] = ()) -> None:
        self.label = label
        self.source = source
        self.gl = _link(ctx, source, label, varyings)
        self._slots: dict[str, _Slot] = {}
        self._units: dict[str, tuple[int, int, str]] = {}  # sampler -> first unit, count, GLSL type
        self._textures: dict[str, tuple[Textures, ...]] = {}
        self._inspect()

    def _inspect(self) -> None:
        unit = 0
        for name in sorted(self.gl):
            member = self.gl[name]
            if not isinstance(member, moderngl.Uniform):
                continue
            glsl_type = self.source.uniforms.get(_base(name), "")
            if "sampler" in glsl_type:
                count = member.array_length
                member.value = unit if count == 1 else list(range(unit, unit + count))
                self._units[name] = (unit, count, glsl_type)
                unit += count
            else:
                self._slots[name] = _slot(member, glsl_type)

    @property
    def is_released(self) -> bool:
        """Whether the driver's object is gone."""
        return isinstance(self.gl.mglo, moderngl.InvalidObject)

    def set(self, **values: Any) -> Program:
        """Set uniforms and samplers by name.

        Args:
            **values: numbers, sequences and arrays; matrices in column-vector form (`M @ p`), shape (rows, columns);
                samplers take a moderngl texture (arrays of samplers a sequence of them). A member of a uniform struct
                is set by its full name: `set(**{"u_lights[0].color": ...})`.

        Raises:
            ShaderError: the shader declares no such uniform, or the value does not fit its type. A uniform that is
                declared but was optimised out is passed over.
        """
        for name, value in values.items():
            slot = self._slots.get(name)
            if slot is not None:
                self._upload(name, slot, value)
            elif name in self._units:
                self._set_texture(name, value)
            else:
                self._check_declared(name)
        return self

    def set_all(self, values: Mapping[str, Any]) -> Program:
        """`set` from a mapping, passing over names that this shader does not declare: for values many shaders share."""
        return self.set(**{name: value for name, value in values.items() if _base(name) in self.source.uniforms})

    def declares(self, name: str) -> bool:
        """Whether some stage's source declares the uniform."""
        return _base(name) in self.source.uniforms

    def use(self) -> None:
        """Bind the program's textures to its units. The draw calls of `Device` do this.

        Raises:
            ShaderError: a sampler has no texture, or its texture was released.
        """
        for name, (unit, _, _) in self._units.items():
            textures = self._textures.get(name)
            if textures is None:
                remedy = f"call set({name}=texture)"
                raise ShaderError(f"sampler '{name}' has no texture", where=self.label, remedy=remedy)
            for i, texture in enumerate(textures):
                if isinstance(texture.mglo, moderngl.InvalidObject):
                    raise ShaderError(f"the texture of sampler '{name}' was released", where=self.label)
                texture.use(unit + i)

    def sampled(self) -> dict[int, str]:
        """GL name of each texture that the program samples -> name of its sampler."""
        return {t.glo: name for name, textures in self._textures.items() for t in textures}

    def release(self) -> None:
        """Give the driver's object back."""
        self._textures.clear()
        if not self.is_released:
            self.gl.release()

    def _upload(self, name: str, slot: _Slot, value: Any) -> None:
        if type(value) is float and slot.shape == () and slot.array_length == 1 and slot.dtype is np.float32:
            data = struct.pack("f", value)
        else:
            data = self._pack(name, slot, value)
        if data != slot.current:
            slot.uniform.write(data)
            slot.current = data

    def _pack(self, name: str, slot: _Slot, value: Any) -> bytes:
        array = np.asarray(value)
        if array.dtype.kind not in "fiub" or (slot.dtype is not np.float32 and array.dtype.kind == "f"):
            raise ShaderError(f"uniform '{name}' is {slot.glsl_type} but the value is {value!r}", where=self.label)
        lead = array.shape[: array.ndim - len(slot.shape)]
        wanted_lead = () if slot.array_length == 1 and not lead else (slot.array_length,)
        if array.shape[len(lead) :] != slot.shape or len(lead) > 1 or len(lead) != len(wanted_lead):
            raise self._shape_error(name, slot, array)
        array = array.astype(slot.dtype, copy=False)
        if slot.matrix:
            array = np.swapaxes(array, -1, -2)
        if lead and lead[0] != slot.array_length:
            array = self._fit(name, slot, array)
        return np.ascontiguousarray(array).tobytes()

    def _fit(self, name: str, slot: _Slot, array: np.ndarray) -> np.ndarray:
        """A shorter array leaves the rest of the shader's at zero; a driver may have cut the shader's unused tail."""
        declared = self.source.array_lengths.get(name, slot.array_length)
        if declared is not None and len(array) > max(declared, slot.array_length):
            raise self._shape_error(name, slot, array)
        fitted = np.zeros((slot.array_length, *array.shape[1:]), slot.dtype)
        count = min(len(array), slot.array_length)
        fitted[:count] = array[:count]
        return fitted

    def _shape_error(self, name: str, slot: _Slot, array: np.ndarray) -> ShaderError:
        wanted = slot.glsl_type
        if name in self.source.array_lengths:
            wanted += f"[{self.source.array_lengths[name] or slot.array_length}]"
        return ShaderError(f"uniform '{name}' is {wanted} but the value has shape {array.shape}", where=self.label)

    def _set_texture(self, name: str, value: Any) -> None:
        _, count, glsl_type = self._units[name]
        textures = tuple(value) if isinstance(value, (list, tuple)) else (value,)
        if len(textures) < count or not all(isinstance(t, Textures) for t in textures):
            raise ShaderError(f"sampler '{name}' wants {count} texture(s) but the value is {value!r}", where=self.label)
        for texture in textures:
            compare = getattr(texture.extra, "compare", None)
            if compare is not None and compare != glsl_type.endswith("Shadow"):
                raise ShaderError(
                    f"sampler '{name}' is {glsl_type} but texture '{texture.extra.label}' has depth compare "
                    f"{'on' if compare else 'off'}",
                    where=self.label,
                    remedy="make the texture with the other value of `compare`, or change the sampler's type",
                )
        self._textures[name] = textures[:count]

    def _check_declared(self, name: str) -> None:
        parts = re.findall(r"[A-Za-z_]\w*", name)
        if parts and parts[0] in self.source.uniforms and all(part in self.source.identifiers for part in parts):
            return
        near = difflib.get_close_matches(name, sorted(self.source.uniforms), n=3, cutoff=0.4)
        declared = ", ".join(sorted(self.source.uniforms)) or "none"
        remedy = f"nearest: {', '.join(near)}" if near else f"declared are: {declared}"
        raise ShaderError(f"no stage declares a uniform '{name}'", where=self.label, remedy=remedy)


def _base(name: str) -> str:
    return re.split(r"[.\[]", name, maxsplit=1)[0]


def _slot(member: Any, glsl_type: str) -> _Slot:
    dtype = _SCALAR_TYPES[member.fmt[-1]]
    if member.matrix:
        found = re.search(r"mat(\d)(?:x(\d))?", glsl_type)
        side = round(member.dimension**0.5)
        columns, rows = (int(found[1]), int(found[2] or found[1])) if found else (side, side)
        shape: tuple[int, ...] = (rows, columns)
    else:
        shape = () if member.dimension == 1 else (member.dimension,)
    return _Slot(member, dtype, member.array_length, shape, bool(member.matrix), glsl_type or "uniform")


def _link(ctx: moderngl.Context, source: ShaderSource, label: str, varyings: tuple[str, ...]) -> moderngl.Program:
    try:
        return ctx.program(
            vertex_shader=source.stages["vert"],
            geometry_shader=source.stages.get("geom"),
            fragment_shader=None if varyings else source.stages.get("frag"),
            varyings=varyings,
        )
    except moderngl.Error as error:
        message = str(error)
        details = [line.strip() for line in message.splitlines() if "error" in line.lower()]
        text = source.locate("\n".join(details[:5])) or " ".join(message.split())
        stage = _STAGE_IN_MESSAGE.search(message)
        what = f"{stage.group(1)} stage of {label} does not compile" if stage else f"{label} does not link"
        raise ShaderError(f"{what}: {text}", where=source.first_place(message)) from error
