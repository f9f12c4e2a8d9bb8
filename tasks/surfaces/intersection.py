"""Plane intersection (Sec. 4.1, Eq. 8): wall faces become rooms, walls and corners.

The paper extends walls until they meet. Here all faces' lines, lengthened, cut the storey into
cells; a minimum cut tells indoors from outdoors by where floor and ceiling were seen and where
walls stand; cells between which no wall stands are one room. So a room may have any simple
polygon, a missing wall is bridged by its neighbours' extensions, and what many scans saw of one
room makes one room.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat

from storage.corners import Corners
from storage.coverage import Coverage
from storage.faces import SEEN_LOW, SEEN_OVER, SEEN_WALL, Faces
from storage.layout_rooms import LayoutRooms
from storage.layout_walls import LayoutWalls
from storage.occupancy import Occupancy
from storage.rooms import Rooms
from storage.walls import Walls
from tasks.params import Params
from tasks.surfaces import arrangement as cut
from tasks.surfaces.corners import room_corners
from tasks.surfaces.directions import face_angles, frames, off_frames
from tasks.surfaces.outlines import outline_lines
from tasks.surfaces.pairing import pair_walls
from tasks.surfaces.partition import indoors, join_open
from tasks.surfaces.upright import Columns


class IntersectParams(Params):
    """Parameters of plane intersection. None of them is in the paper."""

    min_face_m: PositiveFloat = 0.7
    """Shortest face that cuts a room, metres."""
    long_face_m: PositiveFloat = 2.0
    """Length from which a face cuts at any angle; shorter ones off the storey's directions are
    open door leaves and cabinets, metres."""
    extension_m: PositiveFloat = 10.0
    """How far a wall is extended at most to meet others, metres."""
    in_line_m: PositiveFloat = 0.06
    """Faces off each other's line by less share one, metres."""
    snap_m: NonNegativeFloat = 0.04
    """A wall takes a direction of the storey if its ends move by less, metres."""
    snap_rad: NonNegativeFloat = 0.0175
    """A wall takes a direction of the storey if it turns by less, radians: one degree, what a
    hand-held scan is turned by on the whole."""
    thinnest_m: PositiveFloat = 0.04
    """Thickness of the thinnest wall with two faces, metres."""
    thickest_m: PositiveFloat = 0.6
    """Thickness of the thickest wall with two faces, metres."""
    unseen_cost: PositiveFloat = 0.05
    """Cost of a square metre indoors that was not seen, against 1 for one outdoors that was."""
    open_cost: PositiveFloat = 0.6
    """Cost of a metre of the building's limit on which no wall was seen."""
    wall_low: float = Field(default=0.6, ge=0, le=1)
    """How much of a wall is seen where only something lower than a lintel was."""
    wall_over: float = Field(default=0.2, ge=0, le=1)
    """How much of a wall is seen where the floor runs on beneath."""
    wall_upright: float = Field(default=0.9, ge=0, le=1)
    """How much of a wall is seen where points stand from floor to ceiling but no plane was found,
    or one a little aside."""
    unknown_open: float = Field(default=0.4, ge=0, le=1)
    """How open a place is on which neither a wall was seen nor the floor or ceiling running on."""
    open_share: float = Field(default=0.3, ge=0, le=1)
    """Share of their common border from which two cells are one room."""
    min_area_m2: PositiveFloat = 1.0
    """Smallest room, square metres."""
    min_seen: float = Field(default=0.15, ge=0, le=1)
    """Least share of a room's area that was seen; a fifth of it for one walled on most sides."""


OUTSIDE_MARGIN = 0.5
"""How far the plane reaches beyond what was seen, metres."""
OUTLINE_EXTENSION = 1.0
"""How far an outline without a wall is extended, metres: to the walls beside it, not through the
storey."""
SLIVER = 0.1
"""Half the width below which a part of a room is an artefact of nearly equal lines, metres."""
IN_LINE = 0.01
"""A corner this near to the line of its neighbours is none, metres."""
WALLED, UNWALLED = 0.5, 0.25
"""Share of the outline from which a hardly seen room is believed, and below which half of it must
have been seen: what lies outside a window has a floor too, but no walls."""


