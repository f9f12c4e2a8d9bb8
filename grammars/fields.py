"""The tables of a grammar file, every field checked as it is taken, errors with their line."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

from grammars.positions import Place
from storage.errors import InputError


@dataclass(frozen=True)
class Fields:
    """One table of the file."""

    source: Path | str
    lines: Mapping[Place, int]
    place: Place
    owner: str
    """what an error calls the table, as "rule 'office_240'"; '' for the file itself"""
    values: Mapping[str, Any]

    def fail(self, field: str, wrong: str, remedy: str) -> NoReturn:
        """Raise an error about a field, or about the table where it lacks the field."""
        self.fail_at((*self.place, field), f"'{field}' {wrong}", remedy)

    def fail_at(self, place: Place, wrong: str, remedy: str) -> NoReturn:
        """Raise an error about a place; if it is not in the text, the table's line is named."""
        line = self.lines.get(place) or self.lines.get(self.place, 1)
        owner = f"{self.owner}: " if self.owner else ""
        raise InputError(self.source, f"line {line}: {owner}{wrong}", remedy)

    def named(self, owner: str) -> "Fields":
        """Return the same table under another name in errors."""
        return replace(self, owner=owner)

    def only(self, known: Iterable[str]) -> None:
        """Refuse fields that do not exist."""
        known = tuple(known)
        for name in self.values:
            if name not in known:
                close = get_close_matches(name, known, 1)
                remedy = f"did you mean '{close[0]}'?" if close else f"known: {', '.join(known)}"
                self.fail(name, "is no known field", remedy)

    def value(self, name: str) -> Any:
        """Return a field that must be there."""
        if name not in self.values:
            self.fail(name, "is missing", "add it")
        return self.values[name]

    def text(self, name: str, default: str | None = None) -> str:
        """Return a text; without a default it must be there and not empty."""
        if default is not None and name not in self.values:
            return default
        value = self.value(name)
        if not isinstance(value, str) or (default is None and not value.strip()):
            self.fail(name, f"is {shown(value)}", "expected a text in quotes, not empty")
        return value

    def flag(self, name: str) -> bool:
        """Return true or false."""
        value = self.value(name)
        if not isinstance(value, bool):
            self.fail(name, f"is {shown(value)}", "expected true or false, without quotes")
        return value

    def number(self, name: str, low: float, high: float = math.inf) -> float:
        """Return a number from low to high."""
        value = self._finite(name)
        if not low <= value <= high:
            bounds = f"from {low:g} to {high:g}" if math.isfinite(high) else f"of {low:g} or more"
            self.fail(name, f"is {shown(value)}", f"expected a number {bounds}")
        return value

    def length(self, name: str) -> float:
        """Return a length over zero, metres."""
        value = self._finite(name)
        if value <= 0:
            self.fail(name, f"is {shown(value)}", "expected metres, more than zero")
        return value

    def optional_length(self, name: str) -> float | None:
        """Return a length over zero, or None where the table lacks it."""
        return self.length(name) if name in self.values else None

    def point(self, name: str) -> tuple[float, float]:
        """Return x and y."""
        value = self.value(name)
        if not _is_point(value):
            self.fail(name, f"is {shown(value)}", "expected [x, y] in metres")
        return float(value[0]), float(value[1])

    def points(self, name: str, count: int) -> list[tuple[float, float]]:
        """Return some points."""
        value = self.value(name)
        found = [p for p in value if _is_point(p)] if isinstance(value, list) else []
        if not isinstance(value, list) or len(found) != len(value) or len(found) != count:
            self.fail(name, f"is {shown(value)}", f"expected {count} points [x, y] in metres")
        return [(float(x), float(y)) for x, y in found]

    def table(self, name: str, owner: str) -> "Fields":
        """Return a table within this one."""
        value = self.value(name)
        if not isinstance(value, dict):
            self.fail(name, f"is {shown(value)}", f"expected a table, [{name}]")
        return replace(self, place=(*self.place, name), owner=owner, values=value)

    def optional_table(self, name: str, owner: str) -> "Fields | None":
        """Return a table within this one, or None where there is none."""
        return self.table(name, owner) if name in self.values else None

    def tables(self, name: str, owner: str, optional: bool = False) -> "list[Fields]":
        """Return the tables of a list; they are called `owner` and their number."""
        if optional and name not in self.values:
            return []
        found = []
        for i, item in enumerate(self.elements(name)):
            place = (*self.place, name, i)
            if not isinstance(item, dict):
                self.fail_at(place, f"'{name}' has {shown(item)}", "expected a list of tables")
            found.append(replace(self, place=place, owner=f"{owner} {i + 1}", values=item))
        return found

    def elements(self, name: str) -> list[Any]:
        """Return a list."""
        value = self.value(name)
        if not isinstance(value, list):
            self.fail(name, f"is {shown(value)}", "expected a list, [...]")
        return value

    def _finite(self, name: str) -> float:
        value = self.value(name)
        if not is_number(value):
            self.fail(name, f"is {shown(value)}", "expected a finite number, without quotes")
        return float(value)


def _is_point(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value))


def is_number(value: Any) -> bool:
    """Return whether a value of a file is a finite number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def shown(value: Any) -> str:
    """Return a value as an error shows it."""
    if isinstance(value, bool):
        return str(value).lower()
    text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."
