"""Rooms of a storey from IfcSpace, and which rooms lie beside a wall or an opening."""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Point, Polygon

from storage.ifc.model import Entity, Model, Storey, parts
from storage.ifc.shapes import GRID_M, Shapes, footprint
from storage.plan import PlanRoom

AREA_MIN_M2 = 0.01
"""A smaller piece of a footprint is a remnant of rounding, not a part of a room."""
REACHES_M = (0.05, 0.2, 0.5)
"""How far from a wall's face a room is looked for: spaces may end at the wall's core or stop short
of its face by its cladding. Nearest first."""
HEIGHT_SLACK_M = 0.3
"""A room's body may end this much under or over what stands in it: screed, suspended ceiling."""
BESIDE_M = 0.3
"""Length of wall a room must share to be beside it; less is a corner."""


def spaces(model: Model, storey: Storey, shapes: Shapes) -> list[Entity]:
    """Return the spaces that are rooms: no gross areas, no groups of other spaces."""
    found = []
    for space in model.of_type("IfcSpace"):
        shape = shapes.get(space.id())
        gross = getattr(space, "PredefinedType", None) == "GFA"
        group = any(part.is_a("IfcSpace") for part in parts(space))
        if shape is None or gross or group:
            continue
        if model.is_on(storey, space, shape.middle_m):
            found.append(space)
    return found


def read_rooms(
    model: Model, storey: Storey, shapes: Shapes, notes: list[str]
) -> tuple[PlanRoom, ...]:
    """Return the rooms of a storey; what cannot be one is told in `notes`."""
    rooms: list[PlanRoom] = []
    for space in model.of_type("IfcSpace"):
        if space.id() not in shapes and model.storey_of(space) is storey:
            notes.append(f"IfcSpace {space.GlobalId} has no body: left out")
    for space in spaces(model, storey, shapes):
        pieces = [
            piece
            for piece in shapely.get_parts(footprint(shapes[space.id()]))
            if isinstance(piece, Polygon) and piece.area >= AREA_MIN_M2
        ]
        pieces.sort(key=lambda piece: -piece.area)
        if not pieces:
            notes.append(f"IfcSpace {space.GlobalId} covers no area: left out")
            continue
        shape = shapes[space.id()]
        texts = [_text(v) for v in (space.LongName, space.ObjectType, space.Name)]
        rooms += [
            PlanRoom(
                # a space in two places is two rooms of one name
                id=space.GlobalId if i == 0 else f"{space.GlobalId}.{i + 1}",
                polygon=piece,
                class_=next((text.lower() for text in texts if text), None),
                name=_text(space.Name),
                floor_m=shape.low_m,
                # a space drawn as a flat outline has no ceiling
                ceiling_m=shape.high_m if shape.high_m > shape.low_m + GRID_M else None,
            )
            for i, piece in enumerate(pieces)
        ]
    return tuple(rooms)


def _text(value: str | None) -> str | None:
    return (value or "").strip() or None


def at_height(rooms: tuple[PlanRoom, ...], low_m: float, high_m: float) -> list[PlanRoom]:
    """Return the rooms whose height overlaps an interval of z."""
    return [
        room
        for room in rooms
        if (room.floor_m is None or room.floor_m - HEIGHT_SLACK_M <= high_m)
        and (room.ceiling_m is None or room.ceiling_m + HEIGHT_SLACK_M >= low_m)
    ]


def linked_rooms(line: LineString, thickness_m: float, rooms: list[PlanRoom]) -> tuple[str, ...]:
    """Return the rooms on the two sides of an opening's line; outdoors is no room."""
    linked = []
    for side in (1, -1):
        for reach in REACHES_M:
            probes = [_beside(line, part, side * (thickness_m / 2 + reach)) for part in (1, 2, 3)]
            hits = [room.id for room in rooms for p in probes if room.polygon.covers(p)]
            if hits:
                linked.append(max(hits, key=hits.count))
                break
    return tuple(dict.fromkeys(linked))


def _beside(line: LineString, quarter: int, offset_m: float) -> Point:
    """Return the point beside a line at one of its quarters, left positive."""
    ends = [line.interpolate(t, normalized=True) for t in (quarter / 4 - 0.05, quarter / 4 + 0.05)]
    (x0, y0), (x1, y1) = (shapely.get_coordinates(end)[0] for end in ends)
    length = np.hypot(x1 - x0, y1 - y0)
    along = np.array((x1 - x0, y1 - y0)) / length
    middle = np.array((x0 + x1, y0 + y1)) / 2
    return Point(middle + offset_m * np.array((-along[1], along[0])))


def rooms_along(line: LineString, thickness_m: float, rooms: list[PlanRoom]) -> tuple[str, ...]:
    """Return the rooms on the two sides of a wall, in the order of the rooms."""
    reach = REACHES_M[1]
    strip = line.buffer(thickness_m / 2 + reach, cap_style="flat", join_style="mitre")
    shared = shared_areas(strip, rooms)
    # a room that bounds the wall fills the strip's edge along the length they share
    return tuple(
        room.id for room, area in zip(rooms, shared, strict=True) if area >= reach * BESIDE_M
    )


def shared_areas(area: Polygon, rooms: list[PlanRoom]) -> NDArray[np.float64]:
    """Return (n,) the area each of n rooms has in common with another area, square metres."""
    return np.asarray(shapely.area(shapely.intersection([r.polygon for r in rooms], area)))
