"""All methods by name. A new method is one row here."""

from __future__ import annotations

import difflib

from glcaustics.caustics.caustic_map import CausticMap
from glcaustics.caustics.displaced_mesh import DisplacedMesh
from glcaustics.caustics.method import CausticsMethod
from glcaustics.errors import UsageError

METHODS: dict[str, type[CausticsMethod]] = {
    "caustic_map": CausticMap,
    "displaced_mesh": DisplacedMesh,
}

NONE = "none"  # caustics off: light passes through water and glass as if they were not there
AUTO = "auto"


def pick(name: str) -> type[CausticsMethod] | None:
    """The method of a name; None for "none". "auto" takes caustic_map, so far the only one.

    Raises:
        UsageError: no such method.
    """
    if name == NONE:
        return None
    if name == AUTO:
        return CausticMap
    if name not in METHODS:
        near = difflib.get_close_matches(name, [*METHODS, NONE, AUTO], n=1)
        raise UsageError(
            f"method '{name}' is unknown",
            where="--method",
            remedy=(f"did you mean '{near[0]}'? " if near else "") + f"there are: {', '.join([*METHODS, NONE, AUTO])}",
        )
    return METHODS[name]
