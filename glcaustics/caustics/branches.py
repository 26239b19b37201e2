"""The branches into which one light splits at specular surfaces, and the statistics of their solves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from glcaustics.passes.frame import FrameSetup, LightSetup
from glcaustics.passes.geometry import TRANSMISSIVE_KINDS
from glcaustics.passes.receiver_views import BELOW, BESIDE
from glcaustics.passes.runner import PlanRunner
from glcaustics.scene.model import OpticalKind

STATUS_WORDS = {  # negative values in landing.w; see solve.frag
    -1: "total_internal_reflection",
    -2: "hidden_from_the_light",
    -3: "unconverged",
    -4: "no_exit_found",
    -5: "absorbed",
    -7: "met_another_specular_surface",
}
NO_EXIT = -4
LEFT = -8  # out of the scene: not lost, there is nothing to land on
CONVERGED, BRACKETED = 1, 2  # where light lands, plus 2 x its path through solids: see `solids_entered`


REFLECT, INTERFACE, SOLID = "reflect", "interface", "solid"
BRANCH_CODE = {REFLECT: 0, INTERFACE: 1, SOLID: 2}  # solve.frag's BRANCH
WORDS = {REFLECT: "reflected", INTERFACE: "refracted", SOLID: "twice refracted"}


@dataclass(frozen=True)
class Branch:
    """Light of one source that takes one kind of path, of all colour channels or of one, as a method follows it.

    `kind`: REFLECT (mirrors, and what water and glass throw back), INTERFACE (through an open surface), SOLID (in and
    out again). `channels`: 1 for the colour channels carried; `channel`: the one whose index of refraction counts.
    """

    method: str
    light_index: int
    kind: str
    channels: tuple[float, float, float] = (1.0, 1.0, 1.0)
    channel: int = 1
    suffix: str = ""
    zone: str = ""

    @property
    def view(self) -> str:
        """The receiver view that holds where it lands."""
        return BELOW if self.kind == INTERFACE else BESIDE

    @property
    def map_view(self) -> str:
        """The receiver view whose map it is drawn into: `view`, or its core."""
        return self.view + self.zone

    @property
    def words(self) -> str:
        return WORDS[self.kind] + self.suffix.replace(".", " ")

    def pass_name(self, stage: str) -> str:
        return f"{self.method}.{stage}.{self.kind}{self.suffix}{self.zone}@{self.light_index}"

    def resource(self, name: str) -> str:
        """A resource of this branch: "displaced_mesh.interface.cell@0"."""
        zone = "" if name in ("landing_ws", "flux") else self.zone  # one solve serves both maps
        return f"{self.method}.{self.kind}{self.suffix}{zone}.{name}@{self.light_index}"

    @property
    def landing(self) -> str:
        return self.resource("landing_ws")

    @property
    def flux(self) -> str:
        return self.resource("flux")

    @property
    def splat(self) -> str:
        return self.resource("splat")

    @property
    def conic(self) -> str:
        return self.resource("conic")


def branches_of(setup: FrameSetup, light: LightSetup, method: str) -> list[Branch]:
    """What the scene's materials call for; `method`: the name of the method that follows them."""
    kinds = setup.kinds()
    transmissive = [i for i in setup.instances() if i.optical_kind in TRANSMISSIVE_KINDS]
    branches = []
    for kind, optical in ((INTERFACE, OpticalKind.INTERFACE), (SOLID, OpticalKind.SOLID)):
        members = [i for i in transmissive if i.optical_kind is optical]
        if not members:
            continue
        if setup.options["dispersion"] and any(i.material.dispersion > 0.0 for i in members):
            for channel, name in enumerate(("red", "green", "blue")):
                mask = tuple(1.0 if c == channel else 0.0 for c in range(3))
                branches.append(Branch(method, light.index, kind, (mask[0], mask[1], mask[2]), channel, f".{name}"))
        else:
            branches.append(Branch(method, light.index, kind))
    if OpticalKind.MIRROR in kinds or (transmissive and setup.options["reflect"]):
        branches.append(Branch(method, light.index, REFLECT))
    return branches


def solids_entered(status: np.ndarray) -> np.ndarray:
    """How many solids light has entered after its first one, by landing.w (any shape); 0 where it does not land."""
    return np.maximum(status.astype(int) - 1, 0) // 2 // 8


def solve_statistics(branch: Branch, runner: PlanRunner) -> dict[str, Any]:
    """Iterations, converged and failed rays, and the flux they carry or lose, of one solve. Reads two textures back."""
    landing = read_rgba32f(runner, branch.landing)
    flux = read_rgba32f(runner, branch.flux)
    status = np.rint(landing[..., 3]).astype(int)
    lumens = flux[..., :3].astype(np.float64).sum(axis=2) / max(sum(branch.channels), 1.0)
    tried = status != 0
    landed = status > 0
    total = float(lumens[tried].sum())
    lost = {word: float(lumens[status == code].sum()) for code, word in STATUS_WORDS.items() if (status == code).any()}
    left = status == LEFT
    iterations = flux[..., 3][tried]
    return {
        "solve": branch.pass_name("solve"),
        "rays": int(tried.sum()),
        "converged": int((landed & (status % 2 == CONVERGED % 2)).sum()),
        "bracketed": int((landed & (status % 2 == BRACKETED % 2)).sum()),
        "left_the_scene": int(left.sum()),
        "failed": int((tried & ~landed & ~left).sum()),
        "lookups_mean": float(iterations.mean()) if iterations.size else 0.0,
        "lookups_max": int(iterations.max()) if iterations.size else 0,
        "flux": total,
        "flux_landed": float(lumens[landed].sum()),
        "flux_left_the_scene": float(lumens[left].sum()),
        "flux_lost": float(sum(lost.values())),
        "flux_lost_by_cause": lost,
        "flux_lost_share": float(sum(lost.values()) / total) if total > 0.0 else 0.0,
    }


def read_rgba32f(runner: PlanRunner, resource: str) -> np.ndarray:
    """(H, W, 4) float32, row 0 lowest."""
    texture = runner.texture(resource)
    return np.frombuffer(texture.read(), np.float32).reshape(texture.height, texture.width, 4)
