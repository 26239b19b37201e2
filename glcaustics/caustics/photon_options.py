"""Options of photon tracing: the ladder of quality, ranges, defaults and help."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glcaustics.errors import UsageError

LADDER: Mapping[str, Mapping[str, Any]] = {
    quality: {
        "photons": photons,
        "caster_size": caster,
        "map_size": receiver,
        "max_iterations": iterations,
        "march_steps": steps,
        "view_steps": view_steps,
        "internal_bounces": bounces,
        "denoise_passes": passes,
    }
    for quality, photons, caster, receiver, iterations, steps, view_steps, bounces, passes in (
        ("draft", 1 << 16, 192, 256, 6, 16, 64, 0, 4),
        ("low", 1 << 18, 384, 512, 8, 24, 96, 1, 4),
        ("medium", 1 << 19, 768, 768, 10, 32, 160, 2, 5),
        ("high", 1 << 20, 1024, 1024, 12, 48, 256, 4, 5),
        ("reference", 1 << 22, 2048, 2048, 16, 96, 1024, 8, 5),
    )
}
RANGES: Mapping[str, tuple[int, int]] = {
    "photons": (64, 1 << 24),
    "caster_size": (8, 8192),
    "map_size": (8, 8192),
    "max_iterations": (1, 64),
    "march_steps": (1, 512),
    "view_steps": (8, 16384),
    "internal_bounces": (0, 32),
    "denoise_passes": (1, 8),
    "history_frames": (1, 1024),
}
SHARES = ("luminance_cutoff", "roughness_cutoff")  # numbers from 0 to 1
CHOICES = {"fresnel": ("split", "chance"), "march": ("hierarchical", "dda")}
FLAGS = ("reflect", "dispersion", "denoise", "adaptive")
HELP: Mapping[str, str] = {
    "photons": "about this many start a frame, a light and kind of path (64..16777216)",
    "caster_size": "the casters' light view has about this^2 texels (8..8192)",
    "map_size": "the receivers' light view has about this^2 texels (8..8192)",
    "max_iterations": "of the intersection estimate in the light's view (1..64)",
    "march_steps": "of the march in the light's view where the estimate fails (1..512)",
    "view_steps": "of the march in the camera's view, and of reflected photons in the light's (8..16384)",
    "march": "in the camera's view: hierarchical, or dda: pixel by pixel, the paper's, as a baseline",
    "internal_bounces": "total reflections followed inside a solid (0..32)",
    "fresnel": "split: every photon is refracted and reflected, weighted; chance: one of both, drawn",
    "adaptive": "more photons start where the last frames' photons showed in the picture (true, false)",
    "luminance_cutoff": "photons that keep less of the light's luminance than this share are not traced (0..1)",
    "roughness_cutoff": "rougher surfaces send no photons out (0..1)",
    "reflect": "follow light that water and glass throw back (true, false)",
    "dispersion": "refract red, green and blue apart where a material disperses (true, false)",
    "denoise": "filter over time and space (true, false); without, the estimate is unbiased and noisy",
    "denoise_passes": "a-trous passes of the filter (1..8)",
    "history_frames": "longest memory of the filter (1..1024)",
}
DEFAULTS: Mapping[str, Any] = {
    "fresnel": "split",
    "march": "hierarchical",
    "adaptive": True,
    "luminance_cutoff": 0.0,
    "roughness_cutoff": 1.0,
    "reflect": True,
    "dispersion": True,
    "denoise": True,
    "history_frames": 64,
}


def check(options: Mapping[str, Any], where: str) -> None:
    """Raise UsageError for an option out of its range; `where`: whose options they are."""
    for name, (low, high) in RANGES.items():
        value = options[name]
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            remedy = f"give a whole number from {low} to {high}"
            raise UsageError(f"option {name} is {value!r}", where=where, remedy=remedy)
    for name in SHARES:
        value = options[name]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value <= 1.0:
            raise UsageError(f"option {name} is {value!r}", where=where, remedy="give a number from 0 to 1")
    for name, words in CHOICES.items():
        if options[name] not in words:
            remedy = f"use one of {', '.join(words)}"
            raise UsageError(f"option {name} is {options[name]!r}", where=where, remedy=remedy)
    for name in FLAGS:
        if not isinstance(options[name], bool):
            raise UsageError(f"option {name} is {options[name]!r}", where=where, remedy="use true or false")
