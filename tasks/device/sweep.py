"""How the saving depends on what the energy model assumes: each constant, and some together."""

from collections.abc import Iterator
from itertools import product

import numpy as np
from pydantic import Field, model_validator

from storage.energy_sweep import EnergySweep
from storage.scan_work import ScanWork
from tasks.device.costs import EnergyParams
from tasks.device.levers import Axis, Case, Lever, moved, of_storey, storey_draws, storey_savings
from tasks.params import Params

AXES = (
    Axis(lever="capture_w", low=1.0, high=5.0),  # a depth sensor alone; a hot device
    Axis(lever="cpu_w", low=1.0, high=4.0),  # one core; all of them
    Axis(lever="gate_ns_per_snapshot", low=1e2, high=1e5),
    Axis(lever="voxel_grid_ns_per_point", low=50, high=800),  # a desktop's core; slow code
    Axis(lever="octree_ns_per_point", low=170, high=2800),
    # 4G upwards of a phone of 2021 (Narayanan et al., SIGCOMM 2021); LTE (Huang et al., 2012)
    Axis(lever="uplink_mw_per_mbit_s", low=80.21, high=438.39),
    Axis(lever="uplink_base_mw", low=132.86, high=1288.0),  # LTE (Huang et al., 2012)
    Axis(lever="throughput_mbit_s", low=5, high=40),
    Axis(lever="transfer_j", low=0.04, high=12.76),  # LTE (Huang et al., 2012)
    Axis(lever="t_q", low=0.4, high=1.0),
    Axis(lever="attempts_max", low=2, high=10),
)
"""Ranges that hold what is plausible for a hand-held device; assumptions where no source stands."""


class SweepParams(Params):
    """What the sensitivity sweep varies. Not in the paper."""

    axes: tuple[Axis, ...] = AXES
    """Assumptions varied one at a time, and their ranges."""
    joint: tuple[tuple[Lever, Lever], ...] = (
        ("capture_w", "uplink_mw_per_mbit_s"),
        ("capture_w", "throughput_mbit_s"),
        ("cpu_w", "octree_ns_per_point"),
    )
    """Pairs of them varied together."""
    steps: int = Field(default=5, ge=2)
    """Values taken of each, from its least to its greatest."""

    @model_validator(mode="after")
    def _knows_the_ranges(self) -> "SweepParams":
        unknown = {lever for pair in self.joint for lever in pair} - {a.lever for a in self.axes}
        if unknown:
            raise ValueError(f"joint: no axis gives a range of {', '.join(sorted(unknown))}")
        return self


Point = tuple[str, float, str, float]
"""The first assumption and its value, the second and its value: '' and NaN if none."""


def sweep(work: ScanWork, params: EnergyParams, ranges: SweepParams) -> EnergySweep:
    """Return the saving with one query per room under varied assumptions, storey by storey.

    Notes
    -----
    The draws are the same in all cases: what differs is what they cost.
    """
    rows: list[tuple[str, str, Point, float]] = []
    for storey in np.unique(work.storeys).tolist():
        here = of_storey(work, storey)
        cases = list(_cases((here, params), ranges))
        most = max((case[1].attempts_max for _, case in cases), default=1)
        draws = storey_draws(here, params.seeds, most)
        for point, case in cases:
            found = storey_savings(case, draws).items()
            rows += [(storey, baseline, point, saved) for baseline, saved in found]
    points = [point for _, _, point, _ in rows]
    return EnergySweep(
        storeys=np.array([row[0] for row in rows], np.str_),
        baselines=np.array([row[1] for row in rows], np.str_),
        first=np.array([point[0] for point in points], np.str_),
        first_values=np.array([point[1] for point in points], float),
        second=np.array([point[2] for point in points], np.str_),
        second_values=np.array([point[3] for point in points], float),
        savings=np.array([row[3] for row in rows], float),
    )


def _cases(case: Case, ranges: SweepParams) -> Iterator[tuple[Point, Case]]:
    values = {axis.lever: axis.values(ranges.steps).tolist() for axis in ranges.axes}
    for lever, each in values.items():
        for value in each:
            yield (lever, value, "", np.nan), moved(case, lever, value)
    for first, second in ranges.joint:
        for one, other in product(values[first], values[second]):
            both = moved(moved(case, first, one), second, other)
            yield (first, one, second, other), both
