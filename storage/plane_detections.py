"""Which planes of a scan were found, and how true they lie: one row per match, miss and false find.

Recall is matches per row with a true id, precision matches per row with a found index; a second
plane on a surface that is matched already is a false find that names the surface.
"""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns


@dataclass(frozen=True, eq=False)
class PlaneDetections:
    """n matches, misses and false finds; entry i is one of them in every array."""

    simulated: NDArray[np.bool_]
    """(n,), whether the truth is simulated"""
    classes: NDArray[np.str_]
    """(n,), wall, floor or ceiling; of a false find vertical or horizontal"""
    true_ids: NDArray[np.str_]
    """(n,), true surface: its room, its kind, and the number of its edge; '' of a false find"""
    found: NDArray[np.int64]
    """(n,), row of the scan's segments; -1 of a miss"""
    part_of: NDArray[np.str_]
    """(n,), true surface that a false find is one more piece of; '' of anything else"""
    angle_rad: NDArray[np.float64]
    """(n,), between the normals of a match; NaN of anything else"""
    offset_m: NDArray[np.float64]
    """(n,), of a match, in the middle of what both cover: how far the true surface lies before the
    found plane, towards the room; NaN of anything else"""
    iou: NDArray[np.float64]
    """(n,), of the two areas on the true plane; NaN but of a match"""
    true_m2: NDArray[np.float64]
    """(n,), area of the true surface, openings cut out; NaN of a false find"""
    seen: NDArray[np.float64]
    """(n,), share of the true surface that the scan has points on; NaN of a false find"""
    found_m2: NDArray[np.float64]
    """(n,), area of the found segment; NaN of a miss"""

    def __len__(self) -> int:
        return len(self.found)


_COLUMNS = {
    "simulated": column("simulated", pa.bool_(), "the truth is simulated"),
    "classes": column("class", pa.string(), "wall, floor, ceiling; false: vertical, horizontal"),
    "true_ids": column("true_id", pa.string(), "null: a false find", nullable=True),
    "found": column("found_segment", pa.int64(), "row of segments; null: a miss", nullable=True),
    "part_of": column("part_of", pa.string(), "surface found twice; else null", nullable=True),
    "angle_rad": column("angle_rad", pa.float64(), "between the normals of a match", nullable=True),
    "offset_m": column(
        "offset_m", pa.float64(), "true surface before the found, of a match", nullable=True
    ),
    "iou": column("iou", pa.float64(), "of the areas of a match", nullable=True),
    "true_m2": column("true_m2", pa.float64(), "area of the true surface", nullable=True),
    "seen": column("seen", pa.float64(), "share of it with points", nullable=True),
    "found_m2": column("found_m2", pa.float64(), "area of the found segment", nullable=True),
}
SCHEMA = schema("plane_detections", list(_COLUMNS.values()))
_TEXTS = ("true_id", "part_of")


def to_table(detections: PlaneDetections) -> pa.Table:
    """Return one row per match, miss and false find."""
    table = to_columns(detections, _COLUMNS, SCHEMA)
    for name in _TEXTS:
        texts = table[name].to_pylist()
        table = _with(table, name, pa.array([text or None for text in texts], pa.string()))
    found = detections.found
    return _with(table, "found_segment", pa.array(found, pa.int64(), mask=found < 0))


def from_table(table: pa.Table) -> PlaneDetections:
    """Return the rows a table holds."""
    for name in _TEXTS:
        table = _with(table, name, table[name].fill_null(""))
    table = _with(table, "found_segment", table["found_segment"].fill_null(-1))
    return PlaneDetections(**from_columns(table, _COLUMNS))


def _with(table: pa.Table, name: str, values: pa.Array | pa.ChunkedArray) -> pa.Table:
    return table.set_column(table.schema.get_field_index(name), table.schema.field(name), values)


PLANE_DETECTIONS = register(Kind("plane_detections", PlaneDetections, SCHEMA, to_table, from_table))
