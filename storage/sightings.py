"""What each scan saw of the walls between decoded rooms, and which of it counts."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns

OFF, DRIFTS = "off", "drifts"
"""Why what a scan saw does not count: this face lies off what the others agree on; or all that the
scan saw does."""


@dataclass(frozen=True, eq=False)
class Sightings:
    """n faces of walls as one scan each saw them; entry i is one of them in every array.

    Positions are metres along the reference line from its start.
    """

    line_ids: NDArray[np.str_]
    """(n,), reference line"""
    walls: NDArray[np.int64]
    """(n,), wall along the line's most probable rooms: k stands before room k, the last one behind
    the last room"""
    sides: NDArray[np.int64]
    """(n,), 0: its lower face, which the room before the wall sees; 1: the upper one"""
    scans: NDArray[np.int64]
    """(n,), scan by its place in the storey's list"""
    at_m: NDArray[np.float64]
    """(n,), where it saw the face"""
    sigma_m: NDArray[np.float64]
    """(n,), standard deviation"""
    drift_m: NDArray[np.float64]
    """(n,), by how much all that the scan saw lies too far along the line; 0 unless it drifts"""
    left_out: NDArray[np.str_]
    """(n,), why it does not count: OFF or DRIFTS; '' it does. Of a face that only scans which drift
    have seen, what they saw counts, moved back"""
    fused_m: NDArray[np.float64]
    """(n,), where the face is, by all that counts"""
    fused_sigma_m: NDArray[np.float64]
    """(n,), standard deviation"""

    def __len__(self) -> int:
        return len(self.line_ids)


NO_SIGHTINGS = Sightings(
    *(np.empty(0, kind) for kind in (np.str_, int, int, int, float, float, float)),
    *(np.empty(0, kind) for kind in (np.str_, float, float)),
)
"""Of walls that were not held against single scans."""

_COLUMNS = {
    "line_ids": column("line", pa.string(), "reference line"),
    "walls": column("wall", pa.int64(), "of the line's most probable rooms: where room k begins"),
    "sides": column("side", pa.int64(), "0: face seen by the room before the wall, 1: by the next"),
    "scans": column("scan_place", pa.int64(), "place of the scan in the storey's list"),
    "at_m": column("at_m", pa.float64(), "where along the line the scan saw the face"),
    "sigma_m": column("sigma_m", pa.float64(), "its standard deviation"),
    "drift_m": column("drift_m", pa.float64(), "what the whole scan lies too far along the line"),
    "left_out": column("left_out", pa.string(), "off, drifts; null: it counts", nullable=True),
    "fused_m": column("fused_m", pa.float64(), "where the face is, by all that counts"),
    "fused_sigma_m": column("fused_sigma_m", pa.float64(), "its standard deviation"),
}
SCHEMA = schema("sightings", list(_COLUMNS.values()))


def to_table(sightings: Sightings) -> pa.Table:
    """Return one row per face and scan."""
    table = to_columns(sightings, _COLUMNS, SCHEMA)
    why = [text or None for text in table["left_out"].to_pylist()]
    return _with_left_out(table, pa.array(why, pa.string()))


def from_table(table: pa.Table) -> Sightings:
    """Return the sightings a table holds."""
    full = _with_left_out(table, table["left_out"].fill_null(""))
    return Sightings(**from_columns(full, _COLUMNS))


def _with_left_out(table: pa.Table, values: pa.Array | pa.ChunkedArray) -> pa.Table:
    at = table.schema.get_field_index("left_out")
    return table.set_column(at, table.schema.field(at), values)


SIGHTINGS = register(Kind("sightings", Sightings, SCHEMA, to_table, from_table))
