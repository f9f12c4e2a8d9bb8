"""From the initial model's tables to the plan of a storey."""

from collections.abc import Sequence

import numpy as np
from shapely import LineString

from storage.plan import Plan, PlanRoom, PlanWall
from storage.rooms import Rooms
from storage.walls import Walls


def initial_plan(
    building: str,
    storey: str,
    rooms: Rooms,
    walls: Walls,
    scans: Sequence[str],
    *,
    simulated: bool = False,
    notes: Sequence[str] = (),
) -> Plan:
    """Return the plan of rooms and walls; what was not seen is None in it.

    Parameters
    ----------
    scans : sequence of str
        Names of the scans the model was made from, in the order it numbers them by.
    """
    return Plan(
        building,
        storey,
        rooms=tuple(_room(rooms, i, scans) for i in range(len(rooms))),
        walls=tuple(_wall(walls, i) for i in range(len(walls))),
        simulated=simulated,
        notes=tuple(notes),
    )


def _room(rooms: Rooms, i: int, scans: Sequence[str]) -> PlanRoom:
    return PlanRoom(
        id=f"r{i}",
        polygon=rooms.polygons[i],
        floor_m=_known(rooms.floor_m[i]),
        ceiling_m=_known(rooms.ceiling_m[i]),
        scans=tuple(scans[scan] for scan in rooms.scans[i]),
    )


def _wall(walls: Walls, i: int) -> PlanWall:
    return PlanWall(
        id=f"w{i}",
        line=LineString(walls.lines[i]),
        thickness_m=_known(walls.thickness_m[i]),
        base_m=_known(walls.base_m[i]),
        top_m=_known(walls.top_m[i]),
        # a wall that juts into a room has it on both sides
        rooms=tuple(dict.fromkeys(f"r{room}" for room in walls.rooms[i] if room >= 0)),
    )


def _known(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