def intersect_walls(
    faces: Faces, coverage: Coverage, occupancy: list[Occupancy], params: IntersectParams
) -> tuple[Rooms, Walls, Corners]:
    """Intersect the wall faces of a storey to its initial model.

    Parameters
    ----------
    faces : Faces
        Wall faces of the storey.
    coverage : Coverage
        Where floor and ceiling were seen.
    occupancy : list of Occupancy
        Where each scan's points lie: what stands from floor to ceiling is a wall, whether or not
        a plane was found on it.

    Returns
    -------
    Rooms
        Simple polygons, disjoint, a room around a core with a hole; none if nothing bounds or
        covers a room.
    Walls
        The rooms' walls; two faces of one wall are one wall with a thickness.
    Corners
        Lower and upper corners by Cramer's rule.
    """
    if not len(coverage):
        return _empty()
    faces = _cutting(faces, params)
    plane = _cut_plane(faces, coverage, Columns(occupancy, coverage), params)
    rooms = _rooms(plane, coverage, params)
    walls = pair_walls(rooms, faces, params.thinnest_m, params.thickest_m)
    return rooms, walls, room_corners(rooms, faces)


def wall_up(layout: LayoutRooms, faces: Faces, params: IntersectParams) -> LayoutWalls:
    """Return the walls of the final plan: those of its rooms, as the faces beside them were seen.

    Parameters
    ----------
    layout : LayoutRooms
        Rooms of the final plan.
    faces : Faces
        Wall faces of the storey.
    """
    cutting = _cutting(faces, params)
    return LayoutWalls(pair_walls(layout.rooms, cutting, params.thinnest_m, params.thickest_m))


def _empty() -> tuple[Rooms, Walls, Corners]:
    none = np.empty(0)
    rooms = Rooms(np.empty(0, object), none, none, none, none, ())
    pairs = np.empty((0, 2), np.int32)
    walls = Walls(np.empty((0, 2, 2)), none, none, none, pairs, none)
    return rooms, walls, Corners(np.empty(0, np.int32), np.empty((0, 3)), np.empty((0, 3)))


def _cutting(faces: Faces, params: IntersectParams) -> Faces:
    """Return the faces that may bound a room."""
    angles = face_angles(faces)
    off = np.abs(off_frames(angles, frames(angles, faces.weights)))
    length = np.linalg.norm(faces.lines[:, 1] - faces.lines[:, 0], axis=1)
    wall = np.array([(p == SEEN_WALL).sum() * faces.bin_m for p in faces.profiles])
    aligned = (off < np.radians(5)) | (length > params.long_face_m)
    keep = np.flatnonzero((length >= params.min_face_m) & (wall >= params.min_face_m / 2) & aligned)
    return faces.take(keep)


@dataclass(frozen=True, eq=False)
class _Plane:
    """The storey's plane, cut, with what is known of its cells and edges."""

    cut: cut.Arrangement
    cells: NDArray[np.object_]
    areas: NDArray[np.float64]
    seen: NDArray[np.float64]
    solid: NDArray[np.float64]
    left: NDArray[np.int64]
    right: NDArray[np.int64]
    lengths: NDArray[np.float64]
    wall: NDArray[np.float64]
    open: NDArray[np.float64]


