"""Truth that was read off real scans by hand, in the form it was kept in -> plans."""

import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon

from storage.plan import Plan, PlanOpening, PlanRoom, PlanWall

UNCLEAR = "*"
"""End of the id of a room whose limits are not clear: it is there, but its area says nothing."""
STATES = {"open": "open", "closed": "shut", "closed_glazed": "shut"}


def true_plan(file: Path, building: str, storey: str, raw: bool = False) -> Plan:
    """Return the plan of a truth file.

    Walls are the edges of rooms, faces of unknown thickness: the file knows no centre lines.

    Parameters
    ----------
    raw : bool
        Whether the plan is wanted in the frame of the raw scan, by the matrix the file states.
    """
    document = json.loads(file.read_text())
    heights = (document["z_floor"], document["z_ceiling"])
    rooms = [_room(room, heights) for room in document["rooms"]]
    ids = {room.id.removesuffix(UNCLEAR): room.id for room in rooms}
    plan = Plan(
        building,
        storey,
        rooms=tuple(rooms),
        walls=tuple(wall for room in rooms for wall in _faces(room)),
        doors=tuple(_door(door, ids) for door in document["doors"]),
        notes=(f"{document['made']}; walls are faces of rooms",),
    )
    return _moved(plan, np.linalg.inv(document["raw_to_aligned"])) if raw else plan


def _room(room: dict[str, Any], heights: tuple[float, float]) -> PlanRoom:
    id_ = room["id"] if room["score_area"] else room["id"] + UNCLEAR
    return PlanRoom(id_, Polygon(room["polygon"]), floor_m=heights[0], ceiling_m=heights[1])


def _faces(room: PlanRoom) -> Iterator[PlanWall]:
    for number, ends in enumerate(pairwise(room.polygon.exterior.coords)):
        id_ = f"{room.id}/{number}"
        yield PlanWall(id_, LineString(ends), None, room.floor_m, room.ceiling_m, (room.id,))


def _door(door: dict[str, Any], ids: dict[str, str]) -> PlanOpening:
    if "p0" in door:
        line = LineString([door["p0"], door["p1"]])
    else:
        line = LineString([(door["x0"], door["y"]), (door["x1"], door["y"])])
    return PlanOpening(
        id=door["id"],
        line=line,
        sill_m=door.get("z0"),
        head_m=door.get("z1"),
        state=STATES[door.get("state") or door["kind"]],
        rooms=tuple(ids[room] for room in door["rooms"] if room is not None),
    )


def _moved(plan: Plan, matrix: NDArray[np.float64]) -> Plan:
    """Return the plan in another frame, by a (4, 4) matrix that turns about z and shifts."""

    def there(shape: Any) -> Any:
        return shapely.transform(shape, lambda xy: xy @ matrix[:2, :2].T + matrix[:2, 3])

    def up(z: float | None) -> float | None:
        return None if z is None else z + float(matrix[2, 3])

    return replace(
        plan,
        rooms=tuple(
            replace(r, polygon=there(r.polygon), floor_m=up(r.floor_m), ceiling_m=up(r.ceiling_m))
            for r in plan.rooms
        ),
        walls=tuple(
            replace(w, line=there(w.line), base_m=up(w.base_m), top_m=up(w.top_m))
            for w in plan.walls
        ),
        doors=tuple(
            replace(d, line=there(d.line), sill_m=up(d.sill_m), head_m=up(d.head_m))
            for d in plan.doors
        ),
    )
