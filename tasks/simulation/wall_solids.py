"""Walls with their openings cut, frames, window panes, and door leaves as they stand."""

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Point, Polygon

from storage.errors import MapSenseError
from storage.plan import Plan, PlanOpening, PlanRoom, PlanWall
from tasks.simulation.heights import known
from tasks.simulation.junctions import end_extensions
from tasks.simulation.materials import GLASS
from tasks.simulation.solids import Quad, Solid, prism, sheet

FRAME_M, PROUD_M = 0.06, 0.012
"""What a door frame covers of the wall around the opening, and how far it stands out of it: a
sheet-steel frame, DIN 18111. Assumption."""
LEAF_M, REBATE_M, PLAY_M = 0.04, 0.01, 0.004
"""Thickness of a leaf (DIN 18101), how far it lies behind the wall's face on the side it opens to,
and the gap around it. In a wall of 125 mm it is recessed 75 mm on the other side."""
OPEN_RAD = (np.deg2rad(80), np.deg2rad(100))
"""Between what angles an open leaf stands. Assumption."""
STEP_RAD = np.deg2rad(5)
"""Where a side wall is in the way, a leaf is turned back in such steps."""
AJAR_RAD = (np.deg2rad(10), np.deg2rad(35))
"""Between what angles a leaf ajar stands. Assumption."""
SASH_M, SASH_DEPTH_M = 0.06, 0.07
"""Width and depth of a window's frame, set in the middle of the wall. Assumption."""
LEAVES = ("open", "ajar", "shut")
"""States with a leaf; a door of unknown state is an opening and nothing else."""
REACH_M = 0.3
"""How far from a centre line an opening that names no wall may lie: half a thick wall."""

Vector = NDArray[np.float64]
"""(2,), metres"""


@dataclass(frozen=True, eq=False)
class Piece:
    """A straight piece of a wall."""

    wall: str
    start: Vector
    along: Vector
    length: float
    thickness: float
    base: float
    top: float

    def strip(self, start: float, stop: float, low: float, high: float) -> Quad:
        """Return a rectangle by metres along the centre line and to its left."""
        left = np.array((-self.along[1], self.along[0]))
        corners = ((start, low), (stop, low), (stop, high), (start, high))
        return np.array([self.start + s * self.along + t * left for s, t in corners])


class Gap(NamedTuple):
    """An opening in a piece of wall: metres along it, heights."""

    start: float
    stop: float
    sill: float
    head: float


def wall_solids(plan: Plan) -> Iterator[Solid]:
    """Yield the walls of a plan, the frames of its doors and windows, panes and leaves.

    Raises
    ------
    MapSenseError
        If a height or thickness is unknown, or an opening lies on no wall.
    """
    pieces = [piece for wall in plan.walls for piece in _pieces(wall)]
    lines = np.array([(p.start, p.start + p.length * p.along) for p in pieces]).reshape(-1, 2, 2)
    past = end_extensions(lines, np.array([p.thickness for p in pieces]))
    gaps: list[list[Gap]] = [[] for _ in pieces]
    for opening, kind in _openings(plan):
        i = _piece_of(opening, kind, pieces, lines)
        gap = _gap(opening, kind, pieces[i])
        gaps[i].append(gap)
        if kind == "window":
            yield from _window(pieces[i], gap)
        elif opening.state in LEAVES:
            yield from _frame(pieces[i], gap)
            yield _leaf(pieces[i], gap, opening, plan.rooms)
    for piece, cuts, (before, after) in zip(pieces, gaps, past, strict=True):
        yield from _body(piece, cuts, before, after)


def leaf_angle(door: PlanOpening) -> float | None:
    """Return how far a door's leaf is turned out of its wall, radians; None without a leaf.

    A side wall may stop it before. Drawn from the door's id, so that one plan has one mesh.
    """
    if door.state not in LEAVES:
        return None
    if door.state == "shut":
        return 0.0
    low, high = OPEN_RAD if door.state == "open" else AJAR_RAD
    return float(low + (high - low) * zlib.crc32(door.id.encode()) / 2**32)


def _openings(plan: Plan) -> Iterator[tuple[PlanOpening, str]]:
    yield from ((door, "door") for door in plan.doors)
    yield from ((window, "window") for window in plan.windows)


def _pieces(wall: PlanWall) -> Iterator[Piece]:
    """Yield a wall's straight pieces: its line may bend."""
    owner = f"wall '{wall.id}'"
    base, top = known(wall.base_m, owner, "base_m"), known(wall.top_m, owner, "top_m")
    thickness = known(wall.thickness_m, owner, "thickness_m")
    corners = shapely.get_coordinates(wall.line)
    for a, b in pairwise(corners):
        length = float(np.linalg.norm(b - a))
        if length > 0:
            yield Piece(wall.id, a, (b - a) / length, length, thickness, base, top)


def _piece_of(
    opening: PlanOpening, kind: str, pieces: Sequence[Piece], lines: NDArray[np.float64]
) -> int:
    """Return the piece of wall an opening lies on: of the wall it names, else the nearest."""
    middle = opening.line.interpolate(0.5, normalized=True)
    away = shapely.distance(shapely.linestrings(lines), middle)
    if opening.wall is not None:
        away = np.where([piece.wall == opening.wall for piece in pieces], away, np.inf)
    if not len(away) or not away.min() < REACH_M + (0 if opening.wall is None else 1):
        raise MapSenseError(
            f"{kind} '{opening.id}': lies on no wall of the plan; set its 'wall' and its place"
        )
    return int(away.argmin())


