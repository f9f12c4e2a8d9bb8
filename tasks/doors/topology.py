"""Doors link rooms: which two, and what a room that nobody could enter says about its walls."""

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat
from shapely import STRtree

from storage.rooms import Rooms
from storage.walls import Walls
from tasks.geometry import unit_axes
from tasks.params import Params

NO_ROOM = -1


class TopologyParams(Params):
    """What is asked of the doors of a storey as a whole."""

    reach_m: PositiveFloat = 0.8
    """How far beyond its wall's centre line a door's room is looked for, metres, where the wall
    piece does not name it: the wall was drawn from one side. Assumption."""
    step_m: PositiveFloat = 0.1
    """Between the places looked at, metres. Assumption."""
    only_door_p: float = Field(default=0.15, ge=0, le=1)
    """A room without a door gets its most probable one if it is at least this probable; 1 asks
    nothing of rooms. Assumption."""
    second_door_p: float = Field(default=0.6, ge=0, le=1)
    """Two rooms that a door links have another only if it is at least this probable: of simulated
    storeys one pair in twenty has. 0 asks nothing. Not in the paper. Assumption."""


def rooms_beside(
    lines: NDArray[np.float64],
    on_walls: NDArray[np.int32],
    walls: Walls,
    rooms: Rooms,
    params: TopologyParams,
) -> NDArray[np.int32]:
    """Return the rooms on either side of openings, (n, 2), the lesser first, -1 for none.

    A wall piece's own rooms where it has two; else the room met first on its other side.
    """
    if not len(lines):
        return np.empty((0, 2), np.int32)
    middles = lines.mean(axis=1)
    axes = unit_axes(lines)
    normals = np.column_stack([-axes[:, 1], axes[:, 0]])
    both = np.column_stack([_met(middles, side * normals, rooms, params) for side in (1.0, -1.0)])
    named = walls.rooms[on_walls]
    whole = np.min(named, axis=1) >= 0
    found = np.where(whole[:, None], named, both)
    # the room of a wall seen from one side stays, whatever was met
    alone = ~whole & (named[:, 0] >= 0) & ~(found == named[:, :1]).any(axis=1)
    missing = np.argmin(found, axis=1)
    found[alone, missing[alone]] = named[alone, 0]
    found[found[:, 0] == found[:, 1], 1] = NO_ROOM
    least, most = found.min(axis=1), found.max(axis=1)
    ordered = [np.where(least < 0, most, least), np.where(least < 0, least, most)]
    return np.column_stack(ordered).astype(np.int32)


def _met(
    places: NDArray[np.float64],
    directions: NDArray[np.float64],
    rooms: Rooms,
    params: TopologyParams,
) -> NDArray[np.int64]:
    """Return the room met first from each place, (n,)."""
    found = np.full(len(places), NO_ROOM)
    tree = STRtree(rooms.polygons)
    for away in np.arange(params.step_m, params.reach_m + params.step_m / 2, params.step_m):
        points = shapely.points(places + away * directions)
        place, room = tree.query(points, predicate="within")
        first = found[place] == NO_ROOM
        found[place[first]] = room[first]
    return found


def doors_of_rooms(
    linked: NDArray[np.int32],
    confidences: NDArray[np.float64],
    door_p: float,
    n_rooms: int,
    params: TopologyParams,
) -> NDArray[np.bool_]:
    """Return which openings are doors, (n,), by what they link: every room has a door, few have two
    to the same neighbour.

    Parameters
    ----------
    linked : (n, 2) int
        Rooms of each, -1 for none, as of `rooms_beside`.
    confidences : (n,) float
        Probability of each to be a door.
    door_p : float
        Least probability of a door of which rooms say nothing.

    Notes
    -----
    The most probable first: each is judged by the doors found before it.
    """
    taken = np.zeros(len(linked), bool)
    has_door = np.zeros(n_rooms, bool)
    joined: set[tuple[int, ...]] = set()
    for i in np.argsort(-confidences, kind="stable"):
        mine = linked[i][linked[i] >= 0]
        pair = tuple(mine.tolist())
        least = door_p
        if len(pair) == 2 and pair in joined:
            least = max(door_p, params.second_door_p)
        elif not has_door[mine].all():
            least = min(door_p, params.only_door_p)
        if confidences[i] >= least:
            taken[i] = True
            has_door[mine] = True
            joined.add(pair)
    return taken
