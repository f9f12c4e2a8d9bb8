"""How much of what labelled points show was found: for scans whose only truth is point labels."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns


@dataclass(frozen=True, eq=False)
class PointQuality:
    """r classes at some distances; entry i is one class at one distance in every array.

    Points are evened out to one a cell, so that they stand for area, not for how long was scanned.
    """

    simulated: NDArray[np.bool_]
    """(r,), whether the plan or the labelled scans are simulated"""
    classes: NDArray[np.str_]
    """(r,), floor, ceiling, wall, door, window or furniture"""
    buffer_m: NDArray[np.float64]
    """(r,), greatest distance of a point from a surface it lies on"""
    true_points: NDArray[np.int64]
    """(r,), points labelled so"""
    near_points: NDArray[np.int64]
    """(r,), of those the ones that lie on a found surface of the class"""
    found_points: NDArray[np.int64]
    """(r,), points of any label that the plan says are of the class"""
    matched_points: NDArray[np.int64]
    """(r,), points of the class that the plan says are of it"""
    completeness: NDArray[np.float64]
    """(r,), near / true; NaN if no point is labelled so"""
    iou: NDArray[np.float64]
    """(r,), matched / (true + found - matched); NaN of nothing"""

    def __len__(self) -> int:
        return len(self.classes)


_COLUMNS = {
    "simulated": column("simulated", pa.bool_(), "the plan or the labelled scans are simulated"),
    "classes": column("class", pa.string(), "floor, ceiling, wall, door, window, furniture"),
    "buffer_m": column("buffer_m", pa.float64(), "greatest distance of point and surface"),
    "true_points": column("true_points", pa.int64(), "points labelled so, one a cell"),
    "near_points": column("near_points", pa.int64(), "of those, on a found surface of the class"),
    "found_points": column("found_points", pa.int64(), "points the plan says are of the class"),
    "matched_points": column("matched_points", pa.int64(), "of those, labelled so"),
    "completeness": column("completeness", pa.float64(), "near / true", nullable=True),
    "iou": column("iou", pa.float64(), "matched / (true + found - matched)", nullable=True),
}
SCHEMA = schema("point_quality", list(_COLUMNS.values()))


def to_table(quality: PointQuality) -> pa.Table:
    """Return one row per class and distance."""
    return to_columns(quality, _COLUMNS, SCHEMA)


def from_table(table: pa.Table) -> PointQuality:
    """Return the rows a table holds."""
    return PointQuality(**from_columns(table, _COLUMNS))


POINT_QUALITY = register(Kind("point_quality", PointQuality, SCHEMA, to_table, from_table))
