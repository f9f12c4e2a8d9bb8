"""What a scan costs the device in joules under each method: all constants, and their sum per scan.

Every figure is simulated: work and bytes are counted, joules follow from the constants below.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from storage.energy import GRAMAP, MAPSENSE, NO_PROCESSING
from storage.scan_work import ScanWork
from tasks.device.quality import T_Q
from tasks.params import Params


class EnergyParams(Params):
    """Constants of the energy model, each with its source; what is assumed, the sweep varies."""

    capture_w: NonNegativeFloat = 2.5
    """Power while scanning (depth sensor, cameras, tracking; no screen), watts. Assumption: no
    figure is published; a depth sensor of the kind alone takes over 1 W."""
    cpu_w: NonNegativeFloat = 2.0
    """Power of the processor while it processes a scan, watts. Assumption: one busy core of a
    tablet."""
    gate_ns_per_snapshot: NonNegativeFloat = 1000.0
    """Time of the quality model, nanoseconds a snapshot. Assumption: a hundred operations."""
    voxel_grid_ns_per_point: NonNegativeFloat = 200.0
    """Time of the voxel grid, nanoseconds a raw point. Assumption: 50 on a desktop's core, four
    times that on a tablet's."""
    octree_ns_per_point: NonNegativeFloat = 700.0
    """Time of octree compression, nanoseconds a point put in. Assumption: 170 on a desktop's core
    (PCL's and ours alike), four times that on a tablet's."""
    uplink_mw_per_mbit_s: NonNegativeFloat = 283.17
    """Wi-Fi power while sending, milliwatts per Mbit/s (Huang et al., MobiSys 2012)."""
    uplink_base_mw: NonNegativeFloat = 132.86
    """Wi-Fi power while sending at no throughput, milliwatts (Huang et al., MobiSys 2012)."""
    throughput_mbit_s: PositiveFloat = 20.0
    """Wi-Fi throughput upwards, Mbit/s. Assumption."""
    transfer_j: NonNegativeFloat = 0.04
    """Promotion and tail of one Wi-Fi transfer, joules (Huang et al., MobiSys 2012)."""
    t_q: float = Field(default=T_Q, ge=0, le=1)
    """Quality requirement of the sensing queries (Eq. 4); here, so that it can be varied."""
    attempts_max: PositiveInt = 5
    """Scans made for one query before it is given up. Assumption: the paper names no limit."""
    rejected_capture_share: float = Field(default=1.0, ge=0, le=1)
    """Share of a scan's capture spent before the device rejects it. In the paper a scan is judged
    at its end: 1. What judging it while it is made would save, smaller shares show."""
    n_queries: tuple[PositiveInt, ...] = tuple(range(5, 45, 5))
    """Numbers of queries accumulated (Fig. 19a)."""
    seeds: tuple[NonNegativeInt, ...] = Field(default=tuple(range(10)), min_length=1)
    """Seeds of the draws; the paper repeats each run ten times (Sec. 7.3)."""


@dataclass(frozen=True, eq=False)
class Costs:
    """What one method pays for each of s recorded scans, should it be the one captured."""

    rejected: NDArray[np.bool_]
    """(s,), the device keeps it back: neither processed further nor sent"""
    capture_j: NDArray[np.float64]
    """(s,), joules"""
    gate_j: NDArray[np.float64]
    """(s,), joules of judging it"""
    process_j: NDArray[np.float64]
    """(s,), joules of processing it, if it is not rejected"""
    transmit_j: NDArray[np.float64]
    """(s,), joules of sending it, if it is not rejected"""


def scan_costs(work: ScanWork, params: EnergyParams) -> dict[str, Costs]:
    """Return what each scan costs under each method.

    Notes
    -----
    MapSense: quality gate, voxel grid over the raw points, octree over what that leaves. A scan
    that could not be assessed cannot be rejected either. GraMap: octree over the raw points, no
    gate. No Processing: the raw points are sent. Registration runs while scanning and counts as
    capture for all three.
    """
    bad = work.p_sum > params.t_q  # false for NaN
    capture = params.capture_w * work.duration_s
    capture_gated = capture * np.where(bad, params.rejected_capture_share, 1.0)
    gate = _compute_j(work.snapshots, params.gate_ns_per_snapshot, params)
    grid = _compute_j(work.raw_points, params.voxel_grid_ns_per_point, params)
    octree = _compute_j(work.voxel_points, params.octree_ns_per_point, params)
    octree_of_all = _compute_j(work.raw_points, params.octree_ns_per_point, params)
    none, never = np.zeros(len(work)), np.zeros(len(work), bool)
    send_grid, send_octree, send_raw = (
        transmit_j(size, params)
        for size in (work.bytes_mapsense, work.bytes_gramap, work.bytes_raw)
    )
    return {
        MAPSENSE: Costs(bad, capture_gated, gate, grid + octree, send_grid),
        GRAMAP: Costs(never, capture, none, octree_of_all, send_octree),
        NO_PROCESSING: Costs(never, capture, none, none, send_raw),
    }


def transmit_j(size: NDArray[np.int64], params: EnergyParams) -> NDArray[np.float64]:
    """Return the joules of one transfer each of (s,) bytes."""
    watts = (params.uplink_mw_per_mbit_s * params.throughput_mbit_s + params.uplink_base_mw) / 1e3
    seconds = size.astype(np.float64) * 8 / (params.throughput_mbit_s * 1e6)
    return watts * seconds + params.transfer_j


def _compute_j(
    work: NDArray[np.int64], ns_each: float, params: EnergyParams
) -> NDArray[np.float64]:
    return work.astype(np.float64) * (params.cpu_w * ns_each * 1e-9)
