"""What a frame does not follow of sizes and roughness is said, by whom, and no more than that."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from glcaustics.caustics.caustic_map import CausticMap
from glcaustics.caustics.ignored import ignored_parts, ignored_words
from glcaustics.caustics.photon_trace import PhotonTrace
from glcaustics.scene.model import Instance, Light, LightKind, Material, Mesh

MESH = Mesh("m", np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 2)), np.zeros((1, 3), np.uint32), False)
STEEL = Material("steel", metallic=1.0, roughness=0.2)
FLOOR = Instance("floor", MESH, Material("floor", roughness=0.7))
LAMP = Light(LightKind.POINT, "lamp", radius_m=0.05)
SUN = Light(LightKind.DIRECTIONAL, "sun", angular_diameter_rad=math.radians(0.53))


def test_points_and_smooth_surfaces_leave_nothing_to_say() -> None:
    smooth = Instance("ring", MESH, replace(STEEL, roughness=0.0))
    rows = ignored_parts([FLOOR, smooth], [Light(LightKind.POINT)], CausticMap, specular_view=True)
    assert rows == [] and ignored_words(rows) == []


def test_each_part_is_named_once_with_who_ignores_it() -> None:
    rings = [Instance("a", MESH, STEEL), Instance("b", MESH, STEEL)]
    rows = ignored_parts([FLOOR, *rings], [LAMP, SUN], CausticMap, specular_view=True)
    assert {(r["what"], r["of"], r["by"]) for r in rows} == {
        ("radius_m", "lamp", "caustic_map"),
        ("radius_m", "lamp", "direct light"),
        ("angular_diameter_deg", "sun", "caustic_map"),
        ("angular_diameter_deg", "sun", "direct light"),
        ("roughness", "steel", "caustic_map"),
        ("roughness", "steel", "the eye's rays"),
    }
    assert len(rows) == 6
    assert ignored_words(rows) == [
        "caustic_map takes 'lamp' (radius_m 0.05), 'sun' (angular_diameter_deg 0.53) as a point; "
        "method photon_trace follows it",
        "direct light takes 'lamp' (radius_m 0.05), 'sun' (angular_diameter_deg 0.53) as a point: its shadows are hard",
        "caustic_map takes 'steel' (roughness 0.2) as smooth; method photon_trace follows it",
        "the eye's rays take 'steel' (roughness 0.2) as smooth",
    ]


def test_a_method_that_follows_both_is_not_among_them() -> None:
    ring = Instance("a", replace(MESH, positions_m=np.ones((3, 3))), STEEL)
    rows = ignored_parts([FLOOR, ring], [LAMP], PhotonTrace, specular_view=False)
    assert [(r["what"], r["by"]) for r in rows] == [("radius_m", "direct light")]


def test_without_specular_surfaces_there_are_no_caustics_to_be_sharp() -> None:
    rows = ignored_parts(
        [FLOOR], [LAMP, Light(LightKind.POINT, "off", intensity=0.0, radius_m=1.0)], CausticMap, specular_view=True
    )
    assert [(r["of"], r["by"]) for r in rows] == [("lamp", "direct light")]


def test_a_lamp_that_encloses_a_specular_surface_is_announced() -> None:
    rows = ignored_parts([Instance("a", MESH, STEEL)], [LAMP], PhotonTrace, specular_view=False)
    assert [r["by"] for r in rows] == ["direct light", "what lies within its sphere"], "MESH lies at the lamp's centre"
    assert "within the sphere of 'lamp' (radius_m 0.05)" in ignored_words(rows)[1]
