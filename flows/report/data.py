"""What the queries of the report answered, and how it is named and grouped."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from storage.runs import DEFAULT, INITIAL_MODEL

T = TypeVar("T")
Row = dict[str, Any]
NOT_EVALUATED = "Nothing was compared with a truth yet: `mapsense evaluate` does so."
MOST_GROUPS = 40
"""Distributions in one figure: a figure of more is not read any more."""


@dataclass(frozen=True)
class Answers:
    """Rows by the name of their query."""

    rows: dict[str, list[Row]]
    sql: dict[str, str]
    """the query as it was run"""
    problems: tuple[str, ...]
    """files of the store that were left out, and why"""
    charged: tuple[str, ...] = ()
    """buildings that energy was charged for, whether asked for or not"""

    def quoted(self, name: str, what: str) -> tuple[tuple[str, str], ...]:
        """Return a query for the reader."""
        return ((what, self.sql[name]),)


@dataclass(frozen=True)
class Origin:
    """Rows that are all simulated, or all real."""

    suffix: str
    """of the figures' names; '' if there is no other"""
    told: str
    rows: list[Row]


def origins(rows: Sequence[Row]) -> list[Origin]:
    """Return simulated and real rows apart: they never share a figure."""
    parts = [
        ("_simulated", "simulated data", [row for row in rows if row["simulated"]]),
        ("_real", "real scans", [row for row in rows if not row["simulated"]]),
    ]
    there = [part for part in parts if part[2]]
    alone = len(there) == 1
    return [Origin("" if alone else suffix, told, part) for suffix, told, part in there]


def is_initial(variant: str) -> bool:
    """Return whether a variant is the initial model of another."""
    return variant == INITIAL_MODEL or variant.endswith(f".{INITIAL_MODEL}")


def variant_name(variant: str) -> str:
    """Return a variant as people read it."""
    names = {"": "plan", DEFAULT: "final", INITIAL_MODEL: "initial"}
    return names.get(variant, variant.replace(".", ", "))


def variant_order(variant: str) -> tuple[bool, str, bool]:
    """Return a key that puts the default first, and each initial model before its final one."""
    base = variant.removesuffix(INITIAL_MODEL).removesuffix(".")
    named = base not in ("", DEFAULT)
    return named, base if named else "", not is_initial(variant)


def told_first(variants: Iterable[str]) -> str:
    """Return the variant whose results are told first: the first final model."""
    ordered = sorted(variants, key=variant_order)
    return next((variant for variant in ordered if not is_initial(variant)), ordered[0])


def place_name(row: Row, rows: Iterable[Row]) -> str:
    """Return storey and scan, with the building if there are several."""
    several = len({other["building"] for other in rows}) > 1
    parts = [row["building"]] if several else []
    parts.append(row["storey"])
    parts += [row["scan"]] if row.get("scan") else []
    return " / ".join(parts)


def grouped(rows: Iterable[Row], key: Callable[[Row], T]) -> dict[T, list[Row]]:
    """Return rows by key, in the order the keys first appear."""
    groups: dict[T, list[Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def column(rows: Iterable[Row], name: str) -> NDArray[np.float64]:
    """Return a column as floats, null as NaN."""
    return np.array([np.nan if row[name] is None else float(row[name]) for row in rows], float)


def seeds_told(rows: Sequence[Row]) -> str:
    """Return how many seeds each plan was made with, in words."""
    plans = grouped(rows, lambda row: (row.get("building"), row.get("storey"), row["variant"]))
    counts = [len({row["seed"] for row in part}) for part in plans.values()]
    low, high = min(counts), max(counts)
    if high == 1:
        return "1 seed"
    return f"{high} seeds" if low == high else f"{low} to {high} seeds"


def origin_badges(rows: list[Row]) -> tuple[str, ...]:
    """Return where rows come from, and of how many seeds, in words."""
    told = tuple(origin.told for origin in origins(rows))
    return (*told, seeds_told(rows)) if rows else ()
