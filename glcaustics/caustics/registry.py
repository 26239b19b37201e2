"""All methods by name. A new method is one row here."""

from __future__ import annotations

import difflib

from glcaustics.caustics.caustic_map import CausticMap
from glcaustics.caustics.displaced_mesh import DisplacedMesh
from glcaustics.caustics.method import CausticsMethod
from glcaustics.caustics.photon_trace import PhotonTrace
from glcaustics.errors import UsageError
from glcaustics.scene.model import OpticalKind, Scene

METHODS: dict[str, type[CausticsMethod]] = {
    "caustic_map": CausticMap,
    "displaced_mesh": DisplacedMesh,
    "photon_trace": PhotonTrace,
}

NONE = "none"  # caustics off: light passes through water and glass as if they were not there
AUTO = "auto"


def best_for(scene: Scene) -> type[CausticsMethod]:
    """What "auto" takes: the displaced mesh for water, the caustic map for solids and mirrors.

    Relative RMSE and whole frames, each pair from one run on llvmpipe, quality medium. Water: peer-pool 0.0087 in 152
    ms against the map's 0.044 in 175 ms. Solids: glass-sphere beside its focus 0.044 in 576 ms against 0.015 in 236 ms,
    glass-bunny 0.65 in 787 ms against 0.61 in 272 ms. Mirrors: a nephroid 0.013 in 122 ms against 0.014 in 87 ms.
    """
    kinds = {instance.optical_kind for instance in scene.instances_at(0.0)}
    return DisplacedMesh if OpticalKind.INTERFACE in kinds else CausticMap


def pick(name: str, scene: Scene | None = None) -> type[CausticsMethod] | None:
    """The method of a name; None for "none". "auto" takes what is best for the scene (any scene: the mesh).

    Raises:
        UsageError: no such method.
    """
    if name == NONE:
        return None
    if name == AUTO:
        return best_for(scene) if scene is not None else DisplacedMesh
    if name not in METHODS:
        near = difflib.get_close_matches(name, [*METHODS, NONE, AUTO], n=1)
        raise UsageError(
            f"method '{name}' is unknown",
            where="--method",
            remedy=(f"did you mean '{near[0]}'? " if near else "") + f"there are: {', '.join([*METHODS, NONE, AUTO])}",
        )
    return METHODS[name]
