"""Simulated energy of a campaign's devices: per storey, method and number of sensing queries."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns

MAPSENSE, GRAMAP, NO_PROCESSING = "MapSense", "GraMap", "No Processing"
METHODS = (MAPSENSE, GRAMAP, NO_PROCESSING)
BASELINES = (GRAMAP, NO_PROCESSING)
QUERIES, STOREY = "queries", "storey"
"""Series: the first n queries (Fig. 19a); one query for each room of the storey (Fig. 19b)."""


@dataclass(frozen=True, eq=False)
class Energy:
    """r accumulated sums; entry i is one sum in every array. Joules are simulated, not measured."""

    series: NDArray[np.str_]
    """(r,), QUERIES or STOREY"""
    storeys: NDArray[np.str_]
    """(r,)"""
    methods: NDArray[np.str_]
    """(r,), one of METHODS"""
    n_queries: NDArray[np.int64]
    """(r,), sensing queries accumulated"""
    seeds: NDArray[np.int64]
    """(r,), seed of the draws"""
    captures: NDArray[np.int64]
    """(r,), scans made: the queries and their repeats"""
    rejected: NDArray[np.int64]
    """(r,), scans the device kept back"""
    uploads: NDArray[np.int64]
    """(r,), scans sent"""
    unanswered: NDArray[np.int64]
    """(r,), queries given up without a usable scan"""
    capture_j: NDArray[np.float64]
    """(r,), joules of scanning"""
    process_j: NDArray[np.float64]
    """(r,), joules of computing on the device"""
    transmit_j: NDArray[np.float64]
    """(r,), joules of uploading"""
    total_j: NDArray[np.float64]
    """(r,), their sum"""

    def __len__(self) -> int:
        return len(self.methods)


_COLUMNS = {
    "series": column("series", pa.string(), "queries (Fig. 19a) or storey (Fig. 19b)"),
    "storeys": column("storey", pa.string(), "storey whose rooms were asked for"),
    "methods": column("method", pa.string(), "MapSense, GraMap or No Processing"),
    "n_queries": column("n_queries", pa.int64(), "sensing queries accumulated"),
    "seeds": column("seed", pa.int64(), "seed of the draws"),
    "captures": column("captures", pa.int64(), "scans made: queries and repeats"),
    "rejected": column("rejected", pa.int64(), "scans the device kept back"),
    "uploads": column("uploads", pa.int64(), "scans sent"),
    "unanswered": column("unanswered", pa.int64(), "queries given up without a usable scan"),
    "capture_j": column("capture_j", pa.float64(), "scanning, simulated"),
    "process_j": column("process_j", pa.float64(), "computing on the device, simulated"),
    "transmit_j": column("transmit_j", pa.float64(), "uploading, simulated"),
    "total_j": column("total_j", pa.float64(), "all three, simulated"),
}
SCHEMA = schema("energy", list(_COLUMNS.values()), **{"mapsense.origin": "simulated"})


def to_table(energy: Energy) -> pa.Table:
    """Return one row per accumulated sum."""
    return to_columns(energy, _COLUMNS, SCHEMA)


def from_table(table: pa.Table) -> Energy:
    """Return the sums a table holds."""
    return Energy(**from_columns(table, _COLUMNS))


ENERGY = register(Kind("energy", Energy, SCHEMA, to_table, from_table))
