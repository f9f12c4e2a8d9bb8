"""From the tables of the initial and the final model to the plan of a storey."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from shapely import LineString

from storage.furniture import Furniture
from storage.layout_rooms import LayoutRooms
from storage.layout_walls import LayoutWalls
from storage.openings import DOOR, WINDOW, Openings
from storage.plan import Plan, PlanFurniture, PlanOpening, PlanRoom, PlanWall
from storage.rooms import Rooms
from storage.walls import Walls


@dataclass(frozen=True)
class Made:
    """What a model was made of."""

    building: str
    storey: str
    scans: Sequence[str]
    """names of its scans, in the order the tables number them by"""
    simulated: bool = False
    notes: Sequence[str] = ()


def initial_plan(rooms: Rooms, walls: Walls, made: Made) -> Plan:
    """Return the plan of the initial model; what was not seen is None in it."""
    return Plan(
        made.building,
        made.storey,
        rooms=tuple(_room(rooms, i, made.scans) for i in range(len(rooms))),
        walls=tuple(_wall(walls, i) for i in range(len(walls))),
        simulated=made.simulated,
        notes=tuple(made.notes),
    )


def final_plan(layout: LayoutRooms, walls: LayoutWalls, made: Made) -> Plan:
    """Return the plan of the final model: its rooms have a class and rule where one was found."""
    plan = initial_plan(layout.rooms, walls.walls, made)
    rooms = (_classed(room, layout, i) for i, room in enumerate(plan.rooms))
    return replace(plan, rooms=tuple(rooms))


def with_openings(plan: Plan, openings: Openings) -> Plan:
    """Return the plan with doors and windows in its walls."""
    of_kind = {kind: openings.of_kind(kind) for kind in (DOOR, WINDOW)}
    doors = tuple(_door(openings, f"d{n}", i) for n, i in enumerate(of_kind[DOOR]))
    windows = tuple(_opening(openings, f"n{n}", i) for n, i in enumerate(of_kind[WINDOW]))
    return replace(plan, doors=doors, windows=windows)


def with_furniture(plan: Plan, furniture: Furniture) -> Plan:
    """Return the plan with furniture in its rooms."""
    pieces = tuple(_piece(furniture, i) for i in range(len(furniture)))
    return replace(plan, furniture=pieces)


def _opening(openings: Openings, name: str, i: int) -> PlanOpening:
    return PlanOpening(
        id=name,
        line=LineString(openings.lines[i]),
        sill_m=_known(openings.sill_m[i]),
        head_m=_known(openings.head_m[i]),
        wall=f"w{openings.walls[i]}",
        confidence=float(openings.confidences[i]),
    )


def _door(openings: Openings, name: str, i: int) -> PlanOpening:
    rooms = tuple(f"r{room}" for room in openings.rooms[i] if room >= 0)
    return replace(_opening(openings, name, i), state=str(openings.states[i]), rooms=rooms)


def _piece(furniture: Furniture, i: int) -> PlanFurniture:
    return PlanFurniture(
        id=f"f{i}",
        footprint=furniture.footprints[i],
        class_=str(furniture.classes[i]),
        base_m=_known(furniture.base_m[i]),
        top_m=_known(furniture.top_m[i]),
        room=f"r{furniture.rooms[i]}" if furniture.rooms[i] >= 0 else None,
        confidence=float(furniture.confidences[i]),
    )


def _classed(room: PlanRoom, layout: LayoutRooms, i: int) -> PlanRoom:
    return replace(
        room,
        class_=str(layout.classes[i]) or None,
        rule=str(layout.rules[i]) or None,
        posterior=_known(layout.posteriors[i]),
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
