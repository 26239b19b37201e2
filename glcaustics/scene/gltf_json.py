"""Strict reading of glTF's JSON: every value is checked for type and range, and an error names its path in the file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from glcaustics.errors import SceneError

Vector = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Json:
    """One JSON object. `path`: where it stands in the file ("materials[2]"); `where`: the file."""

    value: dict[str, Any]
    path: str
    where: str

    @property
    def name(self) -> str:
        """The object's name, or its path when it has none."""
        name = self.value.get("name")
        return name if isinstance(name, str) and name else self.path

    def error(self, what: str, remedy: str = "") -> SceneError:
        """A SceneError about this object, to be raised by the caller."""
        name = self.value.get("name")
        label = f"{self.path} '{name}'" if isinstance(name, str) and name else self.path
        return SceneError(f"{label}: {what}", where=self.where, remedy=remedy)

    def _wrong(self, key: str, wanted: str) -> SceneError:
        shown = repr(self.value.get(key))
        return self.error(f"'{key}' is {shown[:60]}, not {wanted}", "export the file again as glTF 2.0")

    def _child(self, key: str) -> str:
        return f"{self.path}.{key}" if self.path else key

    def obj(self, key: str) -> Json | None:
        """The object under `key`, None if there is none."""
        found = self.value.get(key)
        if found is None:
            return None
        if not isinstance(found, dict):
            raise self._wrong(key, "an object")
        return Json(found, self._child(key), self.where)

    def objects(self, key: str) -> list[Json]:
        """The array of objects under `key`, empty if there is none."""
        found = self.value.get(key, [])
        if not isinstance(found, list):
            raise self._wrong(key, "an array")
        children = []
        for number, child in enumerate(found):
            path = f"{self._child(key)}[{number}]"
            if not isinstance(child, dict):
                raise SceneError(f"{path} is not an object", where=self.where, remedy="export the file again")
            children.append(Json(child, path, self.where))
        return children

    def extension(self, name: str) -> Json | None:
        """The extension object `name`, None if this object has none."""
        extensions = self.obj("extensions")
        return extensions.obj(name) if extensions is not None else None

    def number(self, key: str, default: float, low: float = -math.inf, high: float = math.inf) -> float:
        """A finite number within [low, high]."""
        found = self.value.get(key, default)
        if isinstance(found, bool) or not isinstance(found, int | float):
            raise self._wrong(key, "a number")
        if found is not default and not (math.isfinite(found) and low <= found <= high):
            raise self._wrong(key, f"a finite number from {low:g} to {high:g}")
        return float(found)

    def integer(self, key: str, default: int | None = None, low: int = 0) -> int:
        """A whole number of at least `low`; missing without a default is an error."""
        found = self.value.get(key, default)
        if isinstance(found, bool) or not isinstance(found, int) or found < low:
            raise self._wrong(key, f"a whole number of at least {low}")
        return found

    def index(self, key: str, count: int, of: str) -> int | None:
        """An index into an array of `count` things called `of`; None if there is none."""
        if key not in self.value:
            return None
        found = self.integer(key)
        if found >= count:
            raise self.error(f"'{key}' is {found}, but the file has {count} {of}", "export the file again")
        return found

    def indices(self, key: str, count: int, of: str) -> list[int]:
        """An array of indices into an array of `count` things called `of`."""
        found = self.value.get(key, [])
        if not isinstance(found, list):
            raise self._wrong(key, "an array of indices")
        for entry in found:
            if isinstance(entry, bool) or not isinstance(entry, int) or not 0 <= entry < count:
                raise self.error(f"'{key}' holds {entry!r}, but the file has {count} {of}", "export the file again")
        return found

    def floats(self, key: str, default: Vector) -> Vector:
        """An array of finite numbers, as many as the default has."""
        found = self.value.get(key)
        if found is None:
            return default
        numbers = isinstance(found, list) and all(isinstance(x, int | float) for x in found)
        if not numbers or len(found) != len(default) or not all(math.isfinite(x) for x in found):
            raise self._wrong(key, f"an array of {len(default)} finite numbers")
        return tuple(float(x) for x in found)

    def text(self, key: str, default: str = "") -> str:
        found = self.value.get(key, default)
        if not isinstance(found, str):
            raise self._wrong(key, "a string")
        return found

    def texts(self, key: str) -> list[str]:
        found = self.value.get(key, [])
        if not isinstance(found, list) or not all(isinstance(entry, str) for entry in found):
            raise self._wrong(key, "an array of strings")
        return found

    def flag(self, key: str, default: bool = False) -> bool:
        found = self.value.get(key, default)
        if not isinstance(found, bool):
            raise self._wrong(key, "true or false")
        return found
