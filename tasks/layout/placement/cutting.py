"""Spurious walls taken out between rooms, missed walls put in."""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from tasks.layout.extraction.model import LineFrame
from tasks.layout.placement.facing import facing_edges
from tasks.layout.placement.outline import cleaned, edges_of

RIM_M = 1e-4
"""How far a wall's area is made to reach into its rooms, so that they join, metres."""


def joined(polygons: Sequence[Polygon], thickest_m: float) -> Polygon | None:
    """Return rooms and the walls between them as one room, None if they do not make one.

    A wall is where two rooms' outlines run back to back, no further than `thickest_m` apart.
    """
    union = shapely.union_all([*polygons, *_walls_between(polygons, thickest_m)])
    if not isinstance(union, Polygon) or len(union.interiors) > sum(
        len(p.interiors) for p in polygons
    ):
        return None
    return cleaned(shapely.simplify(union, 10 * RIM_M))


def cut(
    polygon: Polygon,
    frame: LineFrame,
    at_m: NDArray[np.float64],
    thickness_m: NDArray[np.float64],
    least_m2: float,
) -> list[Polygon] | None:
    """Return a room cut into rooms by walls square on a reference line, in the line's order.

    Parameters
    ----------
    at_m : (k,) float
        Centres of the walls along the line, rising.
    thickness_m : (k,) float
    least_m2 : float
        No room may be smaller.

    Returns
    -------
    list of k + 1 polygons, or None
        None where the walls do not cut it into as many rooms, each in one piece.
    """
    far = 2 * shapely.length(polygon) + frame.length
    low = np.append(-far, at_m + thickness_m / 2)
    high = np.append(at_m - thickness_m / 2, far)
    pieces = []
    for a, b in zip(low, high, strict=True):
        if b <= a:
            return None
        corners = np.array([(a, -far), (b, -far), (b, far), (a, far)])
        strip = Polygon(frame.building(corners))
        piece = shapely.intersection(polygon, strip)
        if not isinstance(piece, Polygon) or piece.area < least_m2:
            return None
        pieces.append(cleaned(piece))
    return pieces


def _walls_between(polygons: Sequence[Polygon], thickest_m: float) -> list[Polygon]:
    """Return the areas between the faces that rooms turn to each other."""
    edges = edges_of(polygons)
    facing = facing_edges(edges, thickest_m)
    walls = []
    for i, j, (low, high) in zip(facing.a, facing.b, facing.common_m, strict=True):
        start, normal = edges.ends[i, 0], edges.outward[i]
        along = np.array([-normal[1], normal[0]])
        depth = float(((edges.ends[j] - start) @ normal).max())
        near, away = -RIM_M, max(depth, 0.0) + RIM_M
        corners = ((low, near), (high, near), (high, away), (low, away))
        walls.append(Polygon([start + s * along + d * normal for s, d in corners]))
    return walls
