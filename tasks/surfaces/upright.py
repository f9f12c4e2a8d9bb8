"""How much of the height of a storey is occupied, to be asked along lines in plan."""

import numpy as np
from numpy.typing import NDArray

from storage.coverage import Coverage
from storage.occupancy import Occupancy
from tasks.surfaces.seen import places_along

FEET, HEADS = 0.3, 0.25
"""What lies less than this above the floor or below the ceiling tells of these, metres."""
LOW_CEILING = 10
"""Percentile of the ceiling's heights that stands for the low ones."""
BITS = 32
"""Bins of the height."""
STEP = 0.2
"""Height of a bin, metres, where the storey is no higher than its bins: a coarse scan has a point
in each bin of a wall, two cubes high."""
BESIDE = 0.05
"""What stands this near to a line stands on it, metres: noise, and a coarse raster."""


class Columns:
    """The columns of space over the plan's cells, each a set of occupied bins of height."""

    def __init__(self, scans: list[Occupancy], coverage: Coverage) -> None:
        cubes = np.concatenate([np.empty((0, 3), np.int32), *(scan.cubes for scan in scans)])
        self._cell = scans[0].cell_m if scans else coverage.cell_m
        middles = (cubes[:, 2] + 0.5) * self._cell
        low, high = _span(middles, coverage)
        self._bins = int(np.clip((high - low) / STEP, 1, BITS))
        within = (middles >= low) & (middles < high)
        level = ((middles[within] - low) / (high - low) * self._bins).astype(np.uint64)
        xy = cubes[within, :2].astype(np.int64)
        self._low = xy.min(axis=0) if len(xy) else np.zeros(2, np.int64)
        shape = xy.max(axis=0) - self._low + 1 if len(xy) else np.ones(2, np.int64)
        self._columns = np.zeros(shape, np.uint32)
        at = tuple((xy - self._low).T)
        np.bitwise_or.at(self._columns, at, np.left_shift(np.uint32(1), level.astype(np.uint32)))

    def share(self, edges: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean share of the height that is occupied along (m, 2, 2) edges, (m,)."""
        places = places_along(edges, self._cell)
        occupied = np.zeros(len(places.edge), np.uint32)
        for step in np.arange(-BESIDE, BESIDE + 1e-9, self._cell / 2):
            occupied |= self._over(places.at + step * places.across)
        return places.mean(np.bitwise_count(occupied) / self._bins)

    def _over(self, xy: NDArray[np.float64]) -> NDArray[np.uint32]:
        """Return the columns over (n, 2) places."""
        at = np.floor(xy / self._cell).astype(np.int64) - self._low
        inside = ((at >= 0) & (at < self._columns.shape)).all(axis=1)
        at = np.where(inside[:, None], at, 0)
        return np.where(inside, self._columns[at[:, 0], at[:, 1]], 0).astype(np.uint32)


def _span(middles: NDArray[np.float64], coverage: Coverage) -> tuple[float, float]:
    """Return the heights between which a wall would stand, metres."""
    ceilings = coverage.ceiling_m[np.isfinite(coverage.ceiling_m)]
    low, high = coverage.floor_level_m, coverage.ceiling_level_m
    if high is not None and len(ceilings):
        high = min(high, float(np.percentile(ceilings, LOW_CEILING)))
    if low is None:
        low = float(middles.min()) if len(middles) else 0.0
    if high is None:
        high = float(middles.max()) if len(middles) else low
    return low + FEET, max(high - HEADS, low + FEET + STEP)
