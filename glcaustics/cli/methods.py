"""`glcaustics methods`: which caustics methods there are, and what each can be told. No OpenGL."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from glcaustics.cli.choices import check_name
from glcaustics.quality import DEFAULT_QUALITY, QUALITIES

if TYPE_CHECKING:
    from glcaustics.caustics.method import CausticsMethod

AUTO_WORDS = "the method that the scene names, else {best}"
NONE_WORDS = "no caustics: direct light alone"


def methods_command(args: argparse.Namespace) -> int:
    """Prints a line a method, or all about the one that is named."""
    from glcaustics.caustics.registry import AUTO, BEST, METHODS, NONE

    auto_words = AUTO_WORDS.format(best=BEST.name)
    if args.name is None:
        words = {name: method.summary for name, method in METHODS.items()} | {AUTO: auto_words, NONE: NONE_WORDS}
        _print_rows(words.items())
        print("\n'glcaustics methods NAME' prints its paper, its quality ladder and its options.")
        return 0
    name = check_name(args.name, (*METHODS, AUTO, NONE), option="methods", kind="caustics method")
    if name == AUTO:
        print(f"{AUTO}: {auto_words}\n")
        name = BEST.name
    _describe(METHODS.get(name))
    return 0


def _describe(method: type[CausticsMethod] | None) -> None:
    """All about a method; None: about a frame without caustics."""
    from glcaustics.passes.options import OPTION_HELP
    from glcaustics.renderer.options import default_options, option_help

    print(f"{method.name}: {method.summary}\npaper: {method.paper}" if method else f"none: {NONE_WORDS}")
    meanings = option_help(method)
    ladder = {quality: default_options(method, quality) for quality in QUALITIES}
    rows = [[name, *(_shown(ladder[quality][name]) for quality in QUALITIES)] for name in meanings]
    print("\nwhat --quality chooses")
    _print_table([["", *QUALITIES], *(row for row in rows if len(set(row[1:])) > 1)])
    print(f"\noptions (--set NAME=VALUE), their values at quality {DEFAULT_QUALITY}, and ranges")
    own = [name for name in meanings if name not in OPTION_HELP]
    for title, names in (("of the method", own), ("of every frame", list(OPTION_HELP))):
        if names:
            print(f" {title}")
            values = [f"{name}={_shown(ladder[DEFAULT_QUALITY][name])}" for name in names]
            _print_rows(zip(values, (meanings[name] for name in names), strict=True), indent="  ")


def _shown(value: Any) -> str:
    """A value as --set takes it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _print_rows(rows: Iterable[tuple[str, str]], indent: str = "") -> None:
    rows = list(rows)
    width = max(len(name) for name, _ in rows)
    for name, words in rows:
        print(f"{indent}{name:<{width}}  {words}")


def _print_table(rows: Sequence[Sequence[str]]) -> None:
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    for row in rows:
        values = [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        print(f"  {row[0].ljust(widths[0])}  {'  '.join(values)}")
