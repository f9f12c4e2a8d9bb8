"""The walls of a storey's final plan: between the rooms its grammar has corrected."""

from dataclasses import dataclass

import pyarrow as pa

from storage import walls as initial
from storage.artifacts import Kind, register
from storage.walls import Walls


@dataclass(frozen=True, eq=False)
class LayoutWalls:
    """The wall pieces of the final plan."""

    walls: Walls
    """their `rooms` are rows of `layout_rooms`"""

    def __len__(self) -> int:
        return len(self.walls)


SCHEMA = initial.SCHEMA.with_metadata(
    initial.SCHEMA.metadata | {b"mapsense.table": b"layout_walls"}
)


def to_table(layout: LayoutWalls) -> pa.Table:
    """Return one row per wall piece."""
    return initial.to_table(layout.walls).replace_schema_metadata(SCHEMA.metadata)


def from_table(table: pa.Table) -> LayoutWalls:
    """Return the walls a table holds."""
    return LayoutWalls(initial.from_table(table))


LAYOUT_WALLS = register(Kind("layout_walls", LayoutWalls, SCHEMA, to_table, from_table))
