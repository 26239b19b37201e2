"""What of a scene a frame does not follow, said once and in stats: sizes of lights, roughness of specular surfaces."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from glcaustics.caustics.method import CausticsMethod
from glcaustics.passes.geometry import SPECULAR_KINDS
from glcaustics.scene.model import Instance, Light, LightKind, Material

FOLLOWED_BY = "photon_trace"
DIRECT, EYE, ENCLOSED = "direct light", "the eye's rays", "what lies within its sphere"


def ignored_parts(
    instances: Iterable[Instance], lights: Iterable[Light], method: type[CausticsMethod] | None, *, specular_view: bool
) -> list[dict[str, Any]]:
    """Rows {"what": key of the size, or "roughness", "of": name, "value": number, "by": who ignores it}.

    Args:
        method: that computes the caustics; None: there are none.
        specular_view: whether the eye sees specular surfaces.
    """
    rows: list[dict[str, Any]] = []
    specular = [i for i in instances if i.optical_kind in SPECULAR_KINDS]
    blind = [method.name] if specular and method is not None and not method.follows_size_and_roughness else []
    for light in lights:
        if light.shines and light.has_size:
            what, value = light_size(light)
            rows += [{"what": what, "of": light.name, "value": value, "by": who} for who in (*blind, DIRECT)]
            if not blind and method is not None and _encloses(light, specular):
                rows.append({"what": what, "of": light.name, "value": value, "by": ENCLOSED})
    materials: dict[int, Material] = {id(i.material): i.material for i in specular if i.material.roughness > 0.0}
    for material in materials.values():
        value = float(material.roughness)
        for who in (*blind, *((EYE,) if specular_view else ())):
            rows.append({"what": "roughness", "of": material.name, "value": value, "by": who})
    return rows


def _encloses(light: Light, specular: Iterable[Instance]) -> bool:
    """Whether a vertex lies within the light's sphere, where its light is not defined."""
    if light.kind is LightKind.DIRECTIONAL:
        return False
    centre, radius_m = np.asarray(light.position_ws, np.float64), light.radius_m
    return any(bool((((i.positions_ws() - centre) ** 2).sum(axis=1) < radius_m**2).any()) for i in specular)


def light_size(light: Light) -> tuple[str, float]:
    """The key of a light's size and its value: `angular_diameter_deg`, or `radius_m`."""
    if light.kind is LightKind.DIRECTIONAL:
        return "angular_diameter_deg", math.degrees(light.angular_diameter_rad)
    return "radius_m", light.radius_m


def ignored_words(rows: Iterable[dict[str, Any]]) -> list[str]:
    """One line for whom and what, all names in it."""
    groups: dict[tuple[str, bool], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["by"], row["what"] == "roughness"), []).append(row)
    lines = []
    for (who, is_rough), members in groups.items():
        names = ", ".join(f"'{row['of']}' ({row['what']} {row['value']:.3g})" for row in members)
        if who == ENCLOSED:
            lines.append(
                f"specular surfaces lie within the sphere of {names}: the light that falls on them is not exact"
            )
            continue
        taken = "as smooth" if is_rough else "as a point: its shadows are hard" if who == DIRECT else "as a point"
        remedy = "" if who in (DIRECT, EYE) else f"; method {FOLLOWED_BY} follows it"
        lines.append(f"{who} {'take' if who == EYE else 'takes'} {names} {taken}{remedy}")
    return lines
