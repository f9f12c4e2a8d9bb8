"""What a valid plan is, and which rooms of a corrected one are at fault.

A plan is valid where every room is a simple polygon, rooms overlap no more than they did in the
initial model, and between the faces of two neighbours there is a wall: not less of one than there
was or `thinnest` is, and not more than there was or `thickest` is.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from tasks.layout.placement.facing import Facing

OVERLAP_M2 = 1e-4
"""Rounding of polygons that touch, square metres."""
ROUNDING_M = 1e-9


def walls_at_fault(
    facing: Facing, by_m: NDArray[np.float64], thinnest_m: float, thickest_m: float
) -> NDArray[np.bool_]:
    """Return which pairs of faces no longer have a wall between them, (p,).

    Parameters
    ----------
    by_m : (e, 2) float
        How far the ends of each edge move outwards.
    """
    out = by_m.mean(axis=1)
    gap = facing.gap_m - out[facing.a] - out[facing.b]
    least = np.minimum(facing.gap_m, thinnest_m) - ROUNDING_M
    most = np.maximum(facing.gap_m, thickest_m) + ROUNDING_M
    unchanged = np.abs(gap - facing.gap_m) <= ROUNDING_M
    return ~unchanged & ((gap < least) | (gap > most))


def overlaps(
    pieces: Sequence[Polygon], owner: NDArray[np.int64], before_m2: NDArray[np.float64]
) -> list[tuple[int, int, shapely.Geometry]]:
    """Return the pairs of outlines whose rooms overlap by more than before, and where.

    Parameters
    ----------
    pieces : final rooms
    owner : (n,) int
        The outline each room comes from.
    before_m2 : (k, k) float
        By how much the outlines overlapped in the initial model; 0 on the diagonal.
    """
    found = np.array(pieces, object)
    a, b = shapely.STRtree(found).query(found)
    a, b = a[a < b], b[a < b]
    common = shapely.intersection(found[a], found[b])
    over = shapely.area(common) > before_m2[owner[a], owner[b]] + OVERLAP_M2
    return list(zip(owner[a[over]].tolist(), owner[b[over]].tolist(), common[over], strict=True))


def overlap_m2(polygons: Sequence[Polygon]) -> NDArray[np.float64]:
    """Return by how much polygons overlap each other, (k, k), 0 on the diagonal."""
    area = np.zeros((len(polygons), len(polygons)))
    found = np.array(polygons, object)
    a, b = shapely.STRtree(found).query(found)
    a, b = a[a < b], b[a < b]
    area[a, b] = area[b, a] = shapely.area(shapely.intersection(found[a], found[b]))
    return area
