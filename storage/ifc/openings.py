"""Doors and windows of a storey: lines across the openings they fill, on their walls."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import ifcopenshell.util.placement
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString
from shapely.ops import substring

from storage.ifc.model import Entity, Model, Storey, ancestors
from storage.ifc.rooms import at_height, linked_rooms
from storage.ifc.shapes import Shape, Shapes
from storage.plan import PlanOpening, PlanRoom, PlanWall

WIDTH_MIN_M = 0.05
"""A narrower line across an opening means that the opening does not lie on its wall."""
MATCH_MIN = 0.5
"""Least share of a door's or a window's box that lies in the opening it fills."""
PASSAGE_WIDTH_M, PASSAGE_HEIGHT_M, THRESHOLD_M = 0.5, 1.8, 0.1
"""A person passes an opening at least this wide and high, and no farther above the floor."""
THROUGH_MIN = 0.9
"""Least share of the wall's thickness an opening cuts; less is a niche."""
Openings = tuple[PlanOpening, ...]


@dataclass(frozen=True, eq=False)
class Hole:
    """An IfcOpeningElement that cuts a wall."""

    entity: Entity
    shape: Shape
    wall: PlanWall


def read_holes(model: Model, walls: tuple[PlanWall, ...], shapes: Shapes) -> dict[int, Hole]:
    """Return the openings cut into some walls, by the id of the opening."""
    by_id = {wall.id: wall for wall in walls}
    holes = {}
    for opening in model.of_type("IfcOpeningElement"):
        hosts = [e.GlobalId for e in ancestors(opening) if e.is_a("IfcRoot")]
        host = next((by_id[id_] for id_ in hosts if id_ in by_id), None)
        if host is not None and opening.id() in shapes:
            holes[opening.id()] = Hole(opening, shapes[opening.id()], host)
    return holes


def read_openings(
    model: Model,
    elements: list[Entity],
    shapes: Shapes,
    holes: dict[int, Hole],
    walls: tuple[PlanWall, ...],
    notes: list[str],
) -> tuple[Openings, set[int]]:
    """Return a plan's opening for every door or window, and the ids of the holes they fill.

    Notes
    -----
    The opening is that of IfcRelFillsElement. A file that has lost this relation is matched by
    geometry: the free hole that holds most of the element's box. An element in no hole (a door of a
    curtain wall) lies on the wall whose strip covers it, as wide and as high as it says itself.
    """
    filled = {e.id(): _filled(e, holes) for e in elements}
    taken = {hole for hole in filled.values() if hole is not None}
    found = []
    for element in elements:
        shape, hole_id = shapes.get(element.id()), filled[element.id()]
        if hole_id is None and shape is not None:
            hole_id = _matching(shape, {k: h for k, h in holes.items() if k not in taken})
        opening = None
        if hole_id is not None:
            taken.add(hole_id)
            opening = _in_hole(element, shape, holes[hole_id])
        if opening is None and shape is not None:
            opening = _without_hole(model, element, shape, walls)
        if opening is None:
            notes.append(f"{element.is_a()} {element.GlobalId} has no place in the plan: left out")
        else:
            found.append(opening)
    return tuple(found), taken


def passages(storey: Storey, holes: Iterable[Hole], rooms: tuple[PlanRoom, ...]) -> Openings:
    """Return the openings that people walk through and that nothing fills, as open doors."""
    found = []
    for hole in holes:
        opening = _in_hole(hole.entity, None, hole)
        if opening is None or getattr(hole.entity, "PredefinedType", None) == "RECESS":
            continue
        door = with_rooms(opening, hole.wall, rooms)
        floors = [room.floor_m for room in rooms if room.id in door.rooms]
        floor = next(
            (f for f in (*floors, storey.elevation_m, hole.wall.base_m) if f is not None), None
        )
        if floor is not None and _is_walkable(hole, opening, floor):
            found.append(replace(door, state="open"))
    return tuple(found)


def with_rooms(
    door: PlanOpening, wall: PlanWall | None, rooms: tuple[PlanRoom, ...]
) -> PlanOpening:
    """Return the door with the rooms it links."""
    low, high = door.sill_m, door.head_m
    near = list(rooms) if low is None or high is None else at_height(rooms, low, high)
    thickness = 0.0 if wall is None or wall.thickness_m is None else wall.thickness_m
    return replace(door, rooms=linked_rooms(door.line, thickness, near))


def _is_walkable(hole: Hole, opening: PlanOpening, floor_m: float) -> bool:
    sill, head = max(hole.shape.low_m, floor_m), hole.shape.high_m
    depth = _depth_in(hole.wall, opening.line, hole.shape)
    return (
        sill <= floor_m + THRESHOLD_M
        and head - sill >= PASSAGE_HEIGHT_M
        and opening.line.length >= PASSAGE_WIDTH_M
        and depth >= THROUGH_MIN * (hole.wall.thickness_m or 0.0)
    )


