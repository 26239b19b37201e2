"""What became of the photons of one branch: counts and flux by cause, in the light's view and in the camera's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from glcaustics.caustics.branches import Branch, read_rgba32f
from glcaustics.passes.runner import PlanRunner

# Status of a photon, see the shaders; 0: none started there.
LANDED = {1: "by_light_view", 2: "by_eye_view"}
UNSEEN = {-9: "hidden_from_the_eye", -10: "outside_of_the_picture"}  # landed, but not where the picture shows it
LEFT = -8
LOST = {
    -1: "total_internal_reflection",
    -2: "hidden_from_the_light_and_the_eye",
    -3: "unresolved",
    -4: "no_exit_found",
    -5: "absorbed",
    -7: "met_another_specular_surface",
    -11: "scattered_between_facets",
    -12: "below_the_luminance_cutoff",
    -13: "rougher_than_the_cutoff",
}


def landing_of(branch: Branch) -> str:
    """Where the photons of a branch land: pixel, 1 / area of the receiver within it, status."""
    return branch.resource("landing_px")


def photon_statistics(branch: Branch, runner: PlanRunner) -> dict[str, Any]:
    """Photons and their flux by what became of them. Reads two textures back."""
    landing, flux = (read_rgba32f(runner, r) for r in (landing_of(branch), branch.flux))
    status = np.rint(landing[..., 3]).astype(int)
    lumens = flux[..., :3].astype(np.float64).sum(axis=2) / max(sum(branch.channels), 1.0)
    tried = status != 0
    total = float(lumens[tried].sum())

    def by(words: Mapping[int, str]) -> dict[str, float]:
        return {word: float(lumens[status == code].sum()) for code, word in words.items() if (status == code).any()}

    landed, unseen, lost = by(LANDED), by(UNSEEN), by(LOST)
    flux_lost = sum(lost.values())
    lookups = flux[..., 3][tried]
    return {
        "solve": branch.pass_name("trace"),
        "rays": int(tried.sum()),
        "converged": int((status == 1).sum()),
        "bracketed": int((status == 2).sum()),
        "unseen": int(np.isin(status, list(UNSEEN)).sum()),
        "left_the_scene": int((status == LEFT).sum()),
        "failed": int(np.isin(status, list(LOST)).sum()),
        "lookups_mean": float(lookups.mean()) if lookups.size else 0.0,
        "lookups_max": int(lookups.max()) if lookups.size else 0,
        "flux": total,
        "flux_landed": sum(landed.values()),
        "flux_landed_by_view": landed,
        "flux_unseen_by_cause": unseen,
        "flux_left_the_scene": float(lumens[status == LEFT].sum()),
        "flux_lost": float(flux_lost),
        "flux_lost_by_cause": lost,
        "flux_lost_share": float(flux_lost / total) if total > 0.0 else 0.0,
    }
