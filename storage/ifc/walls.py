"""Walls of a storey: centre lines from the axis and the body of IfcWall and IfcCurtainWall."""

import math
from dataclasses import replace

import numpy as np
import shapely
from shapely import LineString

from storage.ifc.model import Entity, Model, Storey
from storage.ifc.rooms import at_height, rooms_along
from storage.ifc.shapes import Shape, Shapes, axis_line, footprint
from storage.plan import PlanRoom, PlanWall

WALL_TYPES = ("IfcWall", "IfcCurtainWall")
LENGTH_MIN_M = 0.01
PROBES = np.linspace(0.05, 0.95, 19)
"""Where along an axis the body's two faces are looked up; the median passes over niches."""
FACE_REACH_M = 3.0
"""How far from its axis a wall's body is looked for, metres."""
FILLED_MIN = 0.6
"""Least share of its bounding rectangle a straight wall's footprint fills."""
SHARED_MIN = 0.5
"""Least share of a storey's height that makes another storey's wall a wall of it too."""


def read_walls(
    model: Model,
    storey: Storey,
    shapes: Shapes,
    rooms: tuple[PlanRoom, ...],
    notes: list[str],
) -> tuple[PlanWall, ...]:
    """Return the walls of a storey, with those of other storeys that run through it.

    Notes
    -----
    The centre line is the 'Axis' representation moved to the middle of the body (an axis may lie
    in a face or in a layer), so it ends where the file's axes meet. Without an axis it is the long
    centre line of the body's oriented rectangle; a bent body without an axis is left out.
    """
    walls = []
    for element in model.of_type(*WALL_TYPES):
        shape = shapes.get(element.id())
        if not _runs_through(model, storey, element, shape, rooms):
            continue
        wall = _wall(model, element, shape)
        if wall is None:
            notes.append(
                f"{element.is_a()} {element.GlobalId} has no straight centre line: left out"
            )
            continue
        if shape is not None:
            near = at_height(rooms, shape.low_m, shape.high_m)
            wall = replace(wall, rooms=rooms_along(wall.line, wall.thickness_m or 0.0, near))
        walls.append(wall)
    return tuple(walls)


def _runs_through(
    model: Model,
    storey: Storey,
    element: Entity,
    shape: Shape | None,
    rooms: tuple[PlanRoom, ...],
) -> bool:
    own = model.storey_of(element)
    if own is storey or shape is None:
        return own is storey
    low, high = _band(storey, rooms)
    overlap = min(shape.high_m, high) - max(shape.low_m, low)
    return math.isfinite(high - low) and overlap >= SHARED_MIN * (high - low)


def _band(storey: Storey, rooms: tuple[PlanRoom, ...]) -> tuple[float, float]:
    """Return the z of floor and ceiling: the rooms' where known, else the storeys' elevations."""
    floors = [room.floor_m for room in rooms if room.floor_m is not None]
    ceilings = [room.ceiling_m for room in rooms if room.ceiling_m is not None]
    if floors and ceilings:
        return float(np.median(floors)), float(np.median(ceilings))
    return (-math.inf if storey.elevation_m is None else storey.elevation_m), storey.next_m


def _wall(model: Model, element: Entity, shape: Shape | None) -> PlanWall | None:
    axis = axis_line(model, element)
    if shape is None:
        # a wall drawn by its axis alone: where its faces are is unknown
        return None if axis is None else PlanWall(element.GlobalId, axis)
    area = footprint(shape)
    centred = None if axis is None else _centred(axis, area)
    line, thickness = centred or _rectangle(area)
    if line is None or line.length < LENGTH_MIN_M:
        return None
    return PlanWall(element.GlobalId, line, thickness, shape.low_m, shape.high_m)


def _centred(axis: LineString, area: shapely.Geometry) -> tuple[LineString, float] | None:
    """Return the axis moved to the middle of the body and the distance of the body's faces."""
    faces = [span for t in PROBES if (span := _faces(axis, float(t), area)) is not None]
    if len(faces) < len(PROBES) / 2:
        return None  # the axis does not run in the body
    right, left = np.median(faces, axis=0)
    middle = (left + right) / 2
    line = (
        axis if abs(middle) < LENGTH_MIN_M / 10 else axis.offset_curve(middle, join_style="mitre")
    )
    return (line, left - right) if isinstance(line, LineString) else None


def _faces(axis: LineString, at: float, area: shapely.Geometry) -> tuple[float, float] | None:
    """Return the offsets of the two faces from the axis at a share of its length, left positive."""
    (x, y), (x0, y0), (x1, y1) = (
        shapely.get_coordinates(axis.interpolate(t, normalized=True))[0]
        for t in (at, at - 0.01, at + 0.01)
    )
    normal = np.array((y0 - y1, x1 - x0)) / np.hypot(x1 - x0, y1 - y0)
    ends = np.array((x, y)) + np.outer((-FACE_REACH_M, FACE_REACH_M), normal)
    hits = [
        part
        for part in shapely.get_parts(area.intersection(LineString(ends)))
        if part.length > LENGTH_MIN_M
    ]
    if not hits:
        return None
    # a ring-shaped wall is crossed twice
    hit = min(hits, key=shapely.Point(x, y).distance)
    offsets = (shapely.get_coordinates(hit) - (x, y)) @ normal
    return float(offsets.min()), float(offsets.max())


def _rectangle(area: shapely.Geometry) -> tuple[LineString | None, float]:
    """Return the long centre line and the short side of a footprint's oriented rectangle."""
    around = shapely.oriented_envelope(area)
    if around.area < LENGTH_MIN_M**2 or area.area < FILLED_MIN * around.area:
        return None, 0.0
    a, b, c, d = shapely.get_coordinates(around.exterior)[:4]
    if np.hypot(*(b - a)) < np.hypot(*(c - b)):
        a, b, c, d = b, c, d, a
    return LineString(((a + d) / 2, (b + c) / 2)), float(np.hypot(*(c - b)))
