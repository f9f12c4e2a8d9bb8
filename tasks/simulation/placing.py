"""Where groups of furniture are tried in a room: along its walls, in the open, on a grid."""

from collections.abc import Callable, Iterator

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from tasks.simulation.furniture import BEHIND_M, Corners, Group, turned

TRIALS, SAME = 40, 5
"""Places tried before the room goes without a group, and how many of them with the same group."""
P_SNUG = 0.3
"""Share of pieces at a wall that are tried in a corner. Assumption."""
P_ALONG, P_AXIAL = 0.7, 0.5
"""Shares of groups in the open that are tried along the longest wall, and on the middle line along
it. Assumption."""

Place = Callable[[Corners], Corners]
"""From a group's frame to the building's"""
Maker = Callable[[np.random.Generator], Group]
Places = Callable[[Maker, Polygon, np.random.Generator], Iterator[tuple[Place, Group]]]
Vector = NDArray[np.float64]
"""(2,), metres"""


def along_walls(
    make: Maker, room: Polygon, rng: np.random.Generator
) -> Iterator[tuple[Place, Group]]:
    """Yield places with the group's back to a wall drawn by length."""
    starts, ends = _sides(room)
    lengths = np.linalg.norm(ends - starts, axis=1)
    walls = rng.choice(len(lengths), TRIALS, p=lengths / lengths.sum())
    for trial, i in enumerate(walls):
        if trial % SAME == 0:
            group = make(rng)
        slack = lengths[i] - (group.high[0] - group.low[0]) - 2 * BEHIND_M
        if slack < 0:
            continue
        share = float(rng.integers(2)) if rng.uniform() < P_SNUG else rng.uniform()
        along = (ends[i] - starts[i]) / lengths[i]
        at = starts[i] + (BEHIND_M + share * slack - group.low[0]) * along
        yield _place(np.arctan2(along[1], along[0]), at), group


def in_the_open(
    make: Maker, room: Polygon, rng: np.random.Generator
) -> Iterator[tuple[Place, Group]]:
    """Yield places anywhere in the room, along or across its longest wall."""
    angle, low, high = _frame(room)
    for trial in range(TRIALS):
        if trial % SAME == 0:
            group = make(rng)
        if rng.uniform() > P_ALONG:
            group = turned(group)
        (x0, y0), (x1, y1) = group.low, group.high
        slack = np.maximum(high - low - (x1 - x0, y1 - y0), 0.0)
        share = rng.uniform(size=2)
        if rng.uniform() < P_AXIAL:
            share[1] = 0.5
        at = low + share * slack - (x0, y0)
        yield _place(angle, _place(angle, np.zeros(2))(at)), group


def on_grid(make: Maker, room: Polygon, rng: np.random.Generator) -> Iterator[tuple[Place, Group]]:
    """Yield the fields of a grid along the room's longest wall in any order, as many as fit."""
    angle, low, high = _frame(room)
    low, high = low + BEHIND_M, high - BEHIND_M
    first = make(rng)
    size = np.maximum(np.subtract(first.high, first.low), first.pitch_m)
    counts = np.maximum((high - low) // size, 1).astype(int)
    steps = (high - low) / counts
    for field in rng.permutation(counts.prod()):
        group = make(rng)
        slack = steps - np.subtract(group.high, group.low)
        start = low + np.array(divmod(int(field), int(counts[1]))) * steps - group.low
        # what has a pitch keeps to it; the rest may make way for a door, across the longest wall
        for share in (0.5,) if group.pitch_m else (0.5, 0.0, 1.0):
            at = start + slack * (0.5, share)
            yield _place(angle, _place(angle, np.zeros(2))(at)), group


def extent(room: Polygon) -> tuple[float, float]:
    """Return a room's extent along its longest wall and across it, metres."""
    _, low, high = _frame(room)
    return float(high[0] - low[0]), float(high[1] - low[1])


def _place(angle: float, at: Vector) -> Place:
    cosine, sine = np.cos(angle), np.sin(angle)
    transposed = np.array([(cosine, sine), (-sine, cosine)])
    return lambda corners: corners @ transposed + at


def _frame(room: Polygon) -> tuple[float, Vector, Vector]:
    """Return the direction of the longest wall, and the extent in a frame along it."""
    starts, ends = _sides(room)
    along = (ends - starts)[np.argmax(np.linalg.norm(ends - starts, axis=1))]
    angle = float(np.arctan2(along[1], along[0]))
    corners = _place(-angle, np.zeros(2))(shapely.get_coordinates(room))
    return angle, corners.min(axis=0), corners.max(axis=0)


def _sides(room: Polygon) -> tuple[Corners, Corners]:
    """Return starts and ends of all walls, the room on the left."""
    oriented = shapely.orient_polygons(room)
    rings = [np.array(ring.coords) for ring in (oriented.exterior, *oriented.interiors)]
    return np.concatenate([r[:-1] for r in rings]), np.concatenate([r[1:] for r in rings])
