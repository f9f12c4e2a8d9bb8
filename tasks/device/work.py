"""The work of a campaign's scans, laid together for the energy model."""

import numpy as np
from pydantic import NonNegativeFloat, NonNegativeInt

from storage.scan_work import ScanWork
from tasks.params import Params

RAW_BYTES = 12
"""Bytes of a raw point: three 32-bit floats, as Tango's clouds."""


class Tally(Params):
    """What was counted of one scan."""

    storey: str
    """Storey of the scan."""
    room: str
    """Room the sensing query asked for."""
    scan: str
    """Name of the scan."""
    volunteer: str
    """Who scanned."""
    skill: float | None = None
    """Simulated skill of the volunteer in this scan, 0 to 1; None: unknown."""
    duration_s: NonNegativeFloat
    """From the first to the last snapshot, seconds."""
    raw_points: NonNegativeInt
    """Points captured."""
    voxel_points: NonNegativeInt
    """Points the voxel grid leaves."""
    snapshots: NonNegativeInt
    """Snapshots."""
    p_sum: float | None
    """P_sum (Eq. 3); None: not assessed."""
    bytes_mapsense: NonNegativeInt
    """Octree stream after the voxel grid, bytes."""
    bytes_gramap: NonNegativeInt
    """Octree stream at the low profile without a voxel grid, bytes."""
    iou: float
    """Of the room found in this scan alone with the true one; 0 if none was found."""


class WorkParams(Params):
    """A campaign's scans, and what is asked of them."""

    scans: tuple[Tally, ...] = ()
    """All scans."""
    usable_iou: float = 0.8
    """Least IoU with the true room of what the server makes of one scan alone, that it need not
    ask again. Assumption: an area error of about a fifth."""


def tally_work(params: WorkParams) -> ScanWork:
    """Return the scans' work as one table."""
    rows = params.scans
    whole = {
        name: np.array([getattr(row, name) for row in rows], np.int64)
        for name in ("raw_points", "voxel_points", "snapshots", "bytes_mapsense", "bytes_gramap")
    }
    return ScanWork(
        storeys=np.array([row.storey for row in rows], np.str_),
        rooms=np.array([row.room for row in rows], np.str_),
        scans=np.array([row.scan for row in rows], np.str_),
        volunteers=np.array([row.volunteer for row in rows], np.str_),
        skills=np.array([np.nan if row.skill is None else row.skill for row in rows], float),
        duration_s=np.array([row.duration_s for row in rows], float),
        p_sum=np.array([np.nan if row.p_sum is None else row.p_sum for row in rows], float),
        bytes_raw=RAW_BYTES * whole["raw_points"],
        usable=np.array([row.iou >= params.usable_iou for row in rows], bool),
        **whole,
    )
