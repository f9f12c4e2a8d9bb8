"""Rooms side by side: the strips of wall between the faces they turn to each other."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.polygon import orient

OPPOSITE_COS = float(np.cos(np.radians(8)))
"""Faces of one wall look away from each other but for this."""
CROSSED_M = 0.1
"""By how much the faces of one wall may be registered across each other, metres."""
WITHIN_M = 1e-4
"""How far a strip reaches into the rooms beside it, metres: no crack is left where they meet."""


class Strip(NamedTuple):
    """What lies between the facing sides of two rooms."""

    polygon: Polygon
    normal: NDArray[np.float64]
    """(2,), unit, across it"""


class Neighbours(NamedTuple):
    """Two rooms, the lower number first, and all strips between them."""

    a: int
    b: int
    strips: tuple[Strip, ...]


def find_neighbours(
    polygons: Sequence[Polygon], thickest_m: float, shortest_m: float
) -> list[Neighbours]:
    """Return the pairs of rooms with nothing but a wall between them.

    Parameters
    ----------
    thickest_m : a wall is no thicker
    shortest_m : and no shorter on both sides, else they meet in a corner
    """
    edges = [_edges(polygon) for polygon in polygons]
    found = []
    for a, b in combinations(range(len(polygons)), 2):
        if polygons[a].distance(polygons[b]) <= thickest_m:
            strips = _strips(edges[a], edges[b], thickest_m, shortest_m)
            if strips:
                found.append(Neighbours(a, b, strips))
    return found


def corridor_of(polygons: Sequence[Polygon], pairs: Sequence[Neighbours]) -> int:
    """Return the room with most neighbours, of equals the largest; -1 if none has any."""
    count = np.bincount([i for p in pairs for i in (p.a, p.b)], minlength=len(polygons))
    if not count.any():
        return -1
    return int(np.lexsort((shapely.area(np.array(polygons, object)), count))[-1])


def _edges(polygon: Polygon) -> NDArray[np.float64]:
    """Return the sides (e, 2, 2) of an outline, inside to the left."""
    corners = shapely.get_coordinates(orient(polygon).exterior)
    sides = np.stack([corners[:-1], corners[1:]], axis=1)
    return sides[np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1) > 0]


def _strips(
    a: NDArray[np.float64], b: NDArray[np.float64], thickest_m: float, shortest_m: float
) -> tuple[Strip, ...]:
    strips = []
    for start, end in a:
        length = float(np.linalg.norm(end - start))
        along = (end - start) / length
        normal = np.array([along[1], -along[0]])
        steps = b[:, 1] - b[:, 0]
        opposite = steps @ along < -OPPOSITE_COS * np.linalg.norm(steps, axis=1)
        x, y = (b - start) @ along, (b - start) @ normal
        low, high = np.maximum(x[:, 1], 0), np.minimum(x[:, 0], length)
        gap = y.mean(axis=1)
        near = (gap >= -CROSSED_M) & (gap <= thickest_m) & (high - low >= shortest_m)
        for i in np.flatnonzero(opposite & near):
            local = np.array([(s, t) for t in (-WITHIN_M, y[i].max() + WITHIN_M)
                              for s in (low[i], high[i])])[[0, 1, 3, 2]]  # fmt: skip
            corners = start + local[:, :1] * along + local[:, 1:] * normal
            strips.append(Strip(orient(Polygon(corners)), normal))
    return tuple(strips)
