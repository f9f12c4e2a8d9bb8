"""The assumptions behind a saving, as names one can give another value.

Besides the energy model's constants: how many bytes a method sends, relative to what it did send,
and how many scans are no use.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat, model_validator

from storage.energy import BASELINES, MAPSENSE
from storage.scan_work import ScanWork
from tasks.device.costs import EnergyParams, scan_costs
from tasks.device.energy import saving
from tasks.device.queries import Draws, answer, draw_recordings, rooms_of
from tasks.params import Params

Constant = Literal[
    "capture_w",
    "cpu_w",
    "gate_ns_per_snapshot",
    "voxel_grid_ns_per_point",
    "octree_ns_per_point",
    "uplink_mw_per_mbit_s",
    "uplink_base_mw",
    "throughput_mbit_s",
    "transfer_j",
    "t_q",
    "attempts_max",
    "rejected_capture_share",
]
"""A field of `EnergyParams`."""
Factor = Literal["bytes_raw_factor", "bytes_mapsense_factor", "bytes_gramap_factor"]
"""The bytes a method sends, relative to those it did send."""
Share = Literal["unusable_share_foreseen"]
"""The share of a storey's recordings the server finds unusable - those of the worst P_sum - if the
gate rejected exactly these: the most any gate can bring at that share."""
Lever = Constant | Factor | Share


class Axis(Params):
    """One assumption and the range of its values, in the unit its name ends with."""

    lever: Lever
    """Which assumption."""
    low: PositiveFloat
    """Least value."""
    high: PositiveFloat
    """Greatest value."""

    @model_validator(mode="after")
    def _is_a_range(self) -> "Axis":
        if self.low > self.high:
            raise ValueError(f"{self.lever}: low {self.low} is above high {self.high}")
        return self

    def values(self, steps: int) -> NDArray[np.float64]:
        """Return values from low to high, each the same factor above the one before."""
        return np.geomspace(self.low, self.high, steps)


Case = tuple[ScanWork, EnergyParams]


def present(case: Case, lever: Lever) -> float:
    """Return the value of an assumption as it is."""
    work, params = case
    if lever in get_args(Constant):
        return float(getattr(params, lever))
    return 1.0 if lever in get_args(Factor) else float(np.mean(~work.usable))


def moved(case: Case, lever: Lever, value: float) -> Case:
    """Return the case under another value of one assumption.

    Raises
    ------
    ValueError
        If the assumption cannot have that value.
    """
    work, params = case
    if lever in get_args(Constant):
        given = round(value) if lever == "attempts_max" else value
        return work, EnergyParams(**(params.model_dump() | {lever: given}))
    if lever in get_args(Factor):
        name = lever.removesuffix("_factor")
        scaled = np.rint(getattr(work, name) * value).astype(np.int64)
        return replace(work, **{name: scaled}), params
    worst_first = np.argsort(-np.nan_to_num(work.p_sum, nan=-1.0), kind="stable")
    unusable = np.zeros(len(work), bool)
    unusable[worst_first[: round(value * len(work))]] = True
    foreseen = replace(work, usable=~unusable, p_sum=unusable.astype(float))
    return foreseen, params.model_copy(update={"t_q": 0.0})


def of_storey(work: ScanWork, storey: str) -> ScanWork:
    """Return the recordings of one storey."""
    rows = work.storeys == storey
    return ScanWork(**{f.name: getattr(work, f.name)[rows] for f in fields(work)})


def storey_draws(work: ScanWork, seeds: Sequence[int], attempts_max: int) -> Draws:
    """Return the (seeds, rooms, attempts) recordings for one query per room of one storey."""
    storey = str(work.storeys[0])
    n = len(rooms_of(work, storey))
    return np.array([draw_recordings(work, storey, seed, n, attempts_max) for seed in seeds])


def storey_savings(case: Case, draws: Draws) -> dict[str, float]:
    """Return MapSense's saving against each baseline with these draws, the mean over the seeds.

    Parameters
    ----------
    draws : (seeds, rooms, attempts) int
        At least as many attempts as the case allows.
    """
    work, params = case
    if draws.shape[-1] < params.attempts_max:
        raise ValueError(f"draws of {draws.shape[-1]} attempts, expected {params.attempts_max}")
    joules = {
        method: answer(draws[..., : params.attempts_max], costs, work.usable).total_j.sum(axis=-1)
        for method, costs in scan_costs(work, params).items()
    }
    return {b: float(np.mean(saving(joules[MAPSENSE], joules[b]))) for b in BASELINES}
