"""The documentation's examples work, it names every key that is read, and its links lead somewhere."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from glcaustics.caustics.caustic_map import CausticMap
from glcaustics.scene import load_scene
from glcaustics.scene.toml_objects import SHAPES

ROOT = Path(__file__).resolve().parents[2]
FORMAT = ROOT / "docs" / "scene-format.md"
PAGES = sorted((ROOT / "docs").rglob("*.md"))
SOURCES = [ROOT / "glcaustics" / "scene" / name for name in ("toml.py", "toml_objects.py", "toml_water.py")]


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", FORMAT.read_text(encoding="utf-8"), re.DOTALL)


def test_the_whole_example_loads_and_needs_no_assumption(tmp_path: Path) -> None:
    path = tmp_path / "example.toml"
    path.write_text(blocks("toml")[0], encoding="utf-8")
    scene = load_scene(path)
    assert scene.announcements == () and len(scene.instances) == 2 and len(scene.waters) == 1


# Files that the single examples name are not beside them; all else in them is read.
@pytest.mark.parametrize("number", range(1, len(blocks("toml"))))
def test_each_example_fits_into_a_scene(number: int, tmp_path: Path) -> None:
    data = tomllib.loads(blocks("toml")[number])
    text, named = blocks("toml")[number], re.findall(r'"([\w.]+\.(?:glb|ply|png))"', blocks("toml")[number])
    if named:
        assert set(data) <= {"scene", "object", "water"} and all("." in name for name in named)
        return
    path = tmp_path / "part.toml"
    floor = '[[object]]\nname = "floor"\nshape = "plane"\nsize_m = [2.0, 2.0]\n'
    path.write_text(text + "\n" + floor, encoding="utf-8")
    assert load_scene(path).instances


def test_every_key_and_shape_is_described() -> None:
    text = FORMAT.read_text(encoding="utf-8")
    methods = r"\.(?:text|number|vector|boolean|integer|integers|tables|table|has)"
    reader = rf'(?:{methods}|existing_file|image|_positive)\((?:\w+, )?"(\w+)"'
    keys = {key for path in SOURCES for key in re.findall(reader, path.read_text(encoding="utf-8"))}
    assert len(keys) > 60  # the pattern still finds them
    assert {key for key in keys if not re.search(rf"[`\[]{key}[`\]]", text)} == set()
    assert {shape for shape in SHAPES if f"| `{shape}` |" not in text} == set()


def test_the_method_page_lists_the_options_as_they_are() -> None:
    text = (ROOT / "docs" / "methods" / "caustic_map.md").read_text(encoding="utf-8")
    rows = {name: (span, value) for name, span, value in re.findall(r"\| `(\w+)` \| (.*?) \| (.*?) \|", text)}
    assert set(CausticMap.option_help) <= set(rows)
    medium = {**CausticMap.defaults, **CausticMap.ladder["medium"]}
    for name, (low, high) in CausticMap.ranges.items():
        assert rows[name][0] == f"{low:g} to {high:g}", name
        assert float(rows[name][1]) == float(medium[name]), name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target
