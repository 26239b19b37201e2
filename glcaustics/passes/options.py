"""What the options of every frame mean, one line each with unit and range, and the check that options of methods and
filters go through. Their values: `renderer.options.BASE_LADDER`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from glcaustics.errors import UsageError

OPTION_HELP: dict[str, str] = {
    "shadow_size": "a shadow map has about this^2 texels (1..16384)",
    "rsm_size": "a reflective shadow map has about this^2 texels (1..16384)",
    "refraction": "how eye rays are solved: cascade, newton, hierarchical, dda or sousa",
    "refraction_iterations": "most look-ups of Newton's method an eye ray (1..16384)",
    "refraction_steps": "most steps of the march that follows a refracted ray (1..16384)",
    "reflection_steps": "most steps of the march that follows a reflected ray (1..16384)",
    "reflection_history": "reflected rays are solved from where they ended in the last frame (true, false; cascade)",
    "depth_layers": "2: eye rays that end behind something are solved in a second layer of opaque surfaces (1, 2)",
    "specular_layers": "2: water, glass and mirrors are seen behind other water and glass, too (1, 2)",
}


def check_options(
    options: Mapping[str, Any],
    where: str,
    *,
    whole: Mapping[str, tuple[int, int]] | None = None,
    numbers: Mapping[str, tuple[float, float]] | None = None,
    choices: Mapping[str, Collection[str]] | None = None,
    flags: Collection[str] = (),
) -> None:
    """Refuse an option out of its range.

    Args:
        options: values by name. where: whose they are, for the error.
        whole, numbers: option -> least and most, of integers and of any numbers.
        choices: option -> the words that it may be. flags: options that are true or false.

    Raises:
        UsageError: the first one that is wrong.
    """

    def refuse(name: str, remedy: str) -> None:
        raise UsageError(f"option {name} is {options[name]!r}", where=where, remedy=remedy)

    for ranges, kinds, noun in ((whole, int, "whole number"), (numbers, (int, float), "number")):
        for name, (low, high) in (ranges or {}).items():
            value = options[name]
            if isinstance(value, bool) or not isinstance(value, kinds) or not low <= value <= high:
                refuse(name, f"give a {noun} from {low} to {high}")
    for name, words in (choices or {}).items():
        if options[name] not in words:
            refuse(name, f"use one of {', '.join(words)}")
    for name in flags:
        if not isinstance(options[name], bool):
            refuse(name, "use true or false")
