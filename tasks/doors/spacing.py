"""How densely a storey was scanned: what is finer than its points cannot be seen in them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from storage.points import PointCloud
from tasks.doors.voxels import MOST_POINTS, count_points

CELL_M = 0.4
"""Edge of the cells points are counted in, metres: a piece of a wall or floor each, with what
stands at it."""
FINEST_M = CELL_M / MOST_POINTS**0.5
"""Spacings below this, metres, are taken for it: a cell's count ends there."""


def spacing_m(
    clouds: Sequence[PointCloud], low: NDArray[np.float64], high: NDArray[np.float64]
) -> float:
    """Return the distance of neighbouring points of all clouds together, at least FINEST_M.

    A surface through a cell has one point in each square of that edge. Half of the points lie in
    cells as densely filled as this, or more densely.

    Parameters
    ----------
    clouds : sequence of PointCloud
    low, high : (3,) float
        Corners of the box that is looked at, building frame, metres. Without any point in it the
        spacing is FINEST_M.
    """
    cells = np.floor((high - low) / CELL_M).astype(np.int64) + 1
    counts = np.zeros(tuple(cells), np.uint8)
    for cloud in clouds:
        count_points(cloud.xyz, cloud.origin - low, 1 / CELL_M, counts)
    filled = np.sort(counts[counts > 0]).astype(float)
    if not len(filled):
        return FINEST_M
    points = np.cumsum(filled)
    return float(CELL_M / np.sqrt(filled[np.searchsorted(points, points[-1] / 2)]))
