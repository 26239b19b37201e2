"""Every source that shaders, package and docs cite as author and year has its entry in glsl/REFERENCES.bib."""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BIB = (ROOT / "glsl" / "REFERENCES.bib").read_text(encoding="utf-8")
KINDS = ("*.glsl", "*.frag", "*.vert", "*.py", "*.md")
SOURCES = sorted(p for d in ("glsl", "glcaustics", "docs") for kind in KINDS for p in (ROOT / d).rglob(kind))
NAME = r"(?:[Vv]an (?:de )?)?[A-Z][A-Za-z'-]+"
CITATION = re.compile(rf"({NAME})((?:(?:,? and |,? & |, ){NAME})*)(?: et al\.)?,? \(?((?:19|20)\d\d)(?!-\d|\d|x\d)")
NOT_A_NAME = {"LLVM", "Mesa", "Python", "Debian"}


def plain(text: str) -> str:
    """Small letters without accents or TeX: {\\"o} and oe are both o, {\\"u} and ue both u."""
    text = re.sub(r"[{}\\\"~^`']|\\AA", "", text)
    return (
        unicodedata.normalize("NFKD", text)
        .encode("ascii", "ignore")
        .decode()
        .lower()
        .replace("ue", "u")
        .replace("oe", "o")
    )


def entries() -> list[tuple[str, str]]:
    """(all authors, year) of every entry."""
    found = re.findall(r"^@\w+\{(\w+), (?:editor = \{.*?\}, )?author = \{(.*?)\}, year = \{(\d+)\}", BIB, re.M)
    assert len(found) == len(re.findall(r"^@", BIB, re.M)), "an entry without author or year"
    assert len({key for key, _, _ in found}) == len(found), "a key twice"
    return [(plain(authors), year) for _, authors, year in found]


def citations(text: str) -> list[tuple[list[str], str]]:
    # A citation may be broken over lines of a comment or docstring.
    text = re.sub(r"\s*\n\s*(?://|#)?\s*", " ", text)
    found = []
    for first, others, year in CITATION.findall(text):
        names = [first, *re.findall(NAME, others)]
        if first not in NOT_A_NAME:
            found.append((names, year))
    return found


def test_the_pattern_finds_what_it_should() -> None:
    text = (
        "x (Schied, Peters,\n// Dachsbacher 2018) y Born & Wolf 1999, Wyman 2005; "
        "McGuire and Mara 2014 z Van Oosterom and Strackee 1983"
    )
    assert [names[0] + year for names, year in citations(text)] == [
        "Schied2018",
        "Born1999",
        "Wyman2005",
        "McGuire2014",
        "Van Oosterom1983",
    ]


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_citations_are_in_the_bibliography(path: Path) -> None:
    known = entries()
    missing = [
        f"{', '.join(names)} {year}"
        for names, year in citations(path.read_text(encoding="utf-8"))
        if not any(y == year and all(plain(name) in authors for name in names) for authors, y in known)
    ]
    assert not missing