def _filled(element: Entity, holes: dict[int, Hole]) -> int | None:
    for relation in element.FillsVoids:
        opening = relation.RelatingOpeningElement
        if opening is not None and opening.id() in holes:
            return int(opening.id())
    return None


def _matching(shape: Shape, holes: dict[int, Hole]) -> int | None:
    """Return the hole that holds most of a shape's box, if it holds enough of it."""
    if not holes:
        return None
    ids = list(holes)
    low, high = np.stack([holes[i].shape.bounds for i in ids], axis=1)
    own_low, own_high = shape.bounds
    # across the wall either may be the thicker one: compare with the thinner box
    share = np.minimum(high, own_high) - np.maximum(low, own_low)
    share = share / np.maximum(np.minimum(high - low, own_high - own_low), 1e-9)
    volume = np.prod(np.clip(share, 0, 1), axis=1)
    best = int(np.argmax(volume))
    return ids[best] if volume[best] >= MATCH_MIN else None


def _in_hole(element: Entity, shape: Shape | None, hole: Hole) -> PlanOpening | None:
    wall, line = hole.wall, _line_on(hole.wall.line, hole.shape.vertices[:, :2])
    if line is None:
        return None
    # an opening's body may reach below and above its wall, and the door of a toilet partition below
    lowest = None if wall.base_m is None else min(wall.base_m, shape.low_m if shape else math.inf)
    sill = hole.shape.low_m if lowest is None else max(hole.shape.low_m, lowest)
    head = hole.shape.high_m if wall.top_m is None else min(hole.shape.high_m, wall.top_m)
    return PlanOpening(element.GlobalId, line, min(sill, head), head, wall.id)


def _without_hole(
    model: Model, element: Entity, shape: Shape, walls: tuple[PlanWall, ...]
) -> PlanOpening | None:
    xy = shape.vertices[:, :2]
    box = shapely.convex_hull(shapely.multipoints(xy)).buffer(1e-3)
    near = [
        (wall.line.buffer((wall.thickness_m or 0.0) / 2 + 1e-3, cap_style="flat"), wall)
        for wall in walls
        if wall.line.distance(box) <= (wall.thickness_m or 0.0)
        and (wall.top_m is None or wall.top_m > shape.middle_m)
        and (wall.base_m is None or wall.base_m < shape.middle_m)
    ]
    wall = max(near, key=lambda s: s[0].intersection(box).area, default=(None, None))[1]
    line = None if wall is None else _line_on(wall.line, xy)
    if line is None:
        wall, line = None, _line_on(_along(element, xy), xy)
    if line is None:
        return None
    width = model.length(element.OverallWidth)
    if width is not None and WIDTH_MIN_M <= width < line.length:
        # the body includes a frame around the clear width
        margin = (line.length - width) / 2
        line = substring(line, margin, line.length - margin)
    height = model.length(element.OverallHeight)
    head = shape.high_m if height is None else min(shape.low_m + height, shape.high_m)
    return PlanOpening(element.GlobalId, line, shape.low_m, head, None if wall is None else wall.id)


def _along(element: Entity, xy: NDArray[np.float64]) -> LineString:
    """Return a line through an element's middle along the x axis of its placement, its width."""
    matrix = ifcopenshell.util.placement.get_local_placement(element.ObjectPlacement)
    direction = np.asarray(matrix, np.float64)[:2, 0]
    direction = direction / max(float(np.hypot(*direction)), 1e-12)
    across = np.array((-direction[1], direction[0]))
    middle = np.median(xy @ across) * across
    ends = xy @ direction
    return LineString((middle + ends.min() * direction, middle + ends.max() * direction))


def _line_on(line: LineString, xy: NDArray[np.float64]) -> LineString | None:
    """Return the part of a wall's line beside some points; a straight line may be prolonged."""
    corners = shapely.get_coordinates(line)
    if len(corners) == 2:
        along = (corners[1] - corners[0]) / max(line.length, 1e-12)
        at = (xy - corners[0]) @ along
        start, stop = float(at.min()), float(at.max())
        part = LineString((corners[0] + start * along, corners[0] + stop * along))
    else:
        at = shapely.line_locate_point(line, shapely.points(xy))
        part = substring(line, float(at.min()), float(at.max()))
    return part if part.length >= WIDTH_MIN_M else None


def _depth_in(wall: PlanWall, line: LineString, shape: Shape) -> float:
    """Return how much of a wall's thickness a hole cuts, measured across the hole's line."""
    half = (wall.thickness_m or 0.0) / 2
    start, stop = shapely.get_coordinates(line)[[0, -1]]
    normal = np.array((start[1] - stop[1], stop[0] - start[0])) / np.hypot(*(stop - start))
    offsets = (shape.vertices[:, :2] - start) @ normal
    return float(min(offsets.max(), half) - max(offsets.min(), -half))
