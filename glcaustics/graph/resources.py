"""What a pass declares: the textures it writes and reads, and their formats, sizes and units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from glcaustics.errors import GraphError

#: Bytes per texel of every texture format the project uses. `depth24` occupies 32 bits in every driver we know.
FORMAT_BYTES: dict[str, int] = {
    "rgba32f": 16,
    "rg32f": 8,
    "r32f": 4,
    "rgba16f": 8,
    "rg16f": 4,
    "r16f": 2,
    "rgba8": 4,
    "srgba8": 4,
    "r8": 1,
    "depth24": 4,
    "depth32f": 4,
}

FILTERS = ("nearest", "linear")


@dataclass(frozen=True)
class TextureDesc:
    """A 2-D texture that the graph may allocate.

    Args:
        format: a key of `FORMAT_BYTES`.
        size: (width, height) in texels, both at least 1.
        unit: physical unit of the values ("W/m^2", "m"), for the reader of a plan; no effect on allocation.
        filter: "nearest" or "linear".
        compare: depth comparison on (`sampler2DShadow`); depth formats only.

    Raises:
        GraphError: unknown format or filter, a size below 1, or `compare` on a colour format.
    """

    format: str
    size: tuple[int, int]
    unit: str = ""
    filter: str = "nearest"
    compare: bool = False

    def __post_init__(self) -> None:
        if self.format not in FORMAT_BYTES:
            remedy = f"use one of {', '.join(FORMAT_BYTES)}"
            raise GraphError(f"texture format '{self.format}' is unknown", remedy=remedy)
        if self.filter not in FILTERS:
            raise GraphError(f"texture filter '{self.filter}' is unknown", remedy="use nearest or linear")
        if len(self.size) != 2 or min(self.size) < 1:
            raise GraphError(f"texture size {self.size} is not a (width, height) of at least 1 x 1")
        if self.compare and not self.format.startswith("depth"):
            raise GraphError(f"depth compare asked of the colour format '{self.format}'", remedy="use depth24")

    def bytes(self) -> int:
        """Memory of one such texture, without mipmaps or driver padding."""
        return self.size[0] * self.size[1] * FORMAT_BYTES[self.format]

    def allocation_key(self) -> tuple[str, tuple[int, int], str, bool]:
        """Two resources with equal keys can live in the same texture at different times; the unit does not matter."""
        return (self.format, self.size, self.filter, self.compare)


@dataclass(frozen=True)
class PassDecl:
    """One pass of a frame, before anybody knows whether it runs.

    Args:
        name: unique in the graph ("shadow_map@0").
        writes: resource name -> its texture ("gbuffer.depth_m", "caustic_map.flux@0").
        execute: called by the renderer with its pass context when the pass runs.
        reads: resources the pass cannot do without.
        optional: resources it reads if some pass of the graph writes them; that alone keeps the writer alive.
        always_writes: subset of `writes` that is allocated even if nobody reads it (a depth buffer for depth testing).
        view_dependent: the camera enters, not through what it reads but by itself. All that follows from it is drawn
            in every frame; the rest can be kept while the scene stands still.
        history: resources read as the previous frame left them; no ordering within this frame.
        note: one line for the reader of a plan.
    """

    name: str
    writes: Mapping[str, TextureDesc]
    execute: Callable[[Any], None]
    reads: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    always_writes: tuple[str, ...] = ()
    history: tuple[str, ...] = ()
    note: str = ""
    view_dependent: bool = False

    def __post_init__(self) -> None:
        if not self.name:
            raise GraphError("a pass has no name")
        for resource in self.always_writes:
            if resource not in self.writes:
                raise GraphError(f"pass '{self.name}' lists '{resource}' in always_writes but does not write it")
        named_twice = (set(self.reads) & set(self.optional)) or {r for r in self.reads if self.reads.count(r) > 1}
        if named_twice:
            raise GraphError(f"pass '{self.name}' names '{sorted(named_twice)[0]}' twice among its reads")