def _cut_plane(
    faces: Faces, coverage: Coverage, columns: Columns, params: IntersectParams
) -> _Plane:
    lines = cut.carrier_lines(
        faces, params.in_line_m, np.radians(2), 3.0, params.snap_m, params.snap_rad
    )
    main = frames(face_angles(faces), faces.weights)
    extension = np.full(len(lines.offsets), params.extension_m)
    lines = _with_outlines(lines, outline_lines(coverage, lines, main))
    short = np.full(len(lines.offsets) - len(extension), OUTLINE_EXTENSION)
    plane = cut.arrange(lines, _border(coverage, main), np.append(extension, short))
    solid = cut.solid_share(plane, faces, params.thinnest_m, params.thickest_m)
    worth = np.zeros(4)
    worth[[SEEN_LOW, SEEN_OVER, SEEN_WALL]] = params.wall_low, params.wall_over, 1.0
    wall = cut.wall_share(plane, lines, faces, 0.1, worth)
    return _Plane(
        cut=plane,
        cells=plane.cells,
        areas=shapely.area(plane.cells),
        seen=cut.seen_share(plane, coverage),
        solid=solid,
        left=plane.left,
        right=plane.right,
        lengths=np.linalg.norm(plane.edges[:, 1] - plane.edges[:, 0], axis=1),
        wall=np.maximum(wall, params.wall_upright * columns.share(plane.edges)),
        open=cut.open_share(plane, coverage),
    )


def _border(coverage: Coverage, main: NDArray[np.float64]) -> shapely.Polygon:
    """Return the box around all that was seen, along the storey's first direction."""
    angle = main[0] if len(main) else 0.0
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    turned = coverage.centres() @ axes.T
    low, high = turned.min(axis=0) - OUTSIDE_MARGIN, turned.max(axis=0) + OUTSIDE_MARGIN
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    return shapely.Polygon(corners @ axes)


def _with_outlines(
    lines: cut.Lines,
    more: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
) -> cut.Lines:
    normals, offsets, spans = more
    return cut.Lines(
        np.vstack([lines.normals, normals]),
        np.append(lines.offsets, offsets),
        np.vstack([lines.spans, spans]),
        lines.of_face,
    )


def _rooms(plane: _Plane, coverage: Coverage, params: IntersectParams) -> Rooms:
    inside = indoors(
        outside_cost=plane.areas * plane.seen * (1 - plane.solid),
        inside_cost=plane.areas * ((1 - plane.seen) * params.unseen_cost + 5 * plane.solid),
        left=plane.left,
        right=plane.right,
        cut_cost=plane.lengths * (params.open_cost * (1 - plane.wall) + 0.02),
    )
    room = join_open(inside, *_borders(plane, params), params.open_share)
    groups = [np.flatnonzero(room == r) for r in np.unique(room[room >= 0])]
    good = [found for cells in groups for found in _rooms_of(plane, cells, params)]
    good.sort(key=lambda f: (-f[0].area, f[0].bounds))
    polygons = np.empty(len(good), object)
    polygons[:] = [shapely.normalize(f[0]) for f in good]
    return _with_coverage(polygons, np.array([f[1] for f in good]), good, coverage)