def _gap(opening: PlanOpening, kind: str, piece: Piece) -> Gap:
    owner = f"{kind} '{opening.id}'"
    ends = (shapely.get_coordinates(opening.line) - piece.start) @ piece.along
    start, stop = np.clip((ends.min(), ends.max()), 0.0, piece.length)
    sill, head = known(opening.sill_m, owner, "sill_m"), known(opening.head_m, owner, "head_m")
    return Gap(float(start), float(stop), max(sill, piece.base), min(head, piece.top))


def _body(piece: Piece, gaps: Sequence[Gap], before: float, after: float) -> Iterator[Solid]:
    """Yield the wall between, over and under its openings."""
    half = piece.thickness / 2
    position = -before
    for gap in sorted(gaps):
        if gap.start > position:  # openings of a plan someone else drew may touch
            yield prism(piece.strip(position, gap.start, -half, half), piece.base, piece.top)
        across = piece.strip(gap.start, gap.stop, -half, half)
        # a door's sill wall has no height: it is the threshold between two floors
        yield prism(across, piece.base, gap.sill)
        if gap.head < piece.top:
            yield prism(across, gap.head, piece.top)
        position = max(position, gap.stop)
    end = piece.length + after
    if end > position:
        yield prism(piece.strip(position, end, -half, half), piece.base, piece.top)


def _frame(piece: Piece, gap: Gap) -> Iterator[Solid]:
    """Yield a door frame: within the wall, but a little proud of both its faces."""
    half = piece.thickness / 2 + PROUD_M
    left, right = gap.start - FRAME_M, gap.stop + FRAME_M
    head = min(gap.head + FRAME_M, piece.top)
    yield prism(piece.strip(left, gap.start, -half, half), gap.sill, gap.head)
    yield prism(piece.strip(gap.stop, right, -half, half), gap.sill, gap.head)
    if head > gap.head:
        yield prism(piece.strip(left, right, -half, half), gap.head, head)


def _window(piece: Piece, gap: Gap) -> Iterator[Solid]:
    """Yield a window's frame and its pane, a sheet in the middle of the wall."""
    half, inner = SASH_DEPTH_M / 2, (gap.start + SASH_M, gap.stop - SASH_M)
    yield prism(piece.strip(gap.start, inner[0], -half, half), gap.sill, gap.head)
    yield prism(piece.strip(inner[1], gap.stop, -half, half), gap.sill, gap.head)
    yield prism(piece.strip(*inner, -half, half), gap.sill, gap.sill + SASH_M)
    yield prism(piece.strip(*inner, -half, half), gap.head - SASH_M, gap.head)
    a, b = (piece.start + s * piece.along for s in inner)
    yield sheet(a, b, gap.sill + SASH_M, gap.head - SASH_M, GLASS)


def _leaf(piece: Piece, gap: Gap, door: PlanOpening, rooms: Sequence[PlanRoom]) -> Solid:
    """Return the leaf, hung on the side it opens to and turned about its hinge."""
    at_stop, into, room = _hang(piece, gap, door, rooms)
    hinge = piece.start + (gap.stop - PLAY_M if at_stop else gap.start + PLAY_M) * piece.along
    hinge = hinge + (piece.thickness / 2 - REBATE_M) * into
    along = -piece.along if at_stop else piece.along
    width = gap.stop - gap.start - 2 * PLAY_M
    angle = leaf_angle(door) or 0.0
    footprint = _turned_leaf(hinge, width, along, into, angle)
    if room is not None:
        half = piece.thickness / 2
        clear = room.union(Polygon(piece.strip(gap.start, gap.stop, -half, half))).buffer(PLAY_M)
        while angle > STEP_RAD and not clear.contains(Polygon(footprint)):
            angle -= STEP_RAD
            footprint = _turned_leaf(hinge, width, along, into, angle)
    return prism(footprint, gap.sill + PLAY_M, gap.head - PLAY_M)


def _turned_leaf(hinge: Vector, width: float, along: Vector, into: Vector, angle: float) -> Quad:
    edge = width * (np.cos(angle) * along + np.sin(angle) * into)
    back = LEAF_M * (np.sin(angle) * along - np.cos(angle) * into)
    return np.array((hinge, hinge + edge, hinge + edge + back, hinge + back))


def _hang(
    piece: Piece, gap: Gap, door: PlanOpening, rooms: Sequence[PlanRoom]
) -> tuple[bool, Vector, Polygon | None]:
    """Return whether the hinge is at the gap's stop, the direction the leaf opens to, the room.

    A leaf opens into the smaller of its rooms and against the nearer side wall there.
    """
    left = np.array((-piece.along[1], piece.along[0]))
    linked = sorted((r for r in rooms if r.id in door.rooms), key=lambda r: (r.polygon.area, r.id))
    if not linked:
        return False, left, None
    room = linked[0].polygon
    ends = [piece.start + s * piece.along for s in (gap.start, gap.stop)]
    probe = sum(ends) / 2 + (piece.thickness / 2 + 0.1) * left
    into = left if room.distance(Point(probe)) == 0 else -left
    corners = shapely.MultiPoint(shapely.get_coordinates(room))
    faces = [Point(end + piece.thickness / 2 * into) for end in ends]
    return faces[1].distance(corners) < faces[0].distance(corners), into, room
