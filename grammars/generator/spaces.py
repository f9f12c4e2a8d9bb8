"""The space that rules cut into the rooms along a line: what encloses a row of rooms."""

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from grammars.model import Point

STRAIGHT_M = 0.05
"""Faces no further off a straight line lie on it: plans are drawn to centimetres."""
APART_M = 2.0
"""Two points of a wall tell its slope from this distance on, metres."""

TURNED = 0.1
"""Rise of the rear along the line, at most. Assumption: six degrees."""

Corners = tuple[Point, Point, Point, Point]


def space_of(
    edge: NDArray[np.float64],
    front_m: NDArray[np.float64],
    rear: NDArray[np.float64],
    ends_m: tuple[float, float],
    slants: tuple[float, float],
) -> Corners | None:
    """Return the corners of a row: at the line from start to end, then at the rear, back again.

    Parameters
    ----------
    edge : (2, 2) float
        Start and end of the line.
    front_m : (r,) float
        Faces that the rooms turn to the line, to its left.
    rear : (k, 2) float
        Points of the rooms' rear faces, along the line and to its left.
    ends_m : where the outer faces of the first and last room, followed to the line, meet it
    slants : of these faces, metres along the line for each to its left

    Returns
    -------
    None
        Where fronts or rears of less than half of the rooms lie on one straight wall.

    Notes
    -----
    The rear is the line of the median slope between points (Theil and Sen) through their median.
    """
    front = float(np.median(front_m))
    slope = _slope(rear)
    back = float(np.median(rear[:, 1] - slope * rear[:, 0]))
    off = rear[:, 1] - slope * rear[:, 0] - back, front_m - front
    if abs(slope) > TURNED or any(np.mean(np.abs(some) <= STRAIGHT_M) < 0.5 for some in off):
        return None
    along = (edge[1] - edge[0]) / np.linalg.norm(edge[1] - edge[0])
    left = np.array((-along[1], along[0]))
    local = [(x + slant * front, front) for x, slant in zip(ends_m, slants, strict=True)]
    for x, slant in reversed(list(zip(ends_m, slants, strict=True))):
        y = (back + slope * x) / (1 - slope * slant)
        local.append((x + slant * y, y))
    ring = edge[0] + np.array(local) @ np.array((along, left))
    outline = Polygon(ring)
    if not (outline.is_valid and outline.exterior.is_ccw):
        return None
    a, b, c, d = ((float(x), float(y)) for x, y in ring)
    return a, b, c, d


def _slope(points: NDArray[np.float64]) -> float:
    i, j = np.triu_indices(len(points), 1)
    step = points[j] - points[i]
    far = np.abs(step[:, 0]) >= APART_M
    return float(np.median(step[far, 1] / step[far, 0])) if far.any() else 0.0
