"""What was found of what is there, object by object: precision and recall are counts of its rows.

At each threshold an object is in one row: a match, with both ids; missed, with the true id alone;
or false, with the found id alone. Which plan it was, made with which seed, is the run's to say.
"""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns

IOU, IOU_CLASS, IOU_WIDTH, IOU_3D = "iou", "iou_class", "iou_width", "iou_3d"
DISTANCE, LINKS = "distance_m", "links"
METRICS = (IOU, IOU_CLASS, IOU_WIDTH, IOU_3D, DISTANCE, LINKS)
"""How two objects are compared: by intersection over union of areas (an opening's on the wall
plane), the same of objects of one class only, of widths along the wall, of volumes; by Euclidean
distance; by the rooms they link."""


@dataclass(frozen=True, eq=False)
class Detections:
    """n matches, misses and false finds; entry i is one of them in every array."""

    simulated: NDArray[np.bool_]
    """(n,), whether the plan, its scans or the truth are simulated"""
    classes: NDArray[np.str_]
    """(n,), room, corner, wall, wall_end, door, window, furniture (all of it), table, chair, ..."""
    metrics: NDArray[np.str_]
    """(n,), one of METRICS"""
    thresholds: NDArray[np.float64]
    """(n,), metres at most, or intersection over union exceeded; of LINKS that of the rooms"""
    true_ids: NDArray[np.str_]
    """(n,), true object; '' of a false find"""
    found_ids: NDArray[np.str_]
    """(n,), found object; '' of a miss"""
    values: NDArray[np.float64]
    """(n,), intersection over union, or metres apart; NaN but of a match"""
    true_classes: NDArray[np.str_]
    """(n,), class of a true room or piece of furniture; '' if it has none"""
    found_classes: NDArray[np.str_]
    """(n,), class of a found room or piece of furniture; '' if it has none"""
    true_m2: NDArray[np.float64]
    """(n,), area of the true room; NaN of anything else"""
    found_m2: NDArray[np.float64]
    """(n,), area of the found room; NaN of anything else"""
    width_error_m: NDArray[np.float64]
    """(n,), found - true width of a matched door or window; NaN of anything else"""

    def __len__(self) -> int:
        return len(self.values)


_COLUMNS = {
    "simulated": column("simulated", pa.bool_(), "the plan, its scans or the truth are simulated"),
    "classes": column("class", pa.string(), "room, corner, wall, wall_end, door, window, ..."),
    "metrics": column("metric", pa.string(), ", ".join(METRICS)),
    "thresholds": column("threshold", pa.float64(), "metres at most, or IoU exceeded"),
    "true_ids": column("true_id", pa.string(), "null: a false find", nullable=True),
    "found_ids": column("found_id", pa.string(), "null: a miss", nullable=True),
    "values": column("value", pa.float64(), "IoU, or metres; null: no match", nullable=True),
    "true_classes": column("true_class", pa.string(), "null if it has none", nullable=True),
    "found_classes": column("found_class", pa.string(), "null if it has none", nullable=True),
    "true_m2": column("true_m2", pa.float64(), "area of a true room", nullable=True),
    "found_m2": column("found_m2", pa.float64(), "area of a found room", nullable=True),
    "width_error_m": column(
        "width_error_m", pa.float64(), "found - true, of a matched opening", nullable=True
    ),
}
SCHEMA = schema("detections", list(_COLUMNS.values()))
_TEXTS = ("true_id", "found_id", "true_class", "found_class")


def to_table(detections: Detections) -> pa.Table:
    """Return one row per match, miss and false find."""
    table = to_columns(detections, _COLUMNS, SCHEMA)
    for name in _TEXTS:
        texts = table[name].to_pylist()
        table = _with(table, name, pa.array([text or None for text in texts], pa.string()))
    return table


def from_table(table: pa.Table) -> Detections:
    """Return the rows a table holds."""
    for name in _TEXTS:
        table = _with(table, name, table[name].fill_null(""))
    return Detections(**from_columns(table, _COLUMNS))


def _with(table: pa.Table, name: str, values: pa.Array | pa.ChunkedArray) -> pa.Table:
    return table.set_column(table.schema.get_field_index(name), table.schema.field(name), values)


DETECTIONS = register(Kind("detections", Detections, SCHEMA, to_table, from_table))
