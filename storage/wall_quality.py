"""How much of the true walls was found, how much found is wall, and how near it lies."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns


@dataclass(frozen=True, eq=False)
class WallQuality:
    """b buffers; entry i is one buffer in every array. Lengths are of wall faces on the plan."""

    simulated: NDArray[np.bool_]
    """(b,), whether the plan, its scans or the truth are simulated"""
    buffer_m: NDArray[np.float64]
    """(b,), greatest distance of two faces that are one"""
    true_m: NDArray[np.float64]
    """(b,), length of the true faces"""
    found_m: NDArray[np.float64]
    """(b,), length of the found faces"""
    completeness: NDArray[np.float64]
    """(b,), share of the true length that lies within the buffer of the found; NaN of nothing"""
    correctness: NDArray[np.float64]
    """(b,), share of the found length that lies within the buffer of the true; NaN of nothing"""
    accuracy_m: NDArray[np.float64]
    """(b,), median distance of the true faces within the buffer to the found; NaN of nothing"""

    def __len__(self) -> int:
        return len(self.buffer_m)


_COLUMNS = {
    "simulated": column("simulated", pa.bool_(), "the plan, its scans or the truth are simulated"),
    "buffer_m": column("buffer_m", pa.float64(), "greatest distance of two faces that are one"),
    "true_m": column("true_m", pa.float64(), "length of the true faces"),
    "found_m": column("found_m", pa.float64(), "length of the found faces"),
    "completeness": column(
        "completeness", pa.float64(), "share of the true within the buffer", nullable=True
    ),
    "correctness": column(
        "correctness", pa.float64(), "share of the found within the buffer", nullable=True
    ),
    "accuracy_m": column(
        "accuracy_m", pa.float64(), "median distance within the buffer", nullable=True
    ),
}
SCHEMA = schema("wall_quality", list(_COLUMNS.values()))


def to_table(quality: WallQuality) -> pa.Table:
    """Return one row per buffer."""
    return to_columns(quality, _COLUMNS, SCHEMA)


def from_table(table: pa.Table) -> WallQuality:
    """Return the rows a table holds."""
    return WallQuality(**from_columns(table, _COLUMNS))


WALL_QUALITY = register(Kind("wall_quality", WallQuality, SCHEMA, to_table, from_table))
