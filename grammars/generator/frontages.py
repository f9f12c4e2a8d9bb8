"""The rooms along the reference lines of a plan: widths between centre lines, and depths."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Point, Polygon

from grammars.generator.corridors import find_corridors
from grammars.generator.params import LearnParams
from grammars.generator.reference_lines import corridor_lines
from grammars.generator.spaces import Corners, space_of
from grammars.model import ReferenceLine
from storage.plan import Plan, PlanRoom, PlanWall

TOUCH_M = 0.05
"""Faces this far across each other still meet: plans are drawn to centimetres."""
LEVEL = 0.1
"""Rise of a room's face along the line, at most. Assumption: six degrees."""
OVERLAP_M = 0.3
"""A room that shares less of the line stands beside it. Assumption."""
SIDE_M = 0.3
"""A side shorter than this does not say where the room's side wall meets the line. Assumption."""
DEPTH_AT = (0.25, 0.5, 0.75)
"""Where along a room's face its depth is taken; the median counts."""
REAR_AT = (0.2, 0.3, 0.45, 0.55, 0.7, 0.8)
"""Where it is asked how straight the rear of a row is: in pairs, as a pointed or stepped room may
be equally deep at places far apart."""


@dataclass(frozen=True)
class Frontage:
    """A room on a line. Positions run along the line, from its start, metres."""

    room: str
    class_: str | None
    clear_m: tuple[float, float]
    """where the faces of its side walls, followed to the line, meet it"""
    width_m: float
    """between the centre lines of its side walls"""
    depth_m: float
    """from the line to the face of the opposite wall"""
    joined: bool
    """whether the room before it on the line is its neighbour"""


@dataclass(frozen=True, eq=False)
class Frontages:
    """All lines of a plan that rooms stand along, and those rooms."""

    lines: tuple[ReferenceLine, ...]
    rows: tuple[tuple[Frontage, ...], ...]
    """one row a line, in its direction"""
    partitions_m: NDArray[np.float64]
    """thickness of each wall between two neighbours on a line"""
    fronts_m: NDArray[np.float64]
    """thickness of the wall between the corridor and each room on a line"""


@dataclass(frozen=True, eq=False)
class _Face:
    """A room's wall at the line, in the line's frame: x along it, y to its left."""

    room: PlanRoom
    low: float
    high: float
    """where the side walls' faces, followed to the line, meet it"""
    slants: tuple[float, float]
    """x over y of both sides"""
    y: float
    """of the face"""
    reach: tuple[float, float]
    """x of the face's own ends"""
    outline: Polygon


def survey(plan: Plan, params: LearnParams) -> Frontages:
    """Return the rooms along the corridors of a plan.

    A room stands on a line if a face of it is parallel to the line, to its left and no farther than
    a wall's thickness. Its width runs from centre line to centre line: to the middle between it and
    its neighbour on the line, and at the end of a row to the middle of the plan's wall there; if
    the plan has none, to that of a partition. A room that meets the line in several places reaches
    from the first to the last, and rooms within are none on the line: those need another layer of
    the grammar (Sec. 7.4).
    """
    corridors = find_corridors(plan)
    kept = {corridor.id for corridor in corridors}
    rooms = [room for room in plan.rooms if room.id not in kept]
    edges = [e for c in corridors for e in corridor_lines(c.polygon, params.line_min_m)]
    faces = [_faces(edge, rooms, params.wall_max_m) for edge in edges]
    gaps = np.array(
        [g for row in faces for a, b in pairwise(row) if (g := _gap(a, b, params)) is not None]
    )
    partition = float(np.median(gaps)) if len(gaps) else params.partition_m
    lines: list[ReferenceLine] = []
    rows: list[tuple[Frontage, ...]] = []
    for edge, row in zip(edges, faces, strict=True):
        if row:
            start, end = ((float(x), float(y)) for x, y in edge)
            id_, space = f"{plan.storey}-{len(lines) + 1}", _space(edge, row)
            lines.append(ReferenceLine(id_, plan.storey, start, end, space))
            rows.append(_frontages(edge, row, plan.walls, partition, params))
    fronts = np.array([face.y for row in faces for face in row], float)
    return Frontages(tuple(lines), tuple(rows), gaps, fronts)


def _space(edge: NDArray[np.float64], row: Sequence[_Face]) -> Corners | None:
    rear = [point for face in row for point in _rear(face, REAR_AT)]
    if not rear:
        return None
    first, last = row[0], row[-1]
    ends, slants = (first.low, last.high), (first.slants[0], last.slants[1])
    return space_of(edge, np.array([face.y for face in row]), np.array(rear), ends, slants)


def _faces(edge: NDArray[np.float64], rooms: Sequence[PlanRoom], reach_m: float) -> list[_Face]:
    """Return the faces of rooms on a line in its direction, without rooms within others."""
    if not rooms:
        return []
    near = shapely.dwithin([room.polygon for room in rooms], LineString(edge), reach_m)
    length = float(np.linalg.norm(edge[1] - edge[0]))
    found = []
    for room in (room for room, is_near in zip(rooms, near, strict=True) if is_near):
        face = _face(edge, room, reach_m)
        if face and min(face.high, length) - max(face.low, 0.0) >= OVERLAP_M:
            found.append(face)
    outermost: list[_Face] = []
    for face in sorted(found, key=lambda f: (f.low, -f.high)):
        if not outermost or face.high > outermost[-1].high + TOUCH_M:
            outermost.append(face)
    return outermost


