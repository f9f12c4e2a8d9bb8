"""What point labels say of a storey, as a plan: every outline and box is derived, none surveyed."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import PositiveFloat, PositiveInt
from scipy.spatial import Delaunay, QhullError
from shapely import LineString, Polygon

from storage.plan import Plan, PlanFurniture, PlanOpening, PlanRoom, PlanWall
from tasks.evaluation.label_files import (
    CEILING,
    CHAIR,
    DOOR,
    FLOOR,
    OTHER,
    TABLE,
    WALL,
    WINDOW,
    LabelledPoints,
)
from tasks.params import Params

DERIVED = (
    "derived from point labels: rooms are hulls of floor and ceiling points, walls are faces "
    "fitted to their points and have no thickness, furniture are boxes around its points; "
    "ends of walls and corners of rooms are no truth"
)


class LabelParams(Params):
    """How a plan is derived from labels. Not in the paper, whose truth is surveyed."""

    gap_m: PositiveFloat = 0.3
    """Longest edge of a triangle of a room's hull, metres: gaps narrower than that close, and a
    corner that turns into the room is cut by half its square or less. Assumption: labelled clouds
    are dense, and what hides a wall's foot hides no ceiling."""
    thin_m: PositiveFloat = 0.05
    """Edge of the cells of which only the outermost points are kept for a hull, metres."""
    simplify_m: PositiveFloat = 0.03
    """How far a simplified outline may be from the hull, metres: the noise of a depth sensor."""
    flat_m: PositiveFloat = 0.05
    """Greatest root mean square distance of a wall object's points from its face, metres."""
    reach_m: PositiveFloat = 0.3
    """Greatest median distance of a door's points from the wall it is in, metres: half a leaf
    that stands open, or the depth of a reveal. Assumption."""
    least_points: PositiveInt = 20
    """Fewer points are no object. Assumption."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """The points of one object of one room."""

    id: str
    room: int
    xyz: NDArray[np.float64]


def plan_from_labels(points: LabelledPoints, params: LabelParams) -> Plan:
    """Return what the labels say, as a plan whose notes say that it is derived.

    Notes
    -----
    Rooms: the Delaunay triangles of the room's floor and ceiling points whose edges are at most
    `gap_m` long, united; the largest part. Floor and ceiling heights are medians. Its area is worth
    comparing, its corners are not: they are where the hull was simplified.

    Walls: one per object labelled wall that is flat, the line of total least squares through its
    points on the plan. It is a face: `thickness_m` is None, and ends are not ends of centre lines.

    Doors and windows: extent of the object's points along its room's nearest wall, and their
    lowest and highest point; without a wall within reach, along their longest direction. Which
    rooms a door links, labels do not say.

    Furniture: the least oriented rectangle around an object's points, from the lowest to the
    highest, as the boxes of S3DIS are made. Points without a number of their object are no object.
    """
    notes = [DERIVED]
    walls = _walls(points, params, notes)
    return Plan(
        building=points.building,
        storey=points.storey,
        rooms=_rooms(points, params, notes),
        walls=tuple(wall for wall, _ in walls),
        doors=_openings(points, DOOR, walls, params, notes),
        windows=_openings(points, WINDOW, walls, params, notes),
        furniture=_furniture(points, params, notes),
        simulated=points.simulated,
        notes=tuple(notes),
    )


def _rooms(points: LabelledPoints, params: LabelParams, notes: list[str]) -> tuple[PlanRoom, ...]:
    floors, ceilings = points.of_role(FLOOR), points.of_role(CEILING)
    found = []
    for i, name in enumerate(points.room_names):
        floor = points.xyz[floors[points.rooms[floors] == i]]
        ceiling = points.xyz[ceilings[points.rooms[ceilings] == i]]
        outline = outline_of(np.concatenate([floor, ceiling])[:, :2], params)
        if outline is None:
            notes.append(f"room {name} has no floor or ceiling to take an outline from: left out")
            continue
        found.append(
            PlanRoom(
                id=f"room-{name}",
                polygon=outline,
                class_=points.room_classes[i],
                name=name,
                floor_m=_median(floor),
                ceiling_m=_median(ceiling),
            )
        )
    return tuple(found)


def outline_of(xy: NDArray[np.float64], params: LabelParams) -> Polygon | None:
    """Return the hull of a room's points, (n, 2) metres, with its holes; None if they span none."""
    xy = _outermost(xy, params.thin_m)
    if len(xy) < 3:
        return None
    try:
        corners = xy[Delaunay(xy - xy.mean(axis=0)).simplices]
    except QhullError:  # all on one line
        return None
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    kept = corners[edges.max(axis=1) <= params.gap_m]
    if not len(kept):
        return None
    parts = shapely.get_parts(shapely.coverage_union_all(shapely.polygons(kept)))
    largest = parts[np.argmax(shapely.area(parts))].simplify(params.simplify_m)
    return largest if isinstance(largest, Polygon) and largest.area > 0 else None


