"""The corners of a storey's rooms: where two walls meet the floor and the ceiling."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema


@dataclass(frozen=True, eq=False)
class Corners:
    """c corners; entry i is one corner everywhere. Building frame, metres."""

    rooms: NDArray[np.int32]
    """(c,), room the corner belongs to; a room's corners follow one another along its outline"""
    lower: NDArray[np.float64]
    """(c, 3), where the two walls meet the floor; NaN where no floor was seen"""
    upper: NDArray[np.float64]
    """(c, 3), where they meet the ceiling; NaN where no ceiling was seen"""

    def __len__(self) -> int:
        return len(self.rooms)


_NAMES = ("lower_x_m", "lower_y_m", "lower_z_m", "upper_x_m", "upper_y_m", "upper_z_m")
SCHEMA = schema(
    "corners",
    [
        column("room", pa.int32(), "room the corner belongs to"),
        *(column(n, pa.float64(), "Eq. 8; null if not seen", nullable=True) for n in _NAMES),
    ],
)


def to_table(corners: Corners) -> pa.Table:
    """Return one row per corner."""
    numbers = np.hstack([corners.lower, corners.upper])
    return pa.table(
        [
            pa.array(corners.rooms),
            *(pa.array(numbers[:, i], from_pandas=True) for i in range(len(_NAMES))),
        ],
        schema=SCHEMA,
    )


def from_table(table: pa.Table) -> Corners:
    """Return the corners a table holds."""
    numbers = np.column_stack([table[n].to_numpy().astype(float) for n in _NAMES])
    return Corners(table["room"].to_numpy(), numbers[:, :3], numbers[:, 3:])


CORNERS = register(Kind("corners", Corners, SCHEMA, to_table, from_table))
