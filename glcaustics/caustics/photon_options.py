"""Options of photon tracing: ladder of quality, ranges, defaults and help; the filter's are in `denoise.svgf`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glcaustics.passes.options import check_options

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
        ("draft", 1 << 16, 192, 256, 6, 16, 64, 2, 4),
        ("low", 1 << 18, 384, 512, 8, 24, 96, 4, 4),
        ("medium", 1 << 19, 768, 768, 10, 32, 160, 16, 5),
        ("high", 1 << 20, 1024, 1024, 12, 48, 256, 24, 5),
        ("reference", 1 << 22, 2048, 2048, 16, 96, 1024, 32, 5),
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
}
SHARES: Mapping[str, tuple[float, float]] = {"luminance_cutoff": (0, 1), "roughness_cutoff": (0, 1)}
CHOICES = {"fresnel": ("split", "chance"), "march": ("hierarchical", "dda")}
FLAGS = ("reflect", "dispersion", "denoise", "adaptive")
HELP: Mapping[str, str] = {
    "photons": "about this many start a frame, a light and kind of path (64..16777216)",
    "caster_size": "the casters' light view has about this^2 texels (8..8192)",
    "map_size": "the receivers' light view has about this^2 texels (8..8192)",
    "max_iterations": "of the intersection estimate in the light's view (1..64)",
    "march_steps": "of the march in the light's view where the estimate fails (1..512)",
    "view_steps": "of the march in the camera's view, and of reflected photons in the light's (8..16384)",
    "march": "hierarchical, or dda: pixel by pixel in both views, the paper's, as a baseline",
    "internal_bounces": "total reflections followed inside a solid (0..32)",
    "fresnel": "split: every photon is refracted and reflected, weighted; chance: one of both, drawn",
    "adaptive": "more photons start where the last frames' photons showed in the picture (true, false)",
    "luminance_cutoff": "photons that keep less of the light's luminance than this share are not traced (0..1)",
    "roughness_cutoff": "rougher surfaces send no photons out (0..1)",
    "reflect": "follow light that water and glass throw back (true, false)",
    "dispersion": "refract red, green and blue apart where a material disperses (true, false)",
    "denoise": "filter over time and space (true, false); without, the estimate is unbiased and noisy",
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
}


def check(options: Mapping[str, Any], where: str) -> None:
    """Raise UsageError for an option out of its range; `where`: whose options they are."""
    check_options(options, where, whole=RANGES, numbers=SHARES, choices=CHOICES, flags=FLAGS)
