"""What would bring a wanted saving: which assumption, moved how far."""

import numpy as np
from pydantic import Field

from storage.energy import GRAMAP, NO_PROCESSING
from storage.energy_targets import EnergyTargets
from storage.scan_work import ScanWork
from tasks.device.costs import EnergyParams
from tasks.device.levers import (
    Axis,
    Case,
    moved,
    of_storey,
    present,
    storey_draws,
    storey_savings,
)
from tasks.device.queries import Draws
from tasks.params import Params

HALVINGS = 40
"""Bisections of a step: far below any figure one would state."""

AXES = (
    Axis(lever="capture_w", low=0.05, high=10),
    Axis(lever="cpu_w", low=0.05, high=20),
    Axis(lever="octree_ns_per_point", low=10, high=20_000),
    Axis(lever="uplink_mw_per_mbit_s", low=20, high=2000),
    Axis(lever="bytes_raw_factor", low=0.1, high=10),
    Axis(lever="bytes_gramap_factor", low=0.1, high=100),
    Axis(lever="bytes_mapsense_factor", low=0.01, high=1),
    Axis(lever="t_q", low=0.02, high=1),
    Axis(lever="rejected_capture_share", low=0.05, high=1),
    Axis(lever="unusable_share_foreseen", low=0.01, high=0.9),
)
"""Wider than is plausible: an answer outside the sweep's range says how far off it is."""


class TargetParams(Params):
    """The savings wanted, and what may be moved for them."""

    no_processing: tuple[float, ...] = (0.46, 0.60)
    """Savings wanted against No Processing: the paper's (Sec. 7.3.2), and more."""
    gramap: tuple[float, ...] = (0.24, 0.40)
    """Savings wanted against GraMap: the paper's (Sec. 7.3.2), and more."""
    axes: tuple[Axis, ...] = AXES
    """What may be moved, one at a time, and how far. Not in the paper."""
    steps: int = Field(default=25, ge=2)
    """Values tried within each range before the place is refined. Not in the paper."""


def solve_targets(work: ScanWork, params: EnergyParams, wanted: TargetParams) -> EnergyTargets:
    """Return for each lever the value nearest to the present one that brings the wanted saving.

    Notes
    -----
    The saving is that of one query per room, the mean over the seeds. Where it already reaches the
    target, the value needed is the present one.
    """
    targets = {GRAMAP: wanted.gramap, NO_PROCESSING: wanted.no_processing}
    rows: list[tuple[str | float, ...]] = []
    for storey in np.unique(work.storeys).tolist():
        case = (of_storey(work, storey), params)
        draws = storey_draws(case[0], params.seeds, params.attempts_max)
        as_assumed = storey_savings(case, draws)
        for axis in wanted.axes:
            curve = _Curve(case, axis, wanted.steps, draws)
            now = present(case, axis.lever)
            for baseline, saved in as_assumed.items():
                for target in targets[baseline]:
                    needed = now if saved >= target else curve.nearest(now, baseline, target)
                    best = curve.best(baseline)
                    rows.append((storey, baseline, target, saved, axis.lever, now, needed, *best))
    rows.sort(key=lambda row: row[:3])  # by storey, baseline and target
    columns = list(zip(*rows, strict=True)) or [()] * 9
    texts = (0, 1, 4)  # storey, baseline, lever
    return EnergyTargets(
        *(np.array(c, np.str_ if i in texts else float) for i, c in enumerate(columns))
    )


class _Curve:
    """The savings of one storey as functions of one lever."""

    def __init__(self, case: Case, axis: Axis, steps: int, draws: Draws) -> None:
        self._case, self._lever, self._draws = case, axis.lever, draws
        self._values = axis.values(steps).tolist()
        self._saved = [self._savings(value) for value in self._values]

    def best(self, baseline: str) -> tuple[float, float]:
        """Return the value that saves most, and what it saves."""
        saved = [each[baseline] for each in self._saved]
        best = int(np.argmax(np.nan_to_num(saved, nan=-np.inf)))
        return self._values[best], saved[best]

    def nearest(self, now: float, baseline: str, target: float) -> float:
        """Return the value nearest to `now` at which the target is reached; NaN if none is."""
        reached = [each[baseline] >= target for each in self._saved]
        found = [
            value for value, is_reached in zip(self._values, reached, strict=True) if is_reached
        ]
        for i in range(len(reached) - 1):
            if reached[i] != reached[i + 1]:
                outside, inside = (i, i + 1) if reached[i + 1] else (i + 1, i)
                ends = self._values[outside], self._values[inside]
                found.append(self._refined(*ends, baseline, target))
        return min(found, key=lambda value: abs(value - now), default=np.nan)

    def _refined(self, outside: float, inside: float, baseline: str, target: float) -> float:
        """Return where between two values the target is first reached, by bisection."""
        for _ in range(HALVINGS):
            middle = (outside + inside) / 2
            if self._savings(middle)[baseline] >= target:
                inside = middle
            else:
                outside = middle
        return inside

    def _savings(self, value: float) -> dict[str, float]:
        return storey_savings(moved(self._case, self._lever, value), self._draws)
