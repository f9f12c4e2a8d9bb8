"""Planes found in one scan against the true surfaces it shows."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat
from shapely import Polygon

from storage.plan import Plan, PlanFurniture, PlanOpening
from storage.plan_geojson import read_plan
from storage.plane_detections import PlaneDetections
from storage.points import PointCloud
from storage.segments import KINDS, Segments
from storage.sources import Source
from tasks.evaluation.matching import Pairs, assign
from tasks.evaluation.surfaces import Surface, true_surfaces
from tasks.params import Params

BLOCK_M = 1.0
"""Edge of the columns of space that points are looked up by."""
Share = Annotated[float, Field(ge=0, le=1)]


class PlaneQualityParams(Params):
    """When a found plane is a true one."""

    angle_rad: Annotated[float, Field(gt=0, le=pi)] = 0.0873
    """Greatest angle between the normals, radians: 5 degrees. Not in the paper."""
    offset_m: PositiveFloat = 0.05
    """Greatest distance of the planes in the middle of what both cover, metres: less than half of
    a thin wall, so that its two sides are two. Not in the paper."""
    overlap: Share = 0.5
    """Least share of the smaller of the two areas that both cover. Assumption."""
    least_m2: PositiveFloat = 0.5
    """Smaller surfaces and segments are not compared, square metres. Assumption."""
    seen: Share = 0.3
    """Least share of a true surface with points for it to be there to be found. Assumption."""
    cell_m: PositiveFloat = 0.1
    """Edge of the cells by which that share is counted, metres. Assumption."""
    off_wall_m: PositiveFloat = 0.3
    """Greatest distance of an opening's line from the face it is cut out of, metres: a thick wall's
    half. Assumption."""
    near_m: Annotated[float, Field(ge=0)] = 0.2
    """A segment whose middle lies in a piece of furniture grown by this, metres, or that is no
    larger than an opening grown by it and lies where its leaf or pane may be, is of that: true,
    but no surface of a room. A frame, and a cell by which hulls are grown. Assumption."""


def evaluate_planes(
    points: PointCloud, segments: Segments, truth: Source, params: PlaneQualityParams
) -> PlaneDetections:
    """Return which true surfaces of a GeoJSON plan one scan's segments are.

    Raises
    ------
    InputError
        Naming the file, feature and field that is wrong.
    """
    xyz = points.xyz.astype(np.float64) + points.origin
    return match_planes(xyz, segments, read_plan(Path(truth.path)), params)


def match_planes(
    xyz: NDArray[np.float64], segments: Segments, truth: Plan, params: PlaneQualityParams
) -> PlaneDetections:
    """Return which true surfaces the segments of a scan are.

    Parameters
    ----------
    xyz : (n, 3) float
        The scan's points, metres, building frame: they say which surfaces it shows.
    segments : vertical and horizontal ones are compared; the method makes no use of clutter

    Notes
    -----
    A segment may be a surface if their normals (of a segment whose side is known: not turned
    about), their distance and what they cover agree; among these, matches are one-to-one and of the
    greatest sum of intersection over union. A surface of which the scan shows too little is not
    missed, but may be found. Segments of furniture, door leaves, window panes and reveals are left
    out; whatever else is flat and no surface of a room is falsely found. Nothing is aligned.
    """
    surfaces = _in_reach(true_surfaces(truth, params.least_m2, params.off_wall_m), xyz, params)
    cells = _Blocks.of(_cells(xyz, params.cell_m))
    seen = np.array([_seen(surface, cells, params) for surface in surfaces], float)
    compared = np.flatnonzero(
        (segments.kinds != KINDS.index("clutter")) & (segments.areas >= params.least_m2)
    )
    outlines = {int(i): _outline(segments, int(i)) for i in compared}
    pairs, angles, offsets = _candidates(segments, outlines, surfaces, params)
    kept = assign(pairs, pairs.values)
    taken = pairs.at(kept)
    missed = np.setdiff1d(np.flatnonzero(seen >= params.seen), taken.true)
    unasked = [i for i in outlines if _is_in_room(outlines[i], truth, params)]
    false = np.setdiff1d(np.setdiff1d(compared, taken.found), unasked)
    more = _best(pairs)
    return _rows(
        surfaces,
        segments,
        i=np.concatenate([taken.found, np.full(len(missed), -1), false]),
        j=np.concatenate([taken.true, missed, np.full(len(false), -1)]),
        part_of=[surfaces[more[int(i)]].id if int(i) in more else "" for i in false],
        matched={"angle_rad": angles[kept], "offset_m": offsets[kept], "iou": taken.values},
        seen=seen,
        simulated=truth.simulated,
    )


def _rows(
    surfaces: Sequence[Surface],
    segments: Segments,
    i: NDArray[np.int64],
    j: NDArray[np.int64],
    part_of: list[str],
    matched: dict[str, NDArray[np.float64]],
    seen: NDArray[np.float64],
    simulated: bool,
) -> PlaneDetections:
    nothing = np.full(len(i) - len(matched["iou"]), np.nan)
    kinds = np.array([*KINDS, ""])[np.append(segments.kinds, len(KINDS))][i]
    classes = np.array([*(s.class_ for s in surfaces), ""])[j]
    columns: dict[str, Any] = {
        name: np.concatenate([values, nothing]) for name, values in matched.items()
    }
    return PlaneDetections(
        simulated=np.full(len(i), simulated),
        classes=np.where(j >= 0, classes, kinds),
        true_ids=np.array([*(s.id for s in surfaces), ""])[j],
        found=i,
        part_of=np.array([""] * (len(i) - len(part_of)) + part_of, np.str_),
        true_m2=np.array([*(s.area.area for s in surfaces), np.nan])[j],
        seen=np.append(seen, np.nan)[j],
        found_m2=np.append(segments.areas, np.nan)[i],
        **columns,
    )


def _in_reach(
    surfaces: Sequence[Surface], xyz: NDArray[np.float64], params: PlaneQualityParams
) -> list[Surface]:
    """Return the surfaces a scan may have a point on: of a storey's, few are one scan's."""
    if not len(xyz):
        return []
    low, high = xyz.min(axis=0) - params.offset_m, xyz.max(axis=0) + params.offset_m
    boxes = [_bounds(surface) for surface in surfaces]
    return [
        surface
        for surface, (least, most) in zip(surfaces, boxes, strict=True)
        if np.all(least <= high) and np.all(most >= low)
    ]


def _cells(xyz: NDArray[np.float64], cell_m: float) -> NDArray[np.float64]:
    """Return one point, (m, 3), of each cube that holds some; a third of a cell is fine enough."""
    if not len(xyz):
        return xyz
    at = np.floor(xyz / (cell_m / 3)).astype(np.int64)
    at -= at.min(axis=0)
    # one number a cell: rows of three take numpy ten times as long
    numbers = np.ravel_multi_index(tuple(at.T), tuple(at.max(axis=0) + 1))
    return xyz[np.unique(numbers, return_index=True)[1]]


@dataclass(frozen=True, eq=False)
class _Blocks:
    """A scan's points by upright columns of space: those near a surface without asking all."""

    xyz: NDArray[np.float64]
    """(n, 3), by column: in the order of x, then of y"""
    columns: NDArray[np.int64]
    """(n,), the number of each point's column"""
    first: NDArray[np.int64]
    """(2,), the first column along x and y"""
    across: int
    """columns along y"""

    @classmethod
    def of(cls, xyz: NDArray[np.float64]) -> "_Blocks":
        """Return points sorted into columns."""
        at = np.floor(xyz[:, :2] / BLOCK_M).astype(np.int64)
        first = at.min(axis=0, initial=0)
        at -= first
        across = int(at[:, 1].max(initial=0)) + 1
        columns = at[:, 0] * across + at[:, 1]
        order = np.argsort(columns, kind="stable")
        return cls(xyz[order], columns[order], first, across)

    def within(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points, (m, 3), of a box."""
        (x0, y0), (x1, y1) = (
            np.floor(p[:2] / BLOCK_M).astype(int) - self.first for p in (low, high)
        )
        y0, y1 = max(y0, 0), min(y1, self.across - 1)
        rows = np.arange(max(x0, 0), x1 + 1) * self.across
        starts = np.searchsorted(self.columns, rows + y0, "left")
        stops = np.searchsorted(self.columns, rows + y1, "right")
        parts = [self.xyz[i:j] for i, j in zip(starts, stops, strict=True)]
        near = np.concatenate([np.empty((0, 3)), *parts])
        return near[np.all((near >= low) & (near <= high), axis=1)]


def _seen(surface: Surface, points: _Blocks, params: PlaneQualityParams) -> float:
    """Return the share of a surface's cells in which the scan has a point on it."""
    size, reach = params.cell_m, params.offset_m
    low, high = _bounds(surface)
    near = points.within(low - reach, high + reach)
    near = near[np.abs((near - surface.origin) @ surface.normal) <= reach]
    a0, b0, a1, b1 = surface.area.bounds
    a, b = np.meshgrid(np.arange(a0 + size / 2, a1, size), np.arange(b0 + size / 2, b1, size))
    inside = shapely.contains_xy(surface.area, a, b)
    rows, columns = inside.shape
    at = np.floor((surface.flattened(near) - (a0, b0)) / size).astype(np.int64)
    at = at[np.all((at >= 0) & (at < (columns, rows)), axis=1)]
    hit = np.zeros(inside.shape, bool)
    hit[at[:, 1], at[:, 0]] = True
    return float((hit & inside).sum() / max(inside.sum(), 1))


def _bounds(surface: Surface) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    a0, b0, a1, b1 = surface.area.bounds
    corners = [surface.at(np.array(ab)) for ab in ((a0, b0), (a0, b1), (a1, b0), (a1, b1))]
    return np.min(corners, axis=0), np.max(corners, axis=0)


def _outline(segments: Segments, i: int) -> NDArray[np.object_]:
    """Return the rings of a segment's hull as arrays of points in the building frame, (n, 3)."""
    hull = shapely.from_wkb(segments.hulls[i])
    normal, offset = segments.normals[i], segments.offsets[i]
    rings = np.empty(1 + len(hull.interiors), object)
    for k, ring in enumerate((hull.exterior, *hull.interiors)):
        ab = shapely.get_coordinates(ring)
        if segments.kinds[i] == KINDS.index("vertical"):
            start, stop = segments.lines[i]
            along = (stop - start) / np.hypot(*(stop - start))
            rings[k] = np.column_stack([start + ab[:, :1] * along, ab[:, 1]])
        else:
            rings[k] = np.column_stack([ab, (offset - ab @ normal[:2]) / normal[2]])
    return rings


def _candidates(
    segments: Segments,
    outlines: dict[int, NDArray[np.object_]],
    surfaces: Sequence[Surface],
    params: PlaneQualityParams,
) -> tuple[Pairs, NDArray[np.float64], NDArray[np.float64]]:
    """Return the pairs that may be one, with the IoU of their areas, their angles and offsets."""
    normals = np.array([surface.normal for surface in surfaces]).reshape(-1, 3)
    boxes = np.array([_bounds(surface) for surface in surfaces]).reshape(-1, 2, 3)
    found: list[tuple[int, int, float, float, float]] = []
    for i, rings in outlines.items():
        # arccos loses half the digits of small angles: by the chord instead
        normal, offset = segments.normals[i], float(segments.offsets[i])
        turned = np.sign(normals @ normal)
        if segments.side_known[i]:
            turned = np.ones(len(normals))
        chords = np.linalg.norm(normals * turned[:, None] - normal, axis=1)
        angles = 2 * np.arcsin(np.minimum(chords / 2, 1.0))
        # in the middle of what both cover they are no further apart than that
        low, high = rings[0].min(axis=0) - params.offset_m, rings[0].max(axis=0) + params.offset_m
        meet = np.all((boxes[:, 0] <= high) & (boxes[:, 1] >= low), axis=1)
        for j in np.flatnonzero(meet & (angles <= params.angle_rad)).tolist():
            shared, iou = _shared(rings, surfaces[j], params.overlap)
            if shared is None:
                continue
            place = surfaces[j].at(shapely.get_coordinates(shared.centroid)[0])
            apart = float(place @ normal - offset) * float(turned[j])
            if abs(apart) <= params.offset_m:
                found.append((i, j, iou, float(angles[j]), apart))
    rows = np.array(found, float).reshape(-1, 5)
    pairs = Pairs(rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64), rows[:, 2])
    return pairs, rows[:, 3], rows[:, 4]


