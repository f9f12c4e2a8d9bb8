"""Outlines drawn anew along some of their walls.

A measured room, a corridor above all, has doorways, niches and jogs along its walls; moved edge by
edge they cross each other. Here a room is filled up to a wall, and what lies behind is taken away.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from tasks.layout.extraction.model import LineFrame
from tasks.layout.placement.outline import cleaned

DOORWAY_M = 1.5
"""Stretches of a wall with no greater gap between them are one, metres: a double door."""
CORNER_M = 1.0
"""A stretch that ends no further from the wall's end reaches up to it, metres."""
THREAD_M = 1e-3
"""What is thinner than twice this is no part of a room, metres."""
HOLE_M2 = 0.2
"""A smaller hole is none: what is left of a pillar at a wall."""


class Face(NamedTuple):
    """Where a wall's face is to be, the room to its left, and the measured edges on it."""

    ends: NDArray[np.float64]
    """(2, 2)"""
    edges: NDArray[np.float64]
    """(e, 2, 2)"""
    before_m: float
    behind_m: float
    """how far off the wall an edge may have been measured, before and behind it"""
    whole: bool = False
    """whether the room has the wall as a whole, up to `ends`"""
    around_m: float = 0.0
    """how far beyond its edges the room is filled, metres: around corners that move outwards, up to
    the wall that comes next there"""


def redrawn(polygon: Polygon, faces: Sequence[Face]) -> Polygon | None:
    """Return an outline with the measured stretches of some walls drawn where their faces are.

    Returns
    -------
    Polygon or None
        None where no simple outline is left, or one with other holes.
    """
    inside: list[Polygon] = []
    outside: list[Polygon] = []
    around: list[Polygon] = []
    beyond: list[Polygon] = []
    for face in faces:
        frame, reach = LineFrame.between(*face.ends), face.around_m
        for low, high in _stretches(frame, face):
            if face.before_m > 0:
                inside.append(_strip(frame, low, high, face.before_m))
            if face.behind_m > 0:
                outside.append(_strip(frame, low, high, -face.behind_m))
            if reach > 0 and face.before_m > 0:
                around.append(_strip(frame, low - reach, low, face.before_m))
                around.append(_strip(frame, high, high + reach, face.before_m))
            if reach > 0:
                beyond.append(_strip(frame, low - reach, high + reach, -face.behind_m - reach))
    corners = shapely.difference(shapely.union_all(around), shapely.union_all(beyond))
    filled = shapely.union_all([polygon, *inside, corners])
    whole = shapely.difference(filled, shapely.union_all(outside))
    opened = shapely.buffer(
        shapely.buffer(whole, -THREAD_M, join_style="mitre"), THREAD_M, join_style="mitre"
    )
    parts = [p for p in shapely.get_parts(opened) if isinstance(p, Polygon)]
    if not parts:
        return None
    found = max(parts, key=lambda part: part.area)
    found = Polygon(found.exterior, [h for h in found.interiors if Polygon(h).area > HOLE_M2])
    if len(found.interiors) != len(polygon.interiors) or not found.is_valid:
        return None
    return cleaned(shapely.simplify(found, THREAD_M))


def _strip(frame: LineFrame, low: float, high: float, depth: float) -> Polygon:
    """Return the rectangle along a wall that reaches so far before it, or behind it."""
    return Polygon(frame.building(np.array([(low, 0), (high, 0), (high, depth), (low, depth)])))


def _stretches(frame: LineFrame, face: Face) -> list[tuple[float, float]]:
    """Return from where to where along a wall edges were measured, doorways bridged."""
    spans = np.sort(frame.local(face.edges)[..., 0], axis=1)
    if face.whole:
        spans = np.clip(spans, 0.0, frame.length)
    found: list[tuple[float, float]] = []
    for low, high in spans[np.argsort(spans[:, 0])].tolist():
        if found and low - found[-1][1] <= DOORWAY_M:
            found[-1] = found[-1][0], max(high, found[-1][1])
        else:
            found.append((low, high))
    if not face.whole:
        return found
    reach = [(low if low > CORNER_M else 0.0, high) for low, high in found]
    long = frame.length - CORNER_M
    return [(low, high if high < long else frame.length) for low, high in reach]
