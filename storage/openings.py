"""The doors and windows of a storey, each on its wall (Sec. 5)."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import shapely
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.geo import with_geometry

DOOR, WINDOW = "door", "window"
OPEN, AJAR, SHUT, UNKNOWN = "open", "ajar", "shut", "unknown"
STATES = (OPEN, AJAR, SHUT)
"""How the leaf of a door stands, if that is known."""


@dataclass(frozen=True, eq=False)
class Openings:
    """n doors and windows; entry i is one of them everywhere. Building frame, metres."""

    kinds: NDArray[np.str_]
    """(n,), DOOR or WINDOW"""
    lines: NDArray[np.float64]
    """(n, 2, 2), ends on the centre line of the wall piece"""
    sill_m: NDArray[np.float64]
    """(n,), height of the lower side"""
    head_m: NDArray[np.float64]
    """(n,), height of the upper side"""
    walls: NDArray[np.int32]
    """(n,), row of the wall piece"""
    rooms: NDArray[np.int32]
    """(n, 2), rooms on its two sides, the lesser first; -1 for none or none known"""
    states: NDArray[np.str_]
    """(n,), OPEN, AJAR, SHUT or UNKNOWN; '' of a window"""
    confidences: NDArray[np.float64]
    """(n,), 0 to 1"""

    def __len__(self) -> int:
        return len(self.kinds)

    def of_kind(self, kind: str) -> NDArray[np.int64]:
        """Return the rows of the doors or of the windows."""
        return np.flatnonzero(self.kinds == kind)


SCHEMA = with_geometry(
    schema(
        "openings",
        [
            column("kind", pa.string(), "door or window"),
            column("wall", pa.int32(), "row of the wall piece"),
            column("room_a", pa.int32(), "room on one side", nullable=True),
            column("room_b", pa.int32(), "room on the other side", nullable=True),
            column("width_m", pa.float64(), "length along the wall"),
            column("sill_m", pa.float64(), "height of the lower side"),
            column("head_m", pa.float64(), "height of the upper side"),
            column("state", pa.string(), "open, ajar, shut, unknown; empty of a window"),
            column("confidence", pa.float64(), "0 to 1"),
            column("geometry", pa.binary(), "WKB line across the opening"),
        ],
    ),
    "geometry",
    "LineString",
)


def to_table(openings: Openings) -> pa.Table:
    """Return one row per door or window."""
    rooms = openings.rooms
    return pa.table(
        [
            pa.array(openings.kinds.tolist(), pa.string()),
            pa.array(openings.walls, pa.int32()),
            *(pa.array(rooms[:, i], pa.int32(), mask=rooms[:, i] < 0) for i in range(2)),
            pa.array(np.linalg.norm(openings.lines[:, 1] - openings.lines[:, 0], axis=1)),
            pa.array(openings.sill_m),
            pa.array(openings.head_m),
            pa.array(openings.states.tolist(), pa.string()),
            pa.array(openings.confidences),
            pa.array(shapely.to_wkb(shapely.linestrings(openings.lines)), pa.binary()),
        ],
        schema=SCHEMA,
    )


def from_table(table: pa.Table) -> Openings:
    """Return the openings a table holds."""
    lines = shapely.from_wkb(np.array(table["geometry"].to_pylist(), object))
    rooms = [table[name].fill_null(-1).to_numpy() for name in ("room_a", "room_b")]
    return Openings(
        kinds=np.array(table["kind"].to_pylist(), np.str_),
        lines=shapely.get_coordinates(lines).reshape(-1, 2, 2),
        sill_m=table["sill_m"].to_numpy(),
        head_m=table["head_m"].to_numpy(),
        walls=table["wall"].to_numpy(),
        rooms=np.column_stack(rooms).astype(np.int32),
        states=np.array(table["state"].to_pylist(), np.str_),
        confidences=table["confidence"].to_numpy(),
    )


OPENINGS = register(Kind("openings", Openings, SCHEMA, to_table, from_table))
