"""Where a scan's points lie, plane or no plane: the evidence for walls no plane was found on."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat

from storage.occupancy import Occupancy
from storage.points import PointCloud
from tasks.params import Params

MOST_CELLS = 1 << 27
"""Cubes of a box that are marked one by one; those of a larger box, with far points, are sorted."""
ROWS = 1 << 20
"""Points at a time."""


class OccupancyParams(Params):
    """Parameters of the occupied space."""

    cell_m: PositiveFloat = 0.1
    """Edge of the cubes, metres: the spacing of the sparsest clouds mapped. Not in the paper."""


def occupied_space(points: PointCloud, params: OccupancyParams) -> Occupancy:
    """Return the cubes of the building frame that hold a point."""
    if not len(points):
        return Occupancy(np.empty((0, 3), np.int32), params.cell_m)
    ends = np.stack([points.xyz.min(axis=0), points.xyz.max(axis=0)]).astype(np.float64)
    low, high = np.floor((ends + points.origin) / params.cell_m).astype(np.int64)
    shape = high - low + 1
    if np.prod(shape.astype(float)) <= MOST_CELLS:
        marked = np.zeros(shape, bool)
        for cubes in _cubes(points, params.cell_m):
            at = np.clip(cubes - low, 0, shape - 1)
            marked[at[:, 0], at[:, 1], at[:, 2]] = True
        found = np.argwhere(marked) + low
    else:
        parts = [np.unique(cubes, axis=0) for cubes in _cubes(points, params.cell_m)]
        found = np.unique(np.concatenate(parts), axis=0)
    return Occupancy(found.astype(np.int32), params.cell_m)


def _cubes(points: PointCloud, cell: float) -> Iterator[NDArray[np.int64]]:
    """Yield the cubes of the points, some at a time."""
    for start in range(0, len(points), ROWS):
        part = points.xyz[start : start + ROWS] + points.origin
        yield np.floor(part / cell).astype(np.int64)
