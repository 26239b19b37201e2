"""Snippets of glsl/common are made to be taken along: functions say what they take, files where they come from."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

SNIPPETS = sorted((Path(__file__).resolve().parents[2] / "glsl" / "common").glob("*.glsl"))
FUNCTION = re.compile(r"^(?:void|bool|int|uint|float|[iu]?vec[234]|mat[234]|Glc\w+)\s+(\w+)\(")
YEAR = re.compile(r"\b(?:17|18|19|20)\d\d\b")


def without_comment(text: str) -> list[str]:
    """Names of the functions that no comment stands above."""
    lines = ["", *text.splitlines()]
    found = [(FUNCTION.match(line), before) for before, line in zip(lines, lines[1:], strict=False)]
    return [match.group(1) for match, before in found if match and not before.startswith("//")]


def test_the_pattern_finds_what_it_should() -> None:
    text = "// Doubles.\nfloat twice(float x) { }\n\nGlcHit other(vec2 a,\n    int b) {\n    float inner;\n"
    assert without_comment(text) == ["other"]


@pytest.mark.parametrize("path", SNIPPETS, ids=lambda p: p.name)
def test_functions_say_what_they_take_and_files_where_they_come_from(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not without_comment(text)
    assert YEAR.search(text), "no source"
    assert not re.search(r"^\s*uniform\b", text, re.M)