def _outermost(xy: NDArray[np.float64], cell_m: float) -> NDArray[np.float64]:
    """Return the points of each cell that lie farthest to each of four sides, once each.

    One point per cell would draw every outline in by half a cell.
    """
    if not len(xy):
        return xy
    cells = np.unique(np.floor(xy / cell_m).astype(np.int64), axis=0, return_inverse=True)[1]
    kept = []
    for values in (xy[:, 0], -xy[:, 0], xy[:, 1], -xy[:, 1]):
        order = np.lexsort((values, cells))
        first = np.flatnonzero(np.diff(cells[order], prepend=-1))
        kept.append(order[first])
    return np.unique(xy[np.unique(np.concatenate(kept))], axis=0)


def _walls(
    points: LabelledPoints, params: LabelParams, notes: list[str]
) -> list[tuple[PlanWall, int]]:
    """Return the flat walls and the room each is labelled in."""
    found = []
    for piece in _pieces(points, WALL, params, notes):
        middle, along, rms = _line_through(piece.xyz[:, :2])
        at = (piece.xyz[:, :2] - middle) @ along
        if rms > params.flat_m or np.ptp(at) == 0:
            notes.append(f"{piece.id} is {rms:.2f} m from flat: no wall line")
            continue
        line = LineString([middle + at.min() * along, middle + at.max() * along])
        low, high = _heights(piece.xyz)
        found.append((PlanWall(piece.id, line, None, low, high), piece.room))
    return found


def _openings(
    points: LabelledPoints,
    role: str,
    walls: list[tuple[PlanWall, int]],
    params: LabelParams,
    notes: list[str],
) -> tuple[PlanOpening, ...]:
    found = []
    for piece in _pieces(points, role, params, notes):
        xy = shapely.points(piece.xyz[:, :2])
        near = [
            (float(np.median(shapely.distance(_endless(wall.line), xy))), wall)
            for wall, room in walls
            if room == piece.room and wall.line.distance(shapely.MultiPoint(xy)) <= params.reach_m
        ]
        apart, wall = min(near, key=lambda pair: pair[0], default=(np.inf, None))
        if wall is not None and apart <= params.reach_m:
            ends = np.array(wall.line.coords)
            middle, along = ends[0], (ends[1] - ends[0]) / wall.line.length
        else:
            wall = None
            middle, along, _ = _line_through(piece.xyz[:, :2])
        at = (piece.xyz[:, :2] - middle) @ along
        if np.ptp(at) == 0:
            notes.append(f"{piece.id} has no width: left out")
            continue
        low, high = _heights(piece.xyz)
        found.append(
            PlanOpening(
                id=piece.id,
                line=LineString([middle + at.min() * along, middle + at.max() * along]),
                sill_m=low,
                head_m=high,
                wall=None if wall is None else wall.id,
                state="unknown" if role == DOOR else None,
            )
        )
    return tuple(found)


def _furniture(
    points: LabelledPoints, params: LabelParams, notes: list[str]
) -> tuple[PlanFurniture, ...]:
    found = []
    for class_ in (TABLE, CHAIR, OTHER):
        for piece in _pieces(points, class_, params, notes):
            box = shapely.oriented_envelope(shapely.multipoints(piece.xyz[:, :2]))
            if not isinstance(box, Polygon) or box.area == 0:
                notes.append(f"{piece.id} covers no area: left out")
                continue
            low, high = _heights(piece.xyz)
            found.append(PlanFurniture(piece.id, box, class_, low, high))
    return tuple(found)


def _pieces(
    points: LabelledPoints, role: str, params: LabelParams, notes: list[str]
) -> list[_Piece]:
    """Return the objects of a role; points that name no object are told in notes."""
    of = points.of_role(role)
    nameless = int((points.objects[of] < 0).sum())
    if nameless:
        notes.append(f"{nameless} points of class {role} name no object: left out")
    of = of[points.objects[of] >= 0]
    keys = np.column_stack([points.rooms[of], points.objects[of]])
    objects, at = np.unique(keys, axis=0, return_inverse=True)
    order = np.argsort(at, kind="stable")
    groups = np.split(of[order], np.cumsum(np.bincount(at, minlength=len(objects)))[:-1])
    found = [
        _Piece(f"{role}-{points.room_names[room]}-{number}", int(room), points.xyz[some])
        for (room, number), some in zip(objects, groups, strict=False)
        if len(some) >= params.least_points
    ]
    if len(found) < len(objects):
        few = len(objects) - len(found)
        notes.append(f"{few} objects of class {role} have too few points: left out")
    return found


def _line_through(
    xy: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return the middle, the unit direction and the rms distance of total least squares."""
    middle = xy.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov((xy - middle).T, bias=True))
    return middle, vectors[:, 1], float(np.sqrt(max(values[0], 0.0)))


def _endless(line: LineString) -> LineString:
    """Return the line prolonged: a door may lie beyond the last point of its wall."""
    (x0, y0), (x1, y1) = line.coords
    reach = 10.0 / line.length
    dx, dy = reach * (x1 - x0), reach * (y1 - y0)
    return LineString([(x0 - dx, y0 - dy), (x1 + dx, y1 + dy)])


def _heights(xyz: NDArray[np.float64]) -> tuple[float, float]:
    return float(xyz[:, 2].min()), float(xyz[:, 2].max())


def _median(xyz: NDArray[np.float64]) -> float | None:
    return float(np.median(xyz[:, 2])) if len(xyz) else None