def _face(edge: NDArray[np.float64], room: PlanRoom, reach_m: float) -> _Face | None:
    along = (edge[1] - edge[0]) / np.linalg.norm(edge[1] - edge[0])
    frame = np.column_stack((along, (-along[1], along[0])))
    polygon = shapely.orient_polygons(room.polygon)
    outline = shapely.transform(polygon, lambda xy: (xy - edge[0]) @ frame)
    corners = np.asarray(outline.exterior.coords)[:-1, :2]
    steps = np.roll(corners, -1, axis=0) - corners
    middle = corners[:, 1] + steps[:, 1] / 2
    # anticlockwise, the interior to the left: edges towards +x have the room above them
    at_line = (steps[:, 0] > 0) & (np.abs(steps[:, 1]) <= LEVEL * steps[:, 0])
    at_line &= (middle > -TOUCH_M) & (middle <= reach_m)
    if not at_line.any():
        return None
    index = np.nonzero(at_line)[0]
    first = index[np.argmin(corners[index, 0])]
    ends = corners + steps
    last = index[np.argmax(ends[index, 0])]
    slants = _slant(steps[first - 1]), _slant(steps[(last + 1) % len(steps)])
    (x0, y0), (x1, y1) = corners[first], ends[last]
    y = float(np.average(middle[index], weights=steps[index, 0]))
    low, high = x0 - slants[0] * y0, x1 - slants[1] * y1
    return _Face(room, float(low), float(high), slants, y, (float(x0), float(x1)), outline)


def _slant(side: NDArray[np.float64]) -> float:
    """Return x over y of a side wall; 0 if it is none, as at a niche."""
    if np.linalg.norm(side) < SIDE_M or abs(side[1]) <= abs(side[0]):
        return 0.0
    return float(side[0] / side[1])


def _gap(face: _Face, following: _Face, params: LearnParams) -> float | None:
    """Return the thickness of the wall between two rooms; None if they are no neighbours."""
    gap = (following.low - face.high) / np.hypot(1, face.slants[1])
    return max(float(gap), 0.0) if -TOUCH_M <= gap <= params.wall_max_m else None


def _frontages(
    edge: NDArray[np.float64],
    row: Sequence[_Face],
    walls: Sequence[PlanWall],
    partition_m: float,
    params: LearnParams,
) -> tuple[Frontage, ...]:
    gaps = [_gap(a, b, params) for a, b in pairwise(row)]
    found = []
    for face, before, after in zip(row, [None, *gaps], [*gaps, None], strict=True):
        halves = 0.0
        for side, gap in enumerate((before, after)):
            if gap is None:
                gap = _end_wall(edge, face, side, walls, params.wall_max_m)
            thickness = partition_m if gap is None else gap
            halves += thickness / 2 * float(np.hypot(1, face.slants[side]))
        width = face.high - face.low + halves
        clear = face.low, face.high
        joined = before is not None
        frontage = Frontage(face.room.id, face.room.class_, clear, width, _depth(face), joined)
        found.append(frontage)
    return tuple(found)


def _end_wall(
    edge: NDArray[np.float64],
    face: _Face,
    side: int,
    walls: Sequence[PlanWall],
    wall_max_m: float,
) -> float | None:
    """Return the thickness of the plan's wall at a room's side, None if the plan has none."""
    along = (edge[1] - edge[0]) / np.linalg.norm(edge[1] - edge[0])
    left = np.array((-along[1], along[0]))
    above = SIDE_M  # past the corner, where the corridor's wall is no longer near
    x = face.reach[side] + face.slants[side] * above
    at = Point(edge[0] + x * along + (face.y + above) * left)
    best = None
    for wall in walls:
        if wall.thickness_m is None or wall.line.distance(at) > wall_max_m / 2 + TOUCH_M:
            continue
        ends = np.asarray(wall.line.coords)[:, :2]
        step = ends[-1] - ends[0]
        off = abs(wall.line.distance(at) - wall.thickness_m / 2)
        upright = abs(step @ left) > abs(step @ along)
        if upright and off <= TOUCH_M and (best is None or off < best[0]):
            best = off, wall.thickness_m
    return None if best is None else best[1]


def _depth(face: _Face) -> float:
    """Return how far a room reaches from the line, the median over its face."""
    depths = [depth for _, depth in _rear(face, DEPTH_AT)]
    return float(np.median(depths)) if depths else float(face.outline.bounds[3])


def _rear(face: _Face, shares: Sequence[float]) -> list[tuple[float, float]]:
    """Return points of a room's rear face, as x and y, at shares of its front."""
    x0, x1 = face.reach
    top = face.outline.bounds[3]
    found = []
    for share in shares:
        x = x0 + share * (x1 - x0)
        ray = LineString(((x, face.y + TOUCH_M), (x, top + 1.0)))
        parts = shapely.get_parts(shapely.intersection(ray, face.outline))
        ends = [shapely.bounds(p)[[1, 3]] for p in parts if p.length > 0]
        found += [(x, float(min(ends, key=lambda e: e[0])[1]))] if ends else []
    return found


def runs(row: Sequence[Frontage]) -> list[list[Frontage]]:
    """Return a row's rooms in runs of neighbours."""
    found: list[list[Frontage]] = []
    for frontage in row:
        if not frontage.joined or not found:
            found.append([])
        found[-1].append(frontage)
    return found


def named(frontages: Frontages, classes: Sequence[str]) -> Frontages:
    """Return the frontages with classes, in the order of the rows."""
    left = iter(classes)
    rows = tuple(tuple(replace(f, class_=next(left)) for f in row) for row in frontages.rows)
    return replace(frontages, rows=rows)
