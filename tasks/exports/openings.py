"""How doors and windows are drawn: leaf and swing, panes."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Point

from storage.plan import Plan, PlanOpening
from tasks.exports.poche import opening_depth

Line = NDArray[np.float64]
"""(n, 2), metres"""

SWING_RAD = {"open": np.pi / 2, "ajar": np.pi / 6, "shut": 0.0}
"""How far a leaf is drawn open by the door's state; a state not known is drawn as open."""


@dataclass(frozen=True, eq=False)
class Door:
    """The lines of one door."""

    leaf: Line
    """(2, 2), from the hinge to the leaf's edge, metres"""
    swing: Line
    """(n, 2), the way of the leaf's edge from shut, metres; n is 0 for a shut door"""
    certain: bool
    """whether the state is known"""


def door_lines(plan: Plan, door: PlanOpening) -> Door:
    """Return leaf and swing of a door, turning into the smaller of its rooms."""
    hinge, latch, into = _hang(plan, door)
    width = np.linalg.norm(latch - hinge)
    along = (latch - hinge) / width
    angle = SWING_RAD.get(door.state or "", np.pi / 2)
    turn = np.linspace(0, angle, 25 if angle else 0)[:, None]
    edge = hinge + width * (np.cos(angle) * along + np.sin(angle) * into)
    swing = hinge + width * (np.cos(turn) * along + np.sin(turn) * into)
    return Door(np.array((hinge, edge)), swing, door.state in SWING_RAD)


def window_lines(plan: Plan, window: PlanOpening) -> list[Line]:
    """Return both faces and the two panes of a window, as lines along it."""
    start, end = _ends(window.line)
    normal = _left(start, end) * opening_depth(plan, window) / 2
    return [np.array((start + f * normal, end + f * normal)) for f in (-1.0, -0.2, 0.2, 1.0)]


def _hang(plan: Plan, door: PlanOpening) -> tuple[Line, Line, Line]:
    """Return the hinge and the latch on the wall's face, and the unit vector into the room."""
    start, end = _ends(door.line)
    into = _left(start, end)
    depth = opening_depth(plan, door)
    rooms = sorted((r for r in plan.rooms if r.id in door.rooms), key=lambda r: r.polygon.area)
    if not rooms:
        return start + into * depth / 2, end + into * depth / 2, into
    room = rooms[0].polygon
    probe = (start + end) / 2 + into * (depth / 2 + 0.1)
    into = into if room.distance(Point(probe)) == 0 else -into
    faces = start + into * depth / 2, end + into * depth / 2
    # a leaf opens against the nearer side wall
    corners = shapely.MultiPoint(shapely.get_coordinates(room))
    hinge, latch = sorted(faces, key=lambda face: Point(face).distance(corners))
    return hinge, latch, into


def _ends(line: LineString) -> tuple[Line, Line]:
    ends = shapely.get_coordinates(line)
    return ends[0], ends[-1]


def _left(start: Line, end: Line) -> Line:
    x, y = (end - start) / np.linalg.norm(end - start)
    return np.array((-y, x))
