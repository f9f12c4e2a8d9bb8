"""Touching pieces told apart: the grid of standard sizes, and of supports, that fits a top best."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat

from tasks.furniture.boxes import Box
from tasks.params import Params

SMALL_M2 = 0.84
"""Area under which touching tables are unlikely, square metres: 1.2 x 0.7 m."""


class SplitParams(Params):
    """When one top is several tables. Assumptions."""

    size_sigma_m: PositiveFloat = 0.04
    """How far a table's side is measured off its real one, metres."""
    unknown: PositiveFloat = 3.0
    """What a table of no standard size costs, in squared deviations."""
    each: PositiveFloat = 0.35
    """What each further table costs."""
    small: PositiveFloat = 6.0
    """What tables cost that are small and touch, by how much they are smaller than a desk."""
    crosswise: PositiveFloat = 0.7
    """What it costs that tables stand crosswise to their row."""
    support: PositiveFloat = 1.5
    """Most that supports under a joint are worth."""
    deep_m: PositiveFloat = 1.25
    """Depth over which one table of no standard size is unlikely, metres: an arm's reach from
    both sides."""
    most: int = 8
    """Most tables along one side."""


def split_grid(
    size: tuple[float, float],
    supports: NDArray[np.float64],
    standard: NDArray[np.float64],
    params: SplitParams,
) -> tuple[int, int]:
    """Return into how many tables a top is to be split, along and across.

    Parameters
    ----------
    size : (float, float)
        Length and depth of the top, metres.
    supports : (m, 2) float
        Places of legs and side panels seen below it, along and across from its middle, metres.
    standard : (k, 2) float
        Length and depth of standard tables, metres.
    """
    best, found = np.inf, (1, 1)
    for n in range(1, params.most + 1):
        for m in range(1, params.most + 1):
            unit = np.array((size[0] / n, size[1] / m))
            if n * m > 1 and unit.min() < standard.min() - 2 * params.size_sigma_m:
                continue
            cost = _cost(unit, n, m, standard, params) + params.each * (n * m - 1) ** 0.5
            cost += params.crosswise * (n * m > 1 and unit[0] < unit[1] - 2 * params.size_sigma_m)
            cost -= _at_joints(supports[:, 0], size[0], n, params.support)
            cost -= _at_joints(supports[:, 1], size[1], m, params.support)
            if cost < best - 1e-9:
                best, found = cost, (n, m)
    return found


def _cost(
    unit: NDArray[np.float64], n: int, m: int, standard: NDArray[np.float64], params: SplitParams
) -> float:
    """Return how far a table is off the nearest standard size, in squared deviations."""
    # the more tables a joint length is divided by, the better each one's side is known
    sigma = params.size_sigma_m / np.sqrt((n, m)) + 0.01
    off = np.minimum(
        (((standard - unit) / sigma) ** 2).sum(axis=1),
        (((standard - unit[::-1]) / sigma[::-1]) ** 2).sum(axis=1),
    )
    if n * m > 1:
        off = off + params.small * np.clip(1 - standard.prod(axis=1) / SMALL_M2, 0, 1)
    unknown = params.unknown * (1.0 if unit.min() <= params.deep_m else 3.0)
    # several equal tables that are all of an unusual size are unlikelier still
    return float(min(off.min(), unknown * (1.0 if n * m == 1 else 2.0)))


def _at_joints(at: NDArray[np.float64], size: float, n: int, most: float) -> float:
    """Return how much more of the supports lie at the inner joints than between them."""
    if n == 1 or len(at) < 20:
        return 0.0
    joints = (np.arange(1, n) / n - 0.5) * size
    inner = np.abs(at) < size / 2 - 0.1
    near = (np.abs(at[inner, None] - joints).min(axis=1) <= 0.06).sum() / max((n - 1) * 0.12, 1e-9)
    rest = inner.sum() / max(size - 0.2, 1e-9)
    ratio = (near + 1.0) / (rest + 1.0)
    return float(np.clip(np.log(ratio), -most, most))


class RunParams(Params):
    """When a run of cabinets, cupboards or shelves is several. Assumptions."""

    size_sigma_m: PositiveFloat = 0.05
    """How far the length of a run is measured off its real one, metres."""
    unknown: PositiveFloat = 4.0
    """What a single piece of no standard width costs, in squared deviations."""
    each: PositiveFloat = 0.1
    """What each further piece costs."""
    most: int = 8
    """Most pieces of a run."""


def split_run(length_m: float, widths_m: Sequence[float], params: RunParams) -> int:
    """Return how many equal pieces of a standard width a run most likely is; the fewest of equals.

    Parameters
    ----------
    widths_m : usual widths of one piece, metres
    """
    best, found = params.unknown, 1
    for n in range(1, params.most + 1):
        off = min(abs(length_m - n * width) for width in widths_m)
        cost = (off / params.size_sigma_m) ** 2 + params.each * (n - 1)
        if cost < best - 1e-9:
            best, found = cost, n
    return found


def pieces(box: Box, grid: tuple[int, int]) -> list[Box]:
    """Return a box's parts on a grid."""
    unit = np.array((box.length / grid[0], box.depth / grid[1]))
    low = -np.array((box.length, box.depth)) / 2
    return [
        box.part(low + np.array((i, j)) * unit, low + np.array((i + 1, j + 1)) * unit)
        for i in range(grid[0])
        for j in range(grid[1])
    ]
