"""How far mapped rooms are from the true ones."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns


@dataclass(frozen=True, eq=False)
class RoomErrors:
    """r true rooms; entry i is one room in every array."""

    rooms: NDArray[np.str_]
    """(r,), id in the truth"""
    classes: NDArray[np.str_]
    """(r,), class in the truth; '' if it has none"""
    true_m2: NDArray[np.float64]
    """(r,), true area"""
    found_m2: NDArray[np.float64]
    """(r,), area of the room found for it; NaN if there is none"""
    error_m2: NDArray[np.float64]
    """(r,), |true - found| (Sec. 7.3); NaN if there is none"""
    iou: NDArray[np.float64]
    """(r,), area of the intersection over that of the union; 0 if there is none"""

    def __len__(self) -> int:
        return len(self.rooms)


_COLUMNS = {
    "rooms": column("room", pa.string(), "true room"),
    "classes": column("class", pa.string(), "class of the true room; '' if it has none"),
    "true_m2": column("true_m2", pa.float64(), "true area"),
    "found_m2": column("found_m2", pa.float64(), "area found; null: no room", nullable=True),
    "error_m2": column("error_m2", pa.float64(), "|true - found|; null: no room", nullable=True),
    "iou": column("iou", pa.float64(), "intersection over union; 0: no room"),
}
SCHEMA = schema("room_errors", list(_COLUMNS.values()))


def to_table(errors: RoomErrors) -> pa.Table:
    """Return one row per true room."""
    return to_columns(errors, _COLUMNS, SCHEMA)


def from_table(table: pa.Table) -> RoomErrors:
    """Return the rooms a table holds."""
    return RoomErrors(**from_columns(table, _COLUMNS))


ROOM_ERRORS = register(Kind("room_errors", RoomErrors, SCHEMA, to_table, from_table))