def _shared(
    rings: NDArray[np.object_], surface: Surface, least: float
) -> tuple[Polygon | None, float]:
    """Return what a segment and a surface both cover on the surface's plane, and their IoU."""
    outer, *holes = (surface.flattened(ring) for ring in rings)
    hull = Polygon(outer, holes).buffer(0)
    both = hull.intersection(surface.area)
    if both.area == 0 or both.area < least * min(hull.area, surface.area.area):
        return None, 0.0
    return both, both.area / (hull.area + surface.area.area - both.area)


def _best(pairs: Pairs) -> dict[int, int]:
    """Return the surface each segment is most of."""
    order = np.argsort(pairs.values, kind="stable")
    return {int(pairs.found[k]): int(pairs.true[k]) for k in order}


def _is_in_room(rings: NDArray[np.object_], truth: Plan, params: PlaneQualityParams) -> bool:
    """Return whether a segment is of what stands in rooms or fills openings."""
    low, high = rings[0].min(axis=0), rings[0].max(axis=0)
    middle = shapely.Point((low + high)[:2] / 2)
    z = float(low[2] + high[2]) / 2
    size = float(np.hypot(*(high - low)[:2]))
    return any(_holds(piece, middle, z, params.near_m) for piece in truth.furniture) or any(
        _is_filled(opening, middle, (float(low[2]), float(high[2])), size, params)
        for opening in (*truth.doors, *truth.windows)
    )


def _holds(piece: PlanFurniture, middle: shapely.Point, z: float, grow_m: float) -> bool:
    return (
        bool(piece.footprint.distance(middle) <= grow_m)
        and (piece.base_m is None or piece.base_m - grow_m <= z)
        and (piece.top_m is None or z <= piece.top_m + grow_m)
    )


def _is_filled(
    opening: PlanOpening,
    middle: shapely.Point,
    heights: tuple[float, float],
    size_m: float,
    params: PlaneQualityParams,
) -> bool:
    """Return whether something of this middle, heights and size may be an opening's leaf or pane.

    The middle of an open leaf is half the opening's width from its hinge at the wall's face.
    """
    width, grow = opening.line.length, params.near_m
    return (
        size_m <= width + 2 * grow
        and bool(opening.line.distance(middle) <= width / 2 + params.off_wall_m)
        and (opening.sill_m is None or heights[0] >= opening.sill_m - grow)
        and (opening.head_m is None or heights[1] <= opening.head_m + grow)
    )
