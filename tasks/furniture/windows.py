"""What oriented boxes hold of a raster of columns, compiled: thousands of boxes are asked."""

import numba
import numpy as np
from numpy.typing import NDArray


@numba.njit(cache=True, nogil=True)
def rows_in(
    index: NDArray[np.int32],
    window: tuple[int, int, int, int],
    first: int,
    last: int,
    xy: NDArray[np.float64],
    centre: NDArray[np.float64],
    axis: NDArray[np.float64],
    half: tuple[float, float],
) -> NDArray[np.int64]:  # pragma: no cover - compiled
    """Return the places, counted from `first`, of the columns whose middles a box holds.

    Parameters
    ----------
    index : (a, b) int
        Column of each cell of the raster, -1 for none.
    window : (int, int, int, int)
        The cells to look at: first and past the last along x, then along y.
    first, last : int
        The columns that count.
    xy : (n, 2) float
        Middles of the columns from `first` on, metres.
    axis : (2,) float
        Unit, along the box's length.
    half : (float, float)
        Half of its length and of its depth, metres.
    """
    found = np.empty((window[1] - window[0]) * (window[3] - window[2]), np.int64)
    n = 0
    for a in range(window[0], window[1]):
        for b in range(window[2], window[3]):
            column = index[a, b]
            if column < first or column > last:
                continue
            x = xy[column - first, 0] - centre[0]
            y = xy[column - first, 1] - centre[1]
            along = abs(x * axis[0] + y * axis[1])
            across = abs(y * axis[0] - x * axis[1])
            if along <= half[0] and across <= half[1]:
                found[n] = column - first
                n += 1
    return found[:n].copy()


@numba.njit(cache=True, nogil=True)
def filled_share(
    counts: NDArray[np.uint8], columns: NDArray[np.int64], low: int, high: int
) -> float:  # pragma: no cover - compiled
    """Return the share of the slices [low, high) of some columns that hold points."""
    held = 0
    for column in columns:
        for k in range(low, high):
            held += counts[column, k] > 0
    return held / (len(columns) * (high - low))


@numba.njit(cache=True, nogil=True)
def closed_side(
    counts: NDArray[np.uint8],
    columns: NDArray[np.int64],
    local: NDArray[np.float64],
    half: tuple[float, float],
    rim: float,
    cell: float,
    low: int,
    high: int,
) -> float:  # pragma: no cover - compiled
    """Return how much of the best filled side of a box holds points, by bins of cell and slice.

    Parameters
    ----------
    local : (m, 2) float
        Places of the columns along and across from the box's middle, metres.
    half : (float, float)
        Half of its length and of its depth, metres.
    rim : float
        How far in from a side its points may lie, metres.
    low, high : int
        The slices that count, [low, high).
    """
    best = 0.0
    for side in range(4):
        axis, sign = side // 2, 1.0 - 2.0 * (side % 2)
        other = 1 - axis
        bins = max(1, int(np.ceil(2 * half[other] / cell)))
        held = np.zeros((bins, high - low), np.uint8)
        for i in range(len(columns)):
            if sign * local[i, axis] < half[axis] - rim:
                continue
            at = int((local[i, other] + half[other]) / cell)
            if at < 0 or at >= bins:
                continue
            for k in range(low, high):
                if counts[columns[i], k] > 0:
                    held[at, k - low] = 1
        best = max(best, held.sum() / held.size)
    return best


@numba.njit(cache=True, nogil=True)
def from_edges(
    xy: NDArray[np.float64], edges: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover - compiled
    """Return the distance of each of (n, 2) places from the nearest of (e, 2, 2) edges."""
    found = np.empty(len(xy))
    for i in range(len(xy)):
        best = np.inf
        for e in range(len(edges)):
            ax, ay = edges[e, 0, 0], edges[e, 0, 1]
            dx, dy = edges[e, 1, 0] - ax, edges[e, 1, 1] - ay
            px, py = xy[i, 0] - ax, xy[i, 1] - ay
            length = dx * dx + dy * dy
            t = 0.0
            if length > 0:
                t = min(1.0, max(0.0, (px * dx + py * dy) / length))
            best = min(best, (px - t * dx) ** 2 + (py - t * dy) ** 2)
        found[i] = np.sqrt(best)
    return found


@numba.njit(cache=True, nogil=True)
def quantile(values: NDArray[np.float64], share: float) -> float:  # pragma: no cover - compiled
    """Return a quantile between values, as numpy's: that one costs more than all the rest here."""
    ordered = np.sort(values)
    at = share * (len(ordered) - 1)
    low = int(np.floor(at))
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (at - low) * (ordered[high] - ordered[low])
