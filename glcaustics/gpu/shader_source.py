"""GLSL files to compilable text: `#include`, defines, `#line`, and back from a driver's message to file and line.

Reads files only; no OpenGL, so that it is tested without a device.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from glcaustics.errors import ShaderError

#: `#line` directives carry the file's number in the line number too (file * stride + line): Mesa reports every
#: source-string number as 0. Lines below the stride are the version line and the defines, files[0].
LINE_STRIDE = 100_000
DEFINES = "defines"
VERSION_LINE = "#version 330 core"
FULLSCREEN_VERTEX = "interface/fullscreen.vert"

_COMMENT = re.compile(r"//[^\n]*|/\*.*?(?:\*/|\Z)", re.S)
_INCLUDE = re.compile(r"^\s*#\s*include\b(.*)$")
_INCLUDE_PATH = re.compile(r'^\s*"([^"]+)"\s*$')
_CONDITIONAL = re.compile(r"^\s*#\s*(ifdef|ifndef|if|endif)\b")
_IDENTIFIER = re.compile(r"[A-Za-z_]\w*")
_DECLARATION = re.compile(r"\b(uniform|in)\s+(?:(?:lowp|mediump|highp)\s+)?(\w+)\s+([^;{}()]+);")
#: Mesa "0:12(5):", NVIDIA "0(12) :", Intel, AMD, Apple and ANGLE "ERROR: 0:12:".
_PLACE = re.compile(r"^(?:(?:ERROR|WARNING): *)?(\d+)[:(](\d+)(?:\(\d+\))?\)? ?:", re.M)
_DEFINED_NUMBER = re.compile(r"^\s*#\s*define\s+(\w+)\s+(\d+)\s*$", re.M)
_DECLARATOR = re.compile(r"\s*([A-Za-z_]\w*)\s*(?:\[\s*(\w+)\s*\])?")
_UNIFORM_BLOCK = re.compile(r"\buniform\s+(\w+)\s*\{")


def glsl_root() -> Path:
    """Folder of the GLSL files: `glsl/` of a checkout, or the copy inside an installed wheel.

    Raises:
        ShaderError: neither is there.
    """
    package = Path(__file__).resolve().parent.parent
    candidates = (package.parent / "glsl", package / "_data" / "glsl")
    for folder in candidates:
        if (folder / FULLSCREEN_VERTEX).is_file():
            return folder
    raise ShaderError("the folder of the shaders is missing", where=str(candidates[0]), remedy="reinstall glcaustics")


def strip_comments(text: str) -> str:
    """Comments replaced by nothing, with every line break kept, so that line numbers stay."""
    return _COMMENT.sub(lambda match: "\n" * match.group().count("\n") or " ", text)


@dataclass
class ShaderSource:
    """The stages of one program, ready for the driver.

    Args:
        stages: "vert", "frag", "geom" -> full text.
        files: source-string number of a `#line` directive -> path relative to the GLSL root.
        uniforms: declared name -> GLSL type, over all stages, block names with type "block".
        attributes: declared vertex input -> GLSL type.
        identifiers: every identifier that the code (without comments) mentions.
        array_lengths: declared uniform array -> its length, None when it is not a plain number.
    """

    stages: dict[str, str]
    files: list[str]
    uniforms: dict[str, str] = field(default_factory=dict)
    attributes: dict[str, str] = field(default_factory=dict)
    identifiers: set[str] = field(default_factory=set)
    array_lengths: dict[str, int | None] = field(default_factory=dict)

    def locate(self, message: str) -> str:
        """Rewrite the places in a driver's message ("0:12(5)", "0(12)", "ERROR: 0:12:") as "file:line"."""

        def place(match: re.Match[str]) -> str:
            index, line = divmod(int(match.group(2)), LINE_STRIDE)
            return f"{self.files[index] if index < len(self.files) else f'source {index}'}:{line}:"

        return _PLACE.sub(place, message)

    def first_place(self, message: str) -> str:
        """ "file:line" of the first error in a driver's message, empty when it names none."""
        errors = [line for line in message.splitlines() if "error" in line.lower() and _PLACE.search(line)]
        match = _PLACE.search(errors[0] if errors else message)
        if match is None:
            return ""
        return self.locate(match.group()).rstrip(":")


