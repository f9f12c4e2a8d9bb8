"""What each recorded scan of a campaign costs to make and to send, and whether it is any use."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns


@dataclass(frozen=True, eq=False)
class ScanWork:
    """s recorded scans of one or more storeys; entry i is one scan in every array.

    Counted work and bytes only: what they cost in joules is the energy model's. Bytes are given
    for every method and every scan, also for those a method would never send.
    """

    storeys: NDArray[np.str_]
    """(s,)"""
    rooms: NDArray[np.str_]
    """(s,), the room asked for; unique within its storey only"""
    scans: NDArray[np.str_]
    """(s,), name of the scan"""
    volunteers: NDArray[np.str_]
    """(s,), who scanned"""
    skills: NDArray[np.float64]
    """(s,), the volunteer's skill in this scan, 0 to 1; NaN: a real one, nobody knows"""
    duration_s: NDArray[np.float64]
    """(s,), seconds from the first to the last snapshot"""
    raw_points: NDArray[np.int64]
    """(s,), points captured"""
    voxel_points: NDArray[np.int64]
    """(s,), points left by MapSense's voxel grid"""
    snapshots: NDArray[np.int64]
    """(s,)"""
    p_sum: NDArray[np.float64]
    """(s,), the quality model's P_sum; NaN: not assessed"""
    bytes_raw: NDArray[np.int64]
    """(s,), upload without processing: 12 bytes a point (three 32-bit floats)"""
    bytes_mapsense: NDArray[np.int64]
    """(s,), octree stream after the voxel grid"""
    bytes_gramap: NDArray[np.int64]
    """(s,), octree stream at the low profile, without a voxel grid"""
    usable: NDArray[np.bool_]
    """(s,), whether the server finds what it makes of the scan good enough"""

    def __len__(self) -> int:
        return len(self.storeys)


_COLUMNS = {
    "storeys": column("storey", pa.string(), "storey of the scan"),
    "rooms": column("room", pa.string(), "room asked for"),
    "scans": column("scan", pa.string(), "name of the scan"),
    "volunteers": column("volunteer", pa.string(), "who scanned"),
    "skills": column("skill", pa.float64(), "simulated skill; null: unknown", nullable=True),
    "duration_s": column("duration_s", pa.float64(), "time from first to last snapshot"),
    "raw_points": column("raw_points", pa.int64(), "points captured"),
    "voxel_points": column("voxel_points", pa.int64(), "points left by the voxel grid"),
    "snapshots": column("snapshots", pa.int64(), "snapshots with a pose"),
    "p_sum": column("p_sum", pa.float64(), "P_sum (Eq. 3); null: not assessed", nullable=True),
    "bytes_raw": column("bytes_raw", pa.int64(), "upload of No Processing"),
    "bytes_mapsense": column("bytes_mapsense", pa.int64(), "upload of MapSense"),
    "bytes_gramap": column("bytes_gramap", pa.int64(), "upload of GraMap"),
    "usable": column("usable", pa.bool_(), "good enough for the server"),
}
SCHEMA = schema("scan_work", list(_COLUMNS.values()))


def to_table(work: ScanWork) -> pa.Table:
    """Return one row per scan."""
    return to_columns(work, _COLUMNS, SCHEMA)


def from_table(table: pa.Table) -> ScanWork:
    """Return the scans a table holds."""
    return ScanWork(**from_columns(table, _COLUMNS))


SCAN_WORK = register(Kind("scan_work", ScanWork, SCHEMA, to_table, from_table))
