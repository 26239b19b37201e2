"""Checks of names against what exists, before any work begins."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Any

from glcaustics.errors import UsageError


def check_name(name: str, known: Iterable[str], *, option: str, kind: str) -> str:
    """Returns `name` when it is known. Raises UsageError with the nearest name, or the list, when it is not."""
    names = list(known)
    if name in names:
        return name
    near = difflib.get_close_matches(name, names, n=1)
    remedy = f"did you mean {near[0]}?" if near else f"known: {', '.join(names)}"
    raise UsageError(f"there is no {kind} {name!r}", where=option, remedy=remedy)


def check_method(name: str) -> str:
    """A registered caustics method, 'auto' or 'none'."""
    from glcaustics.caustics.registry import METHODS

    return check_name(name, ("auto", "none", *METHODS), option="--method", kind="caustics method")


def check_aovs(names: Iterable[str], known: Mapping[str, str]) -> tuple[str, ...]:
    """AOV names without repetition, in the order given; `a,b` counts as two names; 'all' means every one."""
    asked = [part for name in names for part in name.split(",") if part]
    for name in asked:
        check_name(name, ("all", *known), option="--aov", kind="AOV")
    return tuple(dict.fromkeys(known if "all" in asked else asked))


def check_settings(settings: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """`--set KEY=VALUE` as options. Raises UsageError for a key given twice."""
    options: dict[str, Any] = {}
    for key, value in settings:
        if key in options:
            raise UsageError(f"{key} is set twice", where="--set", remedy="keep one")
        options[key] = value
    return options
