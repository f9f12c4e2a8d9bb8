"""What is cut by the plan: walls as solid areas, less the openings in them."""

import numpy as np
import shapely
from shapely import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from storage.plan import Plan, PlanOpening, PlanWall

ASSUMED_M = 0.1
"""Thickness a wall of unknown thickness is drawn with; it is drawn lighter, never as known."""


def known_walls(plan: Plan) -> BaseGeometry:
    """Return the area of the walls whose thickness is known, corners closed, openings cut."""
    thicknesses = sorted({w.thickness_m for w in plan.walls if w.thickness_m})
    solid = shapely.union_all([_band(plan.walls, thickness) for thickness in thicknesses])
    return solid.difference(_cut(plan))


def assumed_walls(plan: Plan) -> BaseGeometry:
    """Return the area of the walls whose thickness is unknown, at an assumed thickness."""
    area = _band(plan.walls, None)
    return area.difference(shapely.union_all([known_walls(plan), _cut(plan)]))


def opening_area(plan: Plan, opening: PlanOpening) -> Polygon:
    """Return the rectangle an opening takes out of its wall."""
    return opening.line.buffer(opening_depth(plan, opening) / 2, cap_style="flat")


def opening_depth(plan: Plan, opening: PlanOpening) -> float:
    """Return the thickness of the wall an opening is in, metres."""
    thickness = {wall.id: wall.thickness_m for wall in plan.walls}.get(opening.wall or "")
    return thickness or ASSUMED_M


def _cut(plan: Plan) -> BaseGeometry:
    # a little deeper than the wall: no film of it stays over the opening
    areas = [
        opening.line.buffer(opening_depth(plan, opening) * 0.51, cap_style="flat")
        for opening in (*plan.doors, *plan.windows)
    ]
    return shapely.union_all(areas)


def _band(walls: tuple[PlanWall, ...], thickness_m: float | None) -> BaseGeometry:
    """Return the joined area of the walls of one thickness (None: unknown)."""
    half = (thickness_m or ASSUMED_M) / 2
    lines = [wall.line for wall in walls if (wall.thickness_m or None) == thickness_m]
    # merged first: two walls that meet at any angle share one mitred corner
    merged = shapely.get_parts(shapely.line_merge(shapely.unary_union(lines)))
    closed = [_lengthened(line, half, walls) for line in merged if not line.is_empty]
    areas = shapely.buffer(closed, half, cap_style="flat", join_style="mitre")
    return shapely.union_all(areas)


def _lengthened(line: LineString, by_m: float, walls: tuple[PlanWall, ...]) -> LineString:
    """Return the line, longer at an end that does not run into the side of another wall.

    Where walls of two thicknesses make a corner neither is merged with the other: the extra length
    closes it. A wall that ends on another's centre line is complete, at whatever angle.
    """
    if line.is_closed:
        return line
    ends = shapely.get_coordinates(line)
    for at, inner in ((0, 1), (-1, -2)):
        end = Point(ends[at])
        if not any(_runs_into(end, wall) for wall in walls):
            outwards = ends[at] - ends[inner]
            ends[at] += outwards / np.linalg.norm(outwards) * by_m
    return LineString(ends)


def _runs_into(end: Point, wall: PlanWall) -> bool:
    reach = (wall.thickness_m or ASSUMED_M) / 2
    return wall.line.distance(end) < reach and wall.line.boundary.distance(end) > reach
