"""Which rooms of a plan are its corridors."""

import re

import shapely

from storage.errors import MapSenseError
from storage.plan import Plan, PlanRoom

CIRCULATION = frozenset({"corridor", "corridors", "hallway", "hall", "passage", "circulation"})
"""Words in the class of a room that people walk through to reach others."""
THIN_M = 4.0
"""Widest corridor: twice its area over its perimeter is less. Assumption."""
LONG_TIMES = 3.0
"""A corridor is longer than wide by this much. Assumption."""
LENGTH_MIN_M = 6.0
"""Shortest corridor, metres; shorter ones are the halls of flats and suites. Assumption."""
ROOMS_MIN = 4
"""Fewest rooms a corridor leads to. Assumption."""
WALL_M = 0.6
"""Rooms with so much between them at most are neighbours. Assumption."""


def find_corridors(plan: Plan) -> tuple[PlanRoom, ...]:
    """Return a plan's corridors: by class if a class says so, else by shape and topology.

    Without class names a corridor is thin, long, and leads by doors to several rooms; in a plan
    without doors, it has several neighbours.

    Raises
    ------
    MapSenseError
        If the plan has none.
    """
    named = tuple(room for room in plan.rooms if is_circulation(room.class_))
    found = named or tuple(r for r in plan.rooms if _is_strip(r) and _leads_on(r, plan))
    if not found:
        raise MapSenseError(
            f"building '{plan.building}', storey '{plan.storey}': no room is a corridor; give the "
            "corridor the class 'corridor', or learn from a plan that has one"
        )
    return found


def is_circulation(class_: str | None) -> bool:
    """Return whether the name of a class says that people walk through."""
    return not CIRCULATION.isdisjoint(re.findall(r"[a-z]+", (class_ or "").lower()))


def _is_strip(room: PlanRoom) -> bool:
    """Return whether a room is thin and long; bends and rings do not matter."""
    half = room.polygon.length / 2
    # of a strip, width + length is half the perimeter and width x length the area
    width = room.polygon.area / half
    return width <= THIN_M and half - width >= max(LONG_TIMES * width, LENGTH_MIN_M)


def _leads_on(room: PlanRoom, plan: Plan) -> bool:
    if plan.doors:
        doors = [door for door in plan.doors if room.id in door.rooms]
        return len({r for door in doors for r in door.rooms if r != room.id}) >= ROOMS_MIN
    others = [other.polygon for other in plan.rooms if other.id != room.id]
    return int(shapely.dwithin(others, room.polygon, WALL_M).sum()) >= ROOMS_MIN
