"""Tables and targets, for people and as JSON."""

import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

LIBRARIES = (
    "numpy", "scipy", "numba", "open3d", "pyarrow", "laspy", "lazrs", "pye57",
)  # fmt: skip
QUIET = 0.25
"""Cores other processes may use before the report says that the figures are noisy."""


@dataclass(frozen=True)
class Column:
    """A column of a table: the key of its values, its heading, how a value is written."""

    key: str
    heading: str
    form: str = "{}"


TIMES = (
    Column("seconds", "seconds", "{:.3f}"),
    Column("cpu_seconds", "cpu s", "{:.3f}"),
    Column("runs", "runs"),
)
"""Columns of every table."""


@dataclass(frozen=True)
class Table:
    """Rows of raw figures under a title."""

    title: str
    columns: Sequence[Column]
    rows: list[dict[str, Any]]

    def text(self) -> str:
        """Return the table as lines of aligned columns; what is missing is a dash."""
        cells = [[column.heading for column in self.columns]]
        for row in self.rows:
            values = [row.get(column.key) for column in self.columns]
            cells.append(
                [
                    "-" if value is None else column.form.format(value)
                    for value, column in zip(values, self.columns, strict=True)
                ]
            )
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        lines = [
            "  ".join(
                [
                    line[0].ljust(widths[0]),
                    *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True)),
                ]
            )
            for line in cells
        ]
        return "\n".join((self.title, *(f"  {line}" for line in lines)))


@dataclass(frozen=True)
class Target:
    """A figure and the bound it should keep."""

    what: str
    value: float | None
    """None if it was not measured"""
    bound: float
    unit: str = ""
    at_least: bool = False
    of_time: bool = False
    """Whether a busy machine spoils it; rivals with many threads suffer most, so it flatters us"""

    @property
    def verdict(self) -> str:
        """Return met, missed, or "not run"."""
        if self.value is None:
            return "not run"
        kept = self.value >= self.bound if self.at_least else self.value <= self.bound
        return "met" if kept else "missed"

    def text(self, noisy: bool = False) -> str:
        """Return one line; a question mark if noise may have made the verdict."""
        verdict = self.verdict + "?" * (noisy and self.of_time and self.value is not None)
        value = "-" if self.value is None else f"{self.value:.3g}{self.unit}"
        sign = ">=" if self.at_least else "<="
        bound = f"({sign} {self.bound:g}{self.unit})"
        return f"  {verdict:8} {self.what:58} {value:>10}  {bound}"


@dataclass
class Report:
    """What a section found."""

    title: str
    tables: list[Table] = field(default_factory=list)
    targets: list[Target] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def busy(self) -> float:
        """Cores other processes used during a run, the most of all runs."""
        return max((row.get("others", 0.0) for t in self.tables for row in t.rows), default=0.0)

    @property
    def noisy(self) -> bool:
        """Whether that is more than a quiet machine's."""
        return self.busy > QUIET

    def text(self) -> str:
        """Return the section as a person reads it."""
        parts = [f"== {self.title}", *(table.text() for table in self.tables)]
        notes = list(self.notes)
        if self.noisy:
            notes.append(
                f"Noisy: other processes used up to {self.busy:.1f} cores meanwhile. Times, and "
                "ratios of them, say little: measure again on a quiet machine."
            )
        if notes:
            parts.append("\n".join(f"  {note}" for note in notes))
        if self.targets:
            parts.append(
                "\n".join(("targets", *(target.text(self.noisy) for target in self.targets)))
            )
        return "\n\n".join(parts) + "\n"

    def as_json(self) -> dict[str, Any]:
        """Return raw figures, not rounded."""
        return {
            "title": self.title,
            "tables": [{"title": t.title, "rows": t.rows} for t in self.tables],
            "targets": [
                {
                    "what": t.what,
                    "value": t.value,
                    "bound": t.bound,
                    "unit": t.unit.strip(),
                    "sense": ">=" if t.at_least else "<=",
                    "verdict": t.verdict,
                }
                for t in self.targets
            ],
            "notes": self.notes,
            "noisy": self.noisy,
            "others_cores": self.busy,
        }


def machine() -> dict[str, Any]:
    """Return what the figures depend on."""
    return {
        "cores": len(os.sched_getaffinity(0)),
        "processor": platform.machine(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
    } | {name: version(name) for name in LIBRARIES}
