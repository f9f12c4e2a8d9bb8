"""The rooms of a storey's final plan, corrected by its grammar."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage import rooms as initial
from storage.artifacts import Kind, column, register
from storage.geo import with_geometry
from storage.rooms import Rooms


@dataclass(frozen=True, eq=False)
class LayoutRooms:
    """n rooms; entry i is one room everywhere."""

    rooms: Rooms
    """their polygons, heights, and what was seen of them"""
    classes: NDArray[np.str_]
    """(n,), '' unknown"""
    rules: NDArray[np.str_]
    """(n,), id of the rule that explains the room; '' unexplained: its geometry is as observed,
    but for walls it shares with rooms that are explained"""
    posteriors: NDArray[np.float64]
    """(n,), probability of the class; NaN for rooms on no line"""
    sources: tuple[tuple[int, ...], ...]
    """the initial model's rooms that each room is made of"""
    refused: NDArray[np.str_]
    """(n,), why a correction of the room was refused; '' none was"""

    def __len__(self) -> int:
        return len(self.classes)

    @property
    def explained(self) -> NDArray[np.bool_]:
        """(n,), whether a rule explains the room."""
        return self.rules != ""


_EXTRA = [
    column("class", pa.string(), "null: unknown", nullable=True),
    column("rule", pa.string(), "rule that explains it; null: unexplained", nullable=True),
    column("posterior", pa.float64(), "probability of the class; null: on no line", nullable=True),
    column("sources", pa.list_(pa.int32()), "rooms of the initial model it is made of"),
    column("refused", pa.string(), "why a correction was refused; null: none", nullable=True),
]
SCHEMA = with_geometry(
    pa.schema(
        [*initial.SCHEMA, *_EXTRA],
        metadata=initial.SCHEMA.metadata | {b"mapsense.table": b"layout_rooms"},
    ),
    "geometry",
    "Polygon",
)


def to_table(layout: LayoutRooms) -> pa.Table:
    """Return one row per room."""
    texts = {"class": layout.classes, "rule": layout.rules, "refused": layout.refused}
    columns = {name: pa.array(list(text), mask=text == "") for name, text in texts.items()}
    columns["posterior"] = pa.array(layout.posteriors, from_pandas=True)
    columns["sources"] = pa.array([list(s) for s in layout.sources], pa.list_(pa.int32()))
    table = initial.to_table(layout.rooms)
    extra = [columns[field.name].cast(field.type) for field in _EXTRA]
    return pa.table([*table.columns, *extra], schema=SCHEMA)


def from_table(table: pa.Table) -> LayoutRooms:
    """Return the rooms a table holds."""

    def text(name: str) -> NDArray[np.str_]:
        return np.array(table[name].fill_null("").to_pylist(), np.str_)

    return LayoutRooms(
        rooms=initial.from_table(table),
        classes=text("class"),
        rules=text("rule"),
        posteriors=table["posterior"].to_numpy().astype(float),
        sources=tuple(tuple(s) for s in table["sources"].to_pylist()),
        refused=text("refused"),
    )


LAYOUT_ROOMS = register(Kind("layout_rooms", LayoutRooms, SCHEMA, to_table, from_table))
