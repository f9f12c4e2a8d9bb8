"""Where floor and ceiling were seen, to be asked along lines."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from storage.coverage import Coverage


class CellSet:
    """Which plan cells were seen, to be asked for many points at once."""

    def __init__(self, cells: NDArray[np.integer], cell: float) -> None:
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


@dataclass(frozen=True, eq=False)
class Places:
    """p places along m edges, each edge's one after another."""

    edge: NDArray[np.int64]
    """(p,), edge of each place"""
    at: NDArray[np.float64]
    """(p, 2), metres"""
    across: NDArray[np.float64]
    """(p, 2), unit, to the left of the edge"""
    counts: NDArray[np.int64]
    """(m,), places of each edge"""

    def mean(self, values: NDArray) -> NDArray[np.float64]:
        """Return the mean over each edge's places, (m,)."""
        return np.bincount(self.edge, values, minlength=len(self.counts)) / self.counts


def places_along(edges: NDArray[np.float64], step: float) -> Places:
    """Return places at most a step apart along (m, 2, 2) edges, one at least on each."""
    spans = edges[:, 1] - edges[:, 0]
    lengths = np.linalg.norm(spans, axis=1)
    counts = np.maximum(1, np.ceil(lengths / step)).astype(int)
    edge = np.repeat(np.arange(len(counts)), counts)
    place = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
    at = edges[edge, 0] + ((place + 0.5) / counts[edge])[:, None] * spans[edge]
    across = np.column_stack((-spans[:, 1], spans[:, 0])) / np.maximum(lengths, 1e-9)[:, None]
    return Places(edge, at, across[edge], counts)


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
