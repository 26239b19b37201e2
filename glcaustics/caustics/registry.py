"""All methods by name. A new method is one row here."""

from __future__ import annotations

import difflib

from glcaustics.caustics.caustic_map import CausticMap
from glcaustics.caustics.displaced_mesh import DisplacedMesh
from glcaustics.caustics.method import CausticsMethod
from glcaustics.caustics.photon_trace import PhotonTrace
from glcaustics.errors import UsageError

METHODS: dict[str, type[CausticsMethod]] = {
    "caustic_map": CausticMap,
    "displaced_mesh": DisplacedMesh,
    "photon_trace": PhotonTrace,
}

NONE = "none"  # caustics off: light passes through water and glass as if they were not there
AUTO = "auto"
# What "auto" takes. Relative RMSE of the irradiance and processor time of whole frames, quality medium, llvmpipe, each
# pair from one run: peer-pool 0.0096 in 138 ms against the caustic map's 0.0157 in 153 ms; pool 0.075, 140 ms against
# 0.086, 140 ms; glass-sphere 0.056, 301 ms against 0.187, 365 ms; metal-ring 0.087, 179 ms against 0.548, 129 ms.
BEST = DisplacedMesh


def pick(name: str) -> type[CausticsMethod] | None:
    """The method of a name; None for "none".

    Raises:
        UsageError: no such method.
    """
    if name == NONE:
        return None
    if name == AUTO:
        return BEST
    if name not in METHODS:
        near = difflib.get_close_matches(name, [*METHODS, NONE, AUTO], n=1)
        raise UsageError(
            f"method '{name}' is unknown",
            where="--method",
            remedy=(f"did you mean '{near[0]}'? " if near else "") + f"there are: {', '.join([*METHODS, NONE, AUTO])}",
        )
    return METHODS[name]