class ShaderLoader:
    """Assembles programs from the files under `root`, and remembers what it has read.

    Args:
        root: folder that `#include "path"` and program paths are relative to.
    """

    def __init__(self, root: Path | None = None) -> None:
        self.root = root or glsl_root()

    def load(
        self, path: str, defines: Mapping[str, object] | None = None, *, vertex: str | None = None
    ) -> ShaderSource:
        """Read `<path>.vert`, `.geom` and `.frag`, as far as they exist.

        Args:
            path: relative to the root, without suffix ("passes/gbuffer/gbuffer").
            defines: name -> value; they enter every stage as `#define NAME VALUE`, sorted. True becomes 1, False 0.
            vertex: another vertex shader, relative to the root, with suffix. Without one and without `<path>.vert`,
                the full-screen triangle is taken.

        Raises:
            ShaderError: no such program, a missing or circular include, or a define that no stage mentions.
        """
        suffixes = [suffix for suffix in ("vert", "geom", "frag") if (self.root / f"{path}.{suffix}").is_file()]
        if not suffixes:
            raise ShaderError(f"there is no shader {path}.vert or {path}.frag", remedy=self._nearest(path + ".frag"))
        names = {suffix: f"{path}.{suffix}" for suffix in suffixes}
        if vertex or "vert" not in names:
            names = {"vert": vertex or FULLSCREEN_VERTEX, **{s: n for s, n in names.items() if s != "vert"}}
        source = ShaderSource({}, [DEFINES])
        texts = {name: define_text(path, name, value) for name, value in sorted((defines or {}).items())}
        header = [VERSION_LINE, *(f"#define {name} {text}" for name, text in texts.items())]
        for suffix, name in names.items():
            body = _Assembly(self, source.files).file(name, "")
            source.stages[suffix] = "\n".join([*header, *body]) + "\n"
            self._note_declarations(source, suffix, "\n".join(body), texts)
        for name in texts:
            if name not in source.identifiers:
                near = difflib.get_close_matches(name, sorted(i for i in source.identifiers if i.isupper()), n=3)
                raise ShaderError(
                    f"the define {name} is mentioned in no stage of '{path}'",
                    remedy=f"nearest: {', '.join(near)}" if near else "drop it or spell it as the shader does",
                )
        return source

    @staticmethod
    def _note_declarations(source: ShaderSource, suffix: str, body: str, defines: Mapping[str, str]) -> None:
        code = strip_comments(body)
        numbers = {**dict(_DEFINED_NUMBER.findall(code)), **defines}
        source.identifiers.update(_IDENTIFIER.findall(code))
        for qualifier, kind, names in _DECLARATION.findall(code):
            target = source.uniforms if qualifier == "uniform" else source.attributes if suffix == "vert" else None
            if target is not None:
                for declarator in names.split(","):
                    found = _DECLARATOR.match(declarator)
                    if found:
                        target[found[1]] = kind
                        if found[2] is not None and qualifier == "uniform":
                            length = str(numbers.get(found[2], found[2]))
                            source.array_lengths[found[1]] = int(length) if length.isdigit() else None
        for name in _UNIFORM_BLOCK.findall(code):
            source.uniforms[name] = "block"

    def read(self, name: str, included_from: str) -> str:
        """Text of one file. Raises ShaderError naming the place of the include and the nearest file."""
        file = self.root / name
        if not file.is_file():
            what = f"'{name}' does not exist under {self.root}"
            raise ShaderError(what, where=included_from, remedy=self._nearest(name))
        return file.read_text(encoding="utf-8")

    def _nearest(self, name: str) -> str:
        files = [f.relative_to(self.root).as_posix() for f in self.root.rglob("*") if f.is_file()]
        base = name.rsplit("/", 1)[-1]
        same_base = [f for f in files if f.rsplit("/", 1)[-1] == base]
        near = same_base or difflib.get_close_matches(name, files, n=3, cutoff=0.5)
        return f"nearest: {', '.join(near)}" if near else f"the shaders are under {self.root}"


class _Assembly:
    """Expands the includes of one stage. Each file enters once, unless it first stood inside an `#if`."""

    def __init__(self, loader: ShaderLoader, files: list[str]) -> None:
        self._loader = loader
        self._files = files
        self._stack: list[str] = []
        self._surely_included: set[str] = set()

    def file(self, name: str, included_from: str, conditional: bool = False) -> list[str]:
        """Lines of a file with its includes expanded, beginning with its `#line` directive."""
        if name in self._stack:
            loop = " -> ".join([*self._stack[self._stack.index(name) :], name])
            remedy = "move what both need to a third file"
            raise ShaderError(f"circular include: {loop}", where=included_from, remedy=remedy)
        text = self._loader.read(name, included_from)
        if name not in self._files:
            self._files.append(name)
        number = self._files.index(name)
        if not conditional:
            self._surely_included.add(name)
        self._stack.append(name)
        lines = [_line_directive(1, number)]
        depth = 0
        pairs = zip(text.split("\n"), strip_comments(text).split("\n"), strict=True)
        for line_number, (line, code) in enumerate(pairs, 1):
            directive = _CONDITIONAL.match(code)
            if directive:
                depth += -1 if directive.group(1) == "endif" else 1
            include = _INCLUDE.match(code)
            if not include:
                lines.append(line)
                continue
            where = f"{name}:{line_number}"
            lines += self._include(include.group(1), where, conditional or depth > 0)
            lines.append(_line_directive(line_number + 1, number))
        self._stack.pop()
        return lines

    def _include(self, operand: str, where: str, conditional: bool) -> list[str]:
        path = _INCLUDE_PATH.match(operand)
        if not path:
            raise ShaderError(f'#include{operand} is not of the form #include "folder/file.glsl"', where=where)
        target = path.group(1)
        if target in self._surely_included and target not in self._stack:
            return []
        guard = "GLC_INCLUDED_" + re.sub(r"\W", "_", target).upper()
        return [f"#ifndef {guard}", f"#define {guard}", *self.file(target, where, conditional), "#endif"]


def _line_directive(line: int, number: int) -> str:
    return f"#line {number * LINE_STRIDE + line} {number}"


def define_text(path: str, name: str, value: object) -> str:
    """Text of a define's value. Raises ShaderError when it is neither a number nor a one-line string."""
    if not _IDENTIFIER.fullmatch(name):
        raise ShaderError(f"'{name}' cannot be the name of a define of '{path}'")
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, (int, float, str)) and "\n" not in str(value):
        return str(value)
    remedy = "use a number or a one-line string"
    raise ShaderError(f"the define {name} of '{path}' has the value {value!r}", remedy=remedy)
