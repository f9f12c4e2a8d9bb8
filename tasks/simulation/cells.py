"""From a subdivision of the storey into cells to its walls and rooms.

A cell is a room measured to the centre lines of its walls. What two cells share is a wall between
them, what one has alone is an outer wall; a room is its cell less the walls.
"""

from dataclasses import dataclass
from itertools import combinations, pairwise

import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

SNAP_M = 1e-6
"""Two corners closer than this are one: rounding of the construction, far below a millimetre."""
DECIMALS = 4
"""Walls end on whole tenths of a millimetre, as the plan's file form keeps them."""


@dataclass(frozen=True, eq=False)
class Line:
    """One straight wall: its centre line, its thickness, the cells beside it."""

    line: LineString
    thickness_m: float
    cells: tuple[int, ...]


def wall_lines(
    cells: list[Polygon], bearing: int, outer_m: float, inner_m: float
) -> tuple[Line, ...]:
    """Return the straight walls of a subdivision, inner ones first.

    Parameters
    ----------
    cells : k polygons that touch but do not overlap, metres
    bearing : the cell (the corridor) whose walls are as thick as the outer ones
    outer_m, inner_m : thickness of outer and bearing walls, and of partitions, metres
    """
    inner = []
    for a, b in combinations(range(len(cells)), 2):
        thickness = outer_m if bearing in (a, b) else inner_m
        shared = cells[a].boundary.intersection(cells[b].boundary)
        inner += [Line(line, thickness, (a, b)) for line in _straight(shared)]
    between = shapely.union_all([line.line for line in inner])
    outer = [
        Line(line, outer_m, (i,))
        for i, cell in enumerate(cells)
        for line in _straight(cell.boundary.difference(between.buffer(SNAP_M)))
    ]
    return (*inner, *outer)


def inner_faces(cell: Polygon, walls: tuple[Line, ...]) -> Polygon:
    """Return the room a cell leaves within the inner faces of the walls."""
    solid = shapely.union_all([wall_area(wall.line, wall.thickness_m) for wall in walls])
    room = cell.difference(solid).simplify(SNAP_M)
    if not isinstance(room, Polygon) or room.is_empty:
        raise ValueError(f"cell {cell.wkt}: expected one room within the walls, got {room.wkt}")
    return room


def wall_area(line: LineString, thickness_m: float) -> Polygon:
    """Return a wall's footprint, half its thickness past both ends so that corners close."""
    return line.buffer(thickness_m / 2, cap_style="square", join_style="mitre")


def _straight(geometry: BaseGeometry) -> list[LineString]:
    parts = shapely.get_parts(geometry)
    lines = [part for part in parts if isinstance(part, LineString) and not part.is_empty]
    if not lines:
        return []
    merged = shapely.line_merge(shapely.MultiLineString(lines)).simplify(SNAP_M)
    pieces = []
    for line in shapely.get_parts(merged):
        ends = [tuple(round(value, DECIMALS) for value in point) for point in line.coords]
        pieces += [LineString(pair) for pair in pairwise(ends)]
    return [piece for piece in pieces if piece.length > 10 * SNAP_M]
