"""A room cut in two by a partition that is not there."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon
from shapely.geometry.polygon import orient

TRIES = 20
"""Places tried in a room: a niche may be in the way of some."""
JOG_M = 0.3
"""Shorter sides are no walls, metres."""
CROSS = 0.5
"""A side stands across another if it runs along it by less than this share of its length."""
FAR_M = 1e3
"""Beyond every room, metres."""


class Partition(NamedTuple):
    """A partition square on a room's longest side, and what it makes of the room."""

    pieces: tuple[Polygon, Polygon]
    """before it and behind it, in the direction of `along`"""
    faces: tuple[NDArray[np.float64], NDArray[np.float64]]
    """(2, 2) each, the ends of its two faces"""
    along: NDArray[np.float64]
    """(2,), unit, across the partition"""
    at: float
    """centre, metres in that direction from the building frame's origin"""


def place_partition(
    room: Polygon, thickness_m: float, clear_m: float, rng: np.random.Generator
) -> Partition | None:
    """Return a partition at a random place of a room, None where there is no place for one.

    Parameters
    ----------
    clear_m : distance kept from the room's walls that run the same way
    """
    if room.interiors:
        return None
    corners = shapely.get_coordinates(orient(room).exterior)
    steps = np.diff(corners, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    longest = int(lengths.argmax())
    along = steps[longest] / lengths[longest]
    spans = np.sort(np.column_stack([corners[:-1] @ along, corners[1:] @ along]), axis=1)
    walls = spans[(np.abs(steps @ along) < CROSS * lengths) & (lengths >= JOG_M)]
    clear = clear_m + thickness_m / 2
    low, high = spans[longest] + (clear, -clear)
    for at in rng.uniform(low, high, TRIES) if high > low else ():
        if ((at > walls[:, 0] - clear) & (at < walls[:, 1] + clear)).any():
            continue
        partition = _cut(room, along, float(at), thickness_m)
        if partition is not None:
            return partition
    return None


def _cut(
    room: Polygon, along: NDArray[np.float64], at: float, thickness_m: float
) -> Partition | None:
    """Return the partition at a place, None if it does not make two rooms of one."""
    left = np.array([-along[1], along[0]])
    middle = shapely.get_coordinates(room.centroid)[0] @ left
    bounds = (-FAR_M, at - thickness_m / 2, at + thickness_m / 2, FAR_M)

    def line(s: float) -> LineString:
        return LineString([s * along + (middle + t) * left for t in (-FAR_M, FAR_M)])

    parts = []
    for low, high in pairwise(bounds):
        band = Polygon([*line(low).coords, *reversed(line(high).coords)])
        part = room.intersection(band)
        if not isinstance(part, Polygon) or part.is_empty or part.interiors:
            return None
        parts.append(orient(part))
    chords = [room.intersection(line(s)) for s in bounds[1:3]]
    if not all(isinstance(chord, LineString) for chord in chords):
        return None
    ends = [shapely.get_coordinates(chord) for chord in chords]
    return Partition((parts[0], parts[2]), (ends[0], ends[1]), along, at)
