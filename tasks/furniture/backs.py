"""Backs of chairs: thin upright panels that end between seat and shoulder height.

A chair pushed under its table hides its seat; its back stays before the table's edge.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tasks.furniture.columns import Columns
from tasks.furniture.windows import quantile
from tasks.params import Params

REACH = 2
"""Columns between two of one group: far scans leave every second one empty."""
NOISE_M = 0.04
"""What noise adds to the thickness of a panel on each side, metres. Assumption."""


class BackParams(Params):
    """What may be a back. The paper has none: it looks for level segments only."""

    low_m: PositiveFloat = 0.74
    """Least height of its upper edge over the floor, metres: the 5 % quantile of catalogue chairs
    is 0.76 m."""
    high_m: PositiveFloat = 1.2
    """Greatest height of its upper edge, metres: the 95 % quantile is 1.07 m."""
    deep_m: PositiveFloat = 0.28
    """How far down from its edge it must go on, metres: backs are 0.3 to 0.4 m high."""
    filled: PositiveFloat = 0.25
    """Least share of the slices in that part that hold points. Assumption: far scans leave most
    empty."""
    width_m: PositiveFloat = 0.48
    """Usual width, metres: also what touching chairs are told apart by."""
    narrow_m: PositiveFloat = 0.16
    """Least width seen, metres. Assumption."""
    wide_m: PositiveFloat = 0.70
    """Greatest width of one back, metres: the 95 % quantile of catalogue chairs is 0.69 m."""
    thick_m: PositiveFloat = 0.18
    """Greatest thickness of a panel with its noise, metres. Assumption."""
    row: int = 8
    """Most chairs that touch side by side. Assumption."""


@dataclass(frozen=True, eq=False)
class Back:
    """One back."""

    centre: NDArray[np.float64]
    """(2,), metres"""
    axis: NDArray[np.float64]
    """(2,), unit, along its width"""
    width: float
    """metres"""
    top: float
    """metres over the floor"""
    panel: tuple[float, float, float]
    """width and thickness of the whole panel, metres, and the share of its columns that show it"""
    whole: bool
    """whether it was seen in its full width, alone"""
    row: int
    """backs of the same panel, itself included"""


def panel_tops(columns: Columns, params: BackParams) -> NDArray[np.float64]:
    """Return the upper edge over the floor of the panel in each column, metres; NaN if none."""
    edges = _panels(
        columns.counts,
        columns.slice_of(params.low_m),
        columns.slice_of(params.high_m),
        max(1, round(params.deep_m / columns.slice_m)),
        params.filled,
    )
    return np.where(edges < 0, np.nan, columns.height_of(edges.astype(float)))


@numba.njit(cache=True, nogil=True)
def _panels(
    counts: NDArray[np.uint8], low: int, high: int, deep: int, filled: float
) -> NDArray[np.int64]:  # pragma: no cover - compiled
    found = np.full(len(counts), -1)
    for column in range(len(counts)):
        # the highest slice with points and free space above
        for i in range(min(high, counts.shape[1] - 4), low - 1, -1):
            if counts[column, i] == 0:
                continue
            if counts[column, i + 1] or counts[column, i + 2] or counts[column, i + 3]:
                continue
            held = 0
            for j in range(i - deep, i):
                held += counts[column, j] > 0
            if held >= filled * deep:
                found[column] = i
                break
    return found


def groups_of(cells: NDArray[np.int64], reach: int) -> NDArray[np.int64]:
    """Return a number per cell, the same for cells within reach of each other along both axes.

    Parameters
    ----------
    cells : (m, 2) int
        No cell twice.
    """
    if not len(cells):
        return np.empty(0, np.int64)
    low = cells.min(axis=0) - reach
    shape = cells.max(axis=0) - low + reach + 1
    flat = (cells[:, 0] - low[0]) * shape[1] + cells[:, 1] - low[1]
    order = np.argsort(flat)
    pairs = []
    for a in range(reach + 1):
        for b in range(-reach if a else 1, reach + 1):
            wanted = flat + a * shape[1] + b
            at = np.minimum(np.searchsorted(flat, wanted, sorter=order), len(flat) - 1)
            hit = np.flatnonzero(flat[order[at]] == wanted)
            pairs.append(np.stack((hit, order[at[hit]])))
    i, j = np.concatenate(pairs, axis=1)
    graph = coo_array((np.ones(len(i), np.int8), (i, j)), shape=(len(cells), len(cells)))
    found: NDArray[np.int64] = connected_components(graph, directed=False)[1]
    return found


def find_backs(
    columns: Columns, tops: NDArray[np.float64], rows: NDArray[np.int64], params: BackParams
) -> list[Back]:
    """Return the backs among some columns of one room.

    Parameters
    ----------
    tops : (m,) float
        As from `panel_tops`, of the columns to look at.
    rows : (m,) int
        The columns to look at.
    """
    held = ~np.isnan(tops)
    rows, tops = rows[held], tops[held]
    if not len(rows):
        return []
    group = groups_of(columns.cells[rows].astype(np.int64), REACH)
    order = np.argsort(group, kind="stable")
    backs: list[Back] = []
    for part in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
        backs += _of_panel(columns.centres(rows[part]), tops[part], columns.cell_m, params)
    return backs


def _of_panel(
    xy: NDArray[np.float64], tops: NDArray[np.float64], cell: float, params: BackParams
) -> list[Back]:
    if len(xy) < 4:
        return []
    middle = xy.mean(axis=0)
    _, axes = np.linalg.eigh(np.cov((xy - middle).T))
    axis, across = axes[:, 1], axes[:, 0]
    along, off = (xy - middle) @ axis, (xy - middle) @ across
    low, high = quantile(along, 0.02), quantile(along, 0.98)
    width = high - low + cell
    thickness = quantile(off, 0.95) - quantile(off, 0.05) + cell
    if thickness > params.thick_m or width < params.narrow_m:
        return []
    panel = float(width), float(thickness), float(len(xy) * cell**2 / (width * thickness))
    n = 1 if width <= params.wide_m else round(width / params.width_m)
    if n > params.row:
        return []
    unit = width / n
    backs = []
    for i in range(n):
        inside = np.abs(along - (low - cell / 2 + (i + 0.5) * unit)) <= unit / 2
        if not inside.any():
            continue
        centre = middle + (low - cell / 2 + (i + 0.5) * unit) * axis
        centre = centre + quantile(off[inside], 0.5) * across
        top = quantile(tops[inside], 0.8)
        backs.append(Back(centre, axis, unit, top, panel, unit > 0.8 * params.width_m, n))
    return backs