def _borders(
    plane: _Plane, params: IntersectParams
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return which cells border on each other, along how many metres, and how many are open."""
    through = params.unknown_open + (1 - params.unknown_open) * plane.open
    gap = (1 - plane.wall) * through
    sliver = 2 * plane.areas / shapely.length(plane.cells) < params.thickest_m / 2
    e, f = cut.across_slivers(plane.cut, sliver)
    here = np.where(sliver[plane.left[e]], plane.right[e], plane.left[e])
    there = np.where(sliver[plane.left[f]], plane.right[f], plane.left[f])
    along = np.minimum(plane.lengths[e], plane.lengths[f])
    return (
        np.append(plane.left, here),
        np.append(plane.right, there),
        np.append(plane.lengths, along),
        np.append(plane.lengths * gap, along * np.minimum(gap[e], gap[f])),
    )


Found = tuple[shapely.Polygon, float, float]


def _rooms_of(plane: _Plane, cells: NDArray[np.int64], params: IntersectParams) -> list[Found]:
    """Return (polygon, seen share, walled share) of each room a group of cells makes.

    Mostly one or none. Slivers between nearly equal lines can hang two rooms together.
    """
    if plane.areas[cells].sum() < params.min_area_m2:
        return []
    member = np.zeros(len(plane.cells) + 1, bool)  # the last entry serves the border's -1
    member[cells] = True
    limit = member[plane.left] != member[plane.right]
    walled = float(plane.wall[limit] @ plane.lengths[limit] / max(plane.lengths[limit].sum(), 1e-9))
    least = _least_seen(walled, params)
    found = []
    whole = shapely.union_all(plane.cells[cells], grid_size=cut.SNAP)
    for polygon in _tidy(whole, params.min_area_m2):
        inside = cells[shapely.intersects(polygon, shapely.point_on_surface(plane.cells[cells]))]
        seen = float(plane.seen[inside] @ plane.areas[inside] / polygon.area)
        if polygon.area >= params.min_area_m2 and seen >= least:
            found.append((polygon, min(seen, 1.0), walled))
    return found


def _least_seen(walled: float, params: IntersectParams) -> float:
    """Return how much of a room must have been seen, given how much of its outline is walled."""
    if walled < UNWALLED:
        return max(params.min_seen, 0.5)
    return params.min_seen if walled < WALLED else params.min_seen / 5


def _tidy(polygon: shapely.Geometry, least: float) -> list[shapely.Polygon]:
    """Return the parts of a room without slivers and corners in line.

    Holes smaller than `least`, m2, are columns and what was not seen; around a larger one, a
    courtyard or a core of rooms, the room runs as a ring.
    """
    mitre = {"join_style": "mitre", "mitre_limit": 3.0}
    opened = polygon.buffer(-SLIVER, **mitre).buffer(SLIVER, **mitre)
    outlines = [_without_small_holes(p, least) for p in _polygons(opened)]
    # rounded here, so that a plan written with four decimals is as simple as the room it shows
    rounded = [shapely.set_precision(p.simplify(IN_LINE), cut.SNAP) for p in outlines]
    return [_without_small_holes(p, least) for r in rounded for p in _polygons(r)]


def _without_small_holes(polygon: shapely.Polygon, least: float) -> shapely.Polygon:
    holes = [ring for ring in polygon.interiors if shapely.Polygon(ring).area >= least]
    return shapely.Polygon(polygon.exterior, holes)


def _polygons(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    return [p for p in shapely.get_parts(geometry) if p.geom_type == "Polygon" and p.area > 0]


def _with_coverage(
    polygons: NDArray[np.object_],
    seen: NDArray[np.float64],
    found: list[Found],
    coverage: Coverage,
) -> Rooms:
    """Look up what the cells of each room say of its heights and of who saw it."""
    tree = shapely.STRtree(shapely.points(coverage.centres()))
    starts = np.concatenate(([0], np.cumsum(coverage.scans)))
    floors, ceilings, scans = [], [], []
    for polygon in polygons:
        cells = np.sort(tree.query(polygon, "intersects"))
        floors.append(_middle(coverage.floor_m[cells]))
        ceilings.append(_middle(coverage.ceiling_m[cells]))
        by = [coverage.seen_by[starts[c] : starts[c + 1]] for c in cells]
        scans.append(_who(np.concatenate([*by, np.empty(0, np.int32)]), len(cells)))
    return Rooms(
        polygons=polygons,
        floor_m=np.array(floors, float),
        ceiling_m=np.array(ceilings, float),
        seen=seen,
        walled=np.array([f[2] for f in found], float),
        scans=tuple(scans),
    )


def _middle(heights: NDArray[np.float64]) -> float:
    heights = heights[np.isfinite(heights)]
    return float(np.median(heights)) if len(heights) else np.nan


def _who(scans: NDArray[np.int32], cells: int) -> tuple[int, ...]:
    """Return the scans that saw at least a twentieth of a room's seen cells: not those that only
    looked in through the door."""
    who, counts = np.unique(scans, return_counts=True)
    return tuple(int(s) for s in who[counts >= 0.05 * cells])
