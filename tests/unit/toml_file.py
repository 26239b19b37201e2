"""The smallest scene file of the tests, and writing one."""

from __future__ import annotations

from pathlib import Path

MINIMAL = """
[camera]
eye = [0, 1, 3]
target = [0, 0, 0]
[[light]]
kind = "directional"
intensity = 1000
direction = [0, -2, 0]
[[object]]
shape = "box"
size_m = [1, 2, 3]
"""


def write(folder: Path, text: str) -> Path:
    """`folder`/test.toml with this text."""
    path = folder / "test.toml"
    path.write_text(text, encoding="utf-8")
    return path
