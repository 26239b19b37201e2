"""Strict reading of TOML tables: each key is asked for by name, type and range; one that was not is an error."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from typing import Any

from glcaustics.errors import SceneError

Vec3 = tuple[float, float, float]


def nearest(word: str, allowed: Iterable[str]) -> str:
    """A remedy that names the nearest allowed word, and the others."""
    names = sorted(set(allowed))
    close = difflib.get_close_matches(word, names, n=1, cutoff=0.5)
    listing = ", ".join(names) if names else "none"
    return f"did you mean '{close[0]}'? (allowed: {listing})" if close else f"allowed: {listing}"


class StrictTable:
    """A table of a scene file. Read keys with the typed methods, then call `finish()`.

    Args:
        data: the table as tomllib gives it.
        file: name of the file, for messages.
        path: name of the table, for messages ("water[0].wave[2]"); empty for the top level.

    Every method raises SceneError naming file, table, key, value and remedy.
    """

    def __init__(self, data: Mapping[str, Any], file: str, path: str = "") -> None:
        self.data = data
        self.file = file
        self.path = path
        self._asked: set[str] = set()

    def error(self, what: str, remedy: str = "") -> SceneError:
        """A SceneError that stands at this table."""
        table = f"[{self.path}]" if self.path else "top level"
        return SceneError(f"{table}: {what}", where=self.file, remedy=remedy)

    def has(self, key: str) -> bool:
        """Whether the key is there; counts as allowed from now on."""
        self._asked.add(key)
        return key in self.data

    def finish(self) -> None:
        """Raise if the table holds a key that nobody asked for."""
        for key in self.data:
            if key not in self._asked:
                kind = "table" if isinstance(self.data[key], dict | list) and not self.path else "key"
                raise self.error(f"unknown {kind} '{key}'", nearest(key, self._asked))

    def _missing(self, key: str) -> SceneError:
        unknown = [k for k in self.data if k not in self._asked]
        close = difflib.get_close_matches(key, unknown, n=1, cutoff=0.5)
        remedy = f"is '{close[0]}' meant to be '{key}'?" if close else f"add '{key} = ...'"
        return self.error(f"'{key}' is missing", remedy)

    def _get(self, key: str, default: Any) -> Any:
        self._asked.add(key)
        if key in self.data:
            return self.data[key]
        if default is ...:
            raise self._missing(key)
        return default

    def _check_number(self, key: str, value: Any, low: float, high: float, above: float) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(f"'{key}' is {value!r}", "give a number")
        number = float(value)
        if math.isnan(number) or (math.isinf(number) and not math.isinf(high)):
            raise self.error(f"'{key}' is {value!r}", "give a finite number")
        if number < low or number > high:
            raise self.error(f"'{key}' is {value!r}", f"it must lie in [{low:g}, {high:g}]")
        if number <= above:
            raise self.error(f"'{key}' is {value!r}", f"it must be greater than {above:g}")
        return number

    def number(
        self, key: str, default: Any = ..., *, low: float = -1e30, high: float = 1e30, above: float = -math.inf
    ) -> Any:
        """A finite number in [low, high] and greater than `above`; `default` when absent (`...`: required)."""
        value = self._get(key, default)
        if key not in self.data:
            return value
        return self._check_number(key, value, low, high, above)

    def integer(self, key: str, default: Any = ..., *, low: int, high: int) -> Any:
        """A whole number in [low, high]."""
        value = self._get(key, default)
        if key not in self.data:
            return value
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.error(f"'{key}' is {value!r}", "give a whole number")
        if not low <= value <= high:
            raise self.error(f"'{key}' is {value!r}", f"it must lie in [{low}, {high}]")
        return value

    def boolean(self, key: str, default: Any = ...) -> Any:
        """`true` or `false`."""
        value = self._get(key, default)
        if key in self.data and not isinstance(value, bool):
            raise self.error(f"'{key}' is {value!r}", "give true or false")
        return value

    def text(self, key: str, default: Any = ..., *, choices: Iterable[str] = ()) -> Any:
        """A string that is not empty, one of `choices` if they are given."""
        value = self._get(key, default)
        if key not in self.data:
            return value
        if not isinstance(value, str) or not value:
            raise self.error(f"'{key}' is {value!r}", "give a string that is not empty")
        allowed = tuple(choices)
        if allowed and value not in allowed:
            raise self.error(f"'{key}' is '{value}'", nearest(value, allowed))
        return value

    def vector(
        self,
        key: str,
        count: int,
        default: Any = ...,
        *,
        low: float = -1e30,
        high: float = 1e30,
        above: float = -math.inf,
    ) -> Any:
        """A tuple of `count` numbers."""
        value = self._get(key, default)
        if key not in self.data:
            return value
        if not isinstance(value, list) or len(value) != count:
            raise self.error(f"'{key}' is {value!r}", f"give a list of {count} numbers")
        return tuple(self._check_number(key, v, low, high, above) for v in value)

    def integers(self, key: str, count: int, default: Any = ..., *, low: int, high: int) -> Any:
        """A tuple of `count` whole numbers in [low, high]."""
        value = self._get(key, default)
        if key not in self.data:
            return value
        good = isinstance(value, list) and len(value) == count
        if not good or any(isinstance(v, bool) or not isinstance(v, int) for v in value):
            raise self.error(f"'{key}' is {value!r}", f"give a list of {count} whole numbers")
        if not all(low <= v <= high for v in value):
            raise self.error(f"'{key}' is {value!r}", f"each must lie in [{low}, {high}]")
        return tuple(value)

    def table(self, key: str) -> StrictTable | None:
        """The sub-table [key], or None."""
        self._asked.add(key)
        if key not in self.data:
            return None
        value = self.data[key]
        if not isinstance(value, dict):
            raise self.error(f"'{key}' is {value!r}", f"write it as a table: [{self._join(key)}]")
        return StrictTable(value, self.file, self._join(key))

    def tables(self, key: str) -> list[StrictTable]:
        """The tables of the array [[key]], possibly none."""
        self._asked.add(key)
        value = self.data.get(key, [])
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            raise self.error(f"'{key}' is not an array of tables", f"write each one under [[{self._join(key)}]]")
        return [StrictTable(v, self.file, f"{self._join(key)}[{i}]") for i, v in enumerate(value)]

    def _join(self, key: str) -> str:
        return f"{self.path}.{key}" if self.path else key
