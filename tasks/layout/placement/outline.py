"""Rooms' outlines as edges that can be moved, each along its own normal."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

SAME = 1e-7
"""Corners closer than this are one, metres: rounding only."""
MEETS_SINE = np.sin(np.radians(15))
"""Neighbouring edges that turn by less do not define a corner by their intersection."""


@dataclass(frozen=True, eq=False)
class Edges:
    """e edges of k outlines, ring after ring, each edge after the one before: inside is left."""

    shape: NDArray[np.int64]
    """(e,), outline of each edge"""
    ends: NDArray[np.float64]
    """(e, 2, 2)"""
    outward: NDArray[np.float64]
    """(e, 2), unit, away from the room"""

    def __len__(self) -> int:
        return len(self.shape)

    @property
    def middle(self) -> NDArray[np.float64]:
        """(e, 2)."""
        return self.ends.mean(axis=1)

    @property
    def length_m(self) -> NDArray[np.float64]:
        """(e,)."""
        return np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)


def edges_of(polygons: Sequence[Polygon]) -> Edges:
    """Return the edges of outlines, counter-clockwise, holes clockwise."""
    shape, ends = [np.empty(0, np.int64)], [np.empty((0, 2, 2))]
    for number, polygon in enumerate(polygons):
        for ring in _rings(polygon):
            ends.append(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1))
            shape.append(np.full(len(ring), number))
    every = np.concatenate(ends)
    span = every[:, 1] - every[:, 0]
    length = np.maximum(np.linalg.norm(span, axis=1, keepdims=True), SAME)
    return Edges(np.concatenate(shape), every, np.column_stack([span[:, 1], -span[:, 0]]) / length)


def moved(polygon: Polygon, by_m: NDArray[np.float64]) -> Polygon | None:
    """Return a polygon with its edges moved outwards.

    Corners are where neighbouring edges meet. Between edges that run on almost straight a step is
    left, or closed where both come to lie on one line.

    Parameters
    ----------
    by_m : (e, 2) float
        How far the start and the end of each edge move, in the order of `edges_of`.

    Returns
    -------
    Polygon or None
        None where the moves leave no simple polygon, or turn a ring inside out.
    """
    if not by_m.any():
        return shapely.orient_polygons(polygon)
    rings, at = [], 0
    for ring in _rings(polygon):
        new = _moved_ring(ring, by_m[at : at + len(ring)])
        at += len(ring)
        if len(new) < 3 or np.sign(_area(new)) != np.sign(_area(ring)):
            return None
        rings.append(new)
    made = Polygon(rings[0], rings[1:])
    return cleaned(made) if made.is_valid and made.area > 0 else None


def cleaned(polygon: Polygon) -> Polygon:
    """Return a polygon counter-clockwise, without corners on straight sides."""
    shell, *holes = _rings(polygon)
    return Polygon(shell, holes)


def _rings(polygon: Polygon) -> list[NDArray[np.float64]]:
    """Return the rings' corners, (n, 2) each, the first one not repeated."""
    oriented = shapely.orient_polygons(polygon)
    rings = (oriented.exterior, *oriented.interiors)
    return [_corners(shapely.get_coordinates(ring)[:-1]) for ring in rings]


def _corners(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    ring = ring[np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1) > SAME]
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    # how far the corner is from the line of its neighbours
    away = np.abs(cross) / np.maximum(np.linalg.norm(before + after, axis=1), SAME)
    kept = away > SAME
    return ring if kept.all() or kept.sum() < 3 else _corners(ring[kept])


def _area(ring: NDArray[np.float64]) -> float:
    x, y = (ring - ring[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _moved_ring(ring: NDArray[np.float64], by_m: NDArray[np.float64]) -> NDArray[np.float64]:
    span = np.roll(ring, -1, axis=0) - ring
    along = span / np.linalg.norm(span, axis=1, keepdims=True)
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    start = ring + outward * by_m[:, :1]
    end = np.roll(ring, -1, axis=0) + outward * by_m[:, 1:]
    span = end - start
    normal = np.column_stack([span[:, 1], -span[:, 0]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), SAME)
    corners: list[NDArray[np.float64]] = []
    for i, j in enumerate(np.roll(np.arange(len(ring)), 1)):
        turn = normal[j, 0] * normal[i, 1] - normal[j, 1] * normal[i, 0]
        if abs(turn) < MEETS_SINE:
            corners += [end[j], start[i]]
            continue
        offsets = np.array([normal[j] @ start[j], normal[i] @ start[i]])
        corners.append(np.linalg.solve(np.array([normal[j], normal[i]]), offsets))
    return _corners(np.array(corners))
