"""The walls of a storey's initial model."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import shapely
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.geo import with_geometry


@dataclass(frozen=True, eq=False)
class Walls:
    """w wall pieces; entry i is one piece everywhere. Building frame, metres."""

    lines: NDArray[np.float64]
    """(w, 2, 2), ends of the centre line; of the face, where only one was seen"""
    thickness_m: NDArray[np.float64]
    """(w,), distance of its two faces; NaN where only one was seen"""
    base_m: NDArray[np.float64]
    """(w,), NaN where no floor was seen"""
    top_m: NDArray[np.float64]
    """(w,), NaN where no ceiling was seen"""
    rooms: NDArray[np.int32]
    """(w, 2), rooms on its two sides; -1 for none"""
    seen: NDArray[np.float64]
    """(w,), share of its length along which it was seen; the rest is extended (Fig. 3)"""

    def __len__(self) -> int:
        return len(self.lines)


SCHEMA = with_geometry(
    schema(
        "walls",
        [
            column("wall", pa.int32(), "number of the wall piece"),
            column("thickness_m", pa.float64(), "null where one face was seen", nullable=True),
            column("base_m", pa.float64(), "height of its foot", nullable=True),
            column("top_m", pa.float64(), "height of its top", nullable=True),
            column("room_a", pa.int32(), "room on one side"),
            column("room_b", pa.int32(), "room on the other side", nullable=True),
            column("seen_share", pa.float64(), "share of its length along which it was seen"),
            column("geometry", pa.binary(), "WKB line"),
        ],
    ),
    "geometry",
    "LineString",
)


def to_table(walls: Walls) -> pa.Table:
    """Return one row per wall piece."""
    other = walls.rooms[:, 1]
    return pa.table(
        [
            pa.array(np.arange(len(walls), dtype=np.int32)),
            pa.array(walls.thickness_m, from_pandas=True),
            pa.array(walls.base_m, from_pandas=True),
            pa.array(walls.top_m, from_pandas=True),
            pa.array(walls.rooms[:, 0]),
            pa.array(other, mask=other < 0),
            pa.array(walls.seen),
            pa.array(shapely.to_wkb(shapely.linestrings(walls.lines)), pa.binary()),
        ],
        schema=SCHEMA,
    )


def from_table(table: pa.Table) -> Walls:
    """Return the walls a table holds."""
    lines = shapely.from_wkb(np.array(table["geometry"].to_pylist(), object))
    return Walls(
        lines=shapely.get_coordinates(lines).reshape(-1, 2, 2),
        thickness_m=table["thickness_m"].to_numpy().astype(float),
        base_m=table["base_m"].to_numpy().astype(float),
        top_m=table["top_m"].to_numpy().astype(float),
        rooms=np.column_stack(
            [table["room_a"].to_numpy(), table["room_b"].fill_null(-1).to_numpy()]
        ).astype(np.int32),
        seen=table["seen_share"].to_numpy(),
    )


WALLS = register(Kind("walls", Walls, SCHEMA, to_table, from_table))
