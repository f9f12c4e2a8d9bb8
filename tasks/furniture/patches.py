"""Horizontal patches between floor and ceiling: what lies level with nothing right above it."""

import numba
import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat, PositiveInt

from tasks.furniture.columns import Columns
from tasks.params import Params

FREE_SLICES = 3
"""Slices that are empty above a surface: a wall's points have no such gaps."""
THICK_SLICES = 4
"""Slices that a level surface's points lie in, their noise included."""

NEAR = tuple((a, b) for a in range(3) for b in range(-2, 3) if (a, b) > (0, 0))
"""Neighbours of a column, of two opposite ones one: far scans leave every second column empty."""


class PatchParams(Params):
    """Which patches may be furniture."""

    low_m: PositiveFloat = 0.3
    """Least height over the floor, metres. Sec. 6 drops what lies lower than `gamma_fur` = 0.7 m,
    which would be every seat."""
    step_m: PositiveFloat = 0.035
    """Greatest step between neighbouring columns of one patch, metres: under two slices.
    Assumption."""
    points: PositiveInt = 1
    """Least points of a patch in a column. Assumption."""
    area_m2: PositiveFloat = 0.02
    """Least area of a patch, m2: the strip that is seen of a chair under its table. Assumption."""


def upper_surfaces(
    columns: Columns, params: PatchParams
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return column and height over the floor, metres, of all that has free space above.

    In the order of the columns, in each the highest first.
    """
    where, slices = _uppers(columns.counts, columns.slice_of(params.low_m), params.points)
    return where, columns.height_of(slices)


def find_patches(
    columns: Columns, where: NDArray[np.int64], heights: NDArray[np.float64], params: PatchParams
) -> list[NDArray[np.int64]]:
    """Return the surfaces of each patch, patches of too small an area left out.

    Parameters
    ----------
    where : (m,) int
        Column of each surface, in rising order.
    heights : (m,) float
        Height of each over the floor, metres.
    """
    patch = _join(columns.index, columns.cells, columns.rooms, where, heights, params.step_m)
    order = np.argsort(patch, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(patch[order])) + 1) if len(order) else []
    return [part for part in parts if len(part) * columns.cell_m**2 >= params.area_m2]


@numba.njit(cache=True, nogil=True)
def _uppers(
    counts: NDArray[np.uint8], low: int, least: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:  # pragma: no cover - compiled
    """Return columns and mean slices of all surfaces with free space above, column by column."""
    n, k = counts.shape
    where = np.empty(1024, np.int64)
    found = np.empty(1024)
    m = 0
    for column in range(n):
        free = FREE_SLICES  # nothing is known above the columns
        i = k - 1
        while i >= low:
            if counts[column, i] == 0:
                free += 1
                i -= 1
                continue
            if free < FREE_SLICES:
                free = 0
                i -= 1
                continue
            total, moment = 0.0, 0.0
            for j in range(i, max(i - THICK_SLICES, -1), -1):
                total += counts[column, j]
                moment += j * counts[column, j]
            if total >= least:
                if m == len(where):
                    where = np.concatenate((where, np.empty(m, np.int64)))
                    found = np.concatenate((found, np.empty(m)))
                where[m] = column
                found[m] = moment / total
                m += 1
                free = 0
                i -= THICK_SLICES
            else:  # a stray point: what is under it may still be free
                free += 1
                i -= 1
    return where[:m], found[:m]


@numba.njit(cache=True, nogil=True)
def _root(parents: NDArray[np.int64], i: int) -> int:  # pragma: no cover - compiled
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i


@numba.njit(cache=True, nogil=True)
def _join(
    index: NDArray[np.int32],
    cells: NDArray[np.int32],
    rooms: NDArray[np.int32],
    where: NDArray[np.int64],
    heights: NDArray[np.float64],
    step: float,
) -> NDArray[np.int64]:  # pragma: no cover - compiled
    """Return one number per patch: surfaces of neighbouring columns of nearly one height."""
    first = np.full(len(cells) + 1, 0, np.int64)
    for i in range(len(where)):
        first[where[i] + 1] += 1
    for i in range(len(cells)):
        first[i + 1] += first[i]
    parents = np.arange(len(where))
    for i in range(len(where)):
        a, b = cells[where[i], 0], cells[where[i], 1]
        for da, db in NEAR:
            if a + da >= index.shape[0] or b + db < 0 or b + db >= index.shape[1]:
                continue
            other = index[a + da, b + db]
            if other < 0 or rooms[other] != rooms[where[i]]:
                continue
            for j in range(first[other], first[other + 1]):
                if abs(heights[i] - heights[j]) <= step:
                    p, q = _root(parents, i), _root(parents, j)
                    parents[max(p, q)] = min(p, q)
    for i in range(len(where)):
        parents[i] = _root(parents, i)
    return parents
