"""Where floor and ceiling were seen, to be asked along lines."""

import numpy as np
from numpy.typing import NDArray

from storage.coverage import Coverage


class CellSet:
    """Which plan cells were seen, to be asked for many points at once."""

    def __init__(self, cells: NDArray[np.int32], cell: float) -> None:
        self.cell = cell
        self.low = cells.min(axis=0) if len(cells) else np.zeros(2, int)
        shape = cells.max(axis=0) - self.low + 1 if len(cells) else np.ones(2, int)
        self.grid = np.zeros(shape, bool)
        at = cells - self.low
        self.grid[at[:, 0], at[:, 1]] = True

    def holds(self, xy: NDArray[np.float64]) -> NDArray[np.bool_]:
        at = np.floor(xy / self.cell).astype(int) - self.low
        inside = ((at >= 0) & (at < self.grid.shape)).all(axis=-1)
        at = np.where(inside[..., None], at, 0)
        return inside & self.grid[at[..., 0], at[..., 1]]


class Seen:
    """Where floor, ceiling and either of them were seen."""

    def __init__(self, coverage: Coverage) -> None:
        floor, ceiling = np.isfinite(coverage.floor_m), np.isfinite(coverage.ceiling_m)
        self.either = CellSet(coverage.cells, coverage.cell_m)
        self.floor = CellSet(coverage.cells[floor], coverage.cell_m)
        self.ceiling = CellSet(coverage.cells[ceiling], coverage.cell_m)


def steps(line: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Return places along a line about a step apart, as shares of its length."""
    count = max(1, int(np.ceil(np.linalg.norm(line[1] - line[0]) / step)))
    return (np.arange(count) + 0.5) / count


def through(
    line: NDArray[np.float64],
    normal: NDArray[np.float64],
    shares: NDArray[np.float64],
    seen: CellSet,
) -> NDArray[np.bool_]:
    """Return whether the cells on both sides of each place along a line were seen."""
    flat = normal / np.linalg.norm(normal) * 1.5 * seen.cell
    along = line[0] + shares[:, None] * (line[1] - line[0])
    return seen.holds(along + flat) & seen.holds(along - flat)
