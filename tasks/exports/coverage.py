"""What the scans saw of the floor, as areas beneath the plan."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry


@dataclass(frozen=True, eq=False)
class Coverage:
    """What the scans saw of the floor: k square cells."""

    cells_xy: NDArray[np.float64]
    """(k, 2), centres, metres"""
    cell_m: float
    """side of a cell, metres"""
    scans: NDArray[np.int64]
    """(k,), scans that saw the cell"""


def seen_area(coverage: Coverage, least: int) -> BaseGeometry:
    """Return the area seen by a number of scans or more."""
    half = coverage.cell_m / 2
    x, y = coverage.cells_xy[coverage.scans >= least].T
    # one area: no seams between cells, a small file
    return shapely.union_all(shapely.box(x - half, y - half, x + half, y + half), grid_size=1e-3)


def unseen_area(coverage: Coverage, floor: BaseGeometry) -> BaseGeometry:
    """Return the part of the floor that no scan saw, without slivers narrower than a cell."""
    half = coverage.cell_m / 2
    unseen = floor.difference(seen_area(coverage, 1))
    return unseen.buffer(-half, join_style="mitre").buffer(half, join_style="mitre")
