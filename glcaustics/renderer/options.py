"""Which options hold: the quality ladder's, with the user's own on top."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glcaustics.caustics.method import CausticsMethod
from glcaustics.denoise import svgf
from glcaustics.errors import UsageError
from glcaustics.passes import gbuffer, refraction, specular_layers
from glcaustics.passes.options import OPTION_HELP, check_options
from glcaustics.quality import QUALITIES

BASE_LADDER: dict[str, dict[str, Any]] = {
    quality: {
        "shadow_size": shadow,
        "rsm_size": rsm_size,
        "refraction": solver,
        "refraction_iterations": iterations,
        "refraction_steps": steps,
        "reflection_steps": reflection,
        "reflection_history": False,
        "depth_layers": 1,
        "specular_layers": specular_layers.MAX_LAYERS,
    }
    for quality, shadow, rsm_size, solver, iterations, steps, reflection in (
        ("draft", 512, 256, "newton", 3, 256, 24),
        ("low", 1024, 512, "cascade", 3, 1024, 32),
        ("medium", 1536, 1024, "cascade", 4, 4096, 48),
        ("high", 2048, 2048, "cascade", 6, 8192, 96),
        ("reference", 4096, 2048, "cascade", 8, 16384, 256),
    )
}

_COUNTS = ("shadow_size", "rsm_size", "refraction_iterations", "refraction_steps", "reflection_steps")


def default_options(method: type[CausticsMethod] | None, quality: str) -> dict[str, Any]:
    """Every option there is with a method (None: no caustics), at its value for a quality.

    Raises:
        UsageError: unknown quality.
    """
    if quality not in QUALITIES:
        raise UsageError(
            f"quality '{quality}' is unknown", where="--quality", remedy=f"use one of {', '.join(QUALITIES)}"
        )
    options = dict(BASE_LADDER[quality])
    if method is not None:
        options |= {**getattr(method, "defaults", {}), **method.ladder[quality]}
        if method.noisy:
            options = {**svgf.DEFAULTS, **options}
    return options


def option_help(method: type[CausticsMethod] | None) -> dict[str, str]:
    """One line with unit and range for each of `default_options`: the method's own, its filter's, every frame's."""
    if method is None:
        return dict(OPTION_HELP)
    return {**method.option_help, **(svgf.OPTION_HELP if method.noisy else {}), **OPTION_HELP}


def resolve_options(method: type[CausticsMethod] | None, quality: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """The ladder's options with the user's on top.

    Raises:
        UsageError: unknown quality or option, or a value out of range.
    """
    resolved = default_options(method, quality)
    for name, value in options.items():
        if name not in resolved:
            raise UsageError(
                f"option '{name}' is unknown", where="--set", remedy=f"there are: {', '.join(sorted(resolved))}"
            )
        resolved[name] = {"true": True, "false": False}.get(value, value) if isinstance(value, str) else value
    refraction.check_solver(resolved["refraction"])
    layers = {"depth_layers": (1, len(gbuffer.LAYERS)), "specular_layers": (1, specular_layers.MAX_LAYERS)}
    whole = {**dict.fromkeys(_COUNTS, (1, 16384)), **layers}
    check_options(resolved, "--set", whole=whole, flags=("reflection_history",))
    if method is not None:
        method.validate(resolved)
        if method.noisy:
            svgf.check(resolved)
    return resolved
