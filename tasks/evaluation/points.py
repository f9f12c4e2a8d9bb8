"""Labelled points against a found plan: measures that need no outline of the truth."""

from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import PositiveFloat
from shapely import STRtree

from storage.plan import Plan, PlanOpening
from storage.plan_geojson import read_plan
from storage.point_quality import PointQuality
from storage.sources import Source
from tasks.evaluation.label_files import (
    CEILING,
    CHAIR,
    DOOR,
    FLOOR,
    OTHER,
    ROLES,
    TABLE,
    WALL,
    WINDOW,
    LabelledPoints,
    read_labels,
)
from tasks.evaluation.objects import ANY
from tasks.evaluation.walls import faces
from tasks.params import Params

CLASSES = (DOOR, WINDOW, FLOOR, CEILING, WALL, ANY)
"""What a plan says a point is: the first of these whose surface it lies on. An opening is part of
its wall; what stands at a wall or on the floor touches it."""
FURNITURE = (TABLE, CHAIR, OTHER)


class PointQualityParams(Params):
    """When a point lies on a surface."""

    buffers_m: tuple[PositiveFloat, ...] = (0.05, 0.1)
    """Greatest distance of a point from a surface it lies on, metres. Not in the paper; 10 cm as
    the buffer of the ISPRS benchmark on indoor modelling, 5 cm half of it."""
    cell_m: PositiveFloat = 0.05
    """Edge of the cubes of which each gives one point a class, metres: points stand for area.
    Assumption."""


def evaluate_points(found: Source, labels: Source, params: PointQualityParams) -> PointQuality:
    """Return how much of labelled points a GeoJSON plan explains; labels as in `read_labels`.

    `labels.sha256` has to be of all files of `label_files`, not of the one that names them.

    Raises
    ------
    InputError
        Naming the file and field that is wrong.
    """
    return compare_points(read_plan(Path(found.path)), read_labels(Path(labels.path)), params)


def compare_points(found: Plan, truth: LabelledPoints, params: PointQualityParams) -> PointQuality:
    """Return completeness and intersection over union of points by class and distance.

    Notes
    -----
    Nothing is aligned. Completeness of a class is the share of its points within the distance of a
    found surface of it. For the intersection over union every labelled point, clutter too, is given
    one class by the plan, the first of CLASSES whose surface it lies on, and is compared with its
    label.

    Surfaces: floors and ceilings within their rooms, wall faces between base and top (any height
    where these are unknown), the strip of wall in a door or window from sill to head, the boxes of
    furniture. What the plan does not say the height of (a floor, a door's head) is not there.
    """
    true, xyz = _evened(truth, params.cell_m)
    rows = [
        (class_, buffer, *_counts(on[class_], said == class_, true == class_))
        for buffer in params.buffers_m
        for on in [_on(found, xyz, buffer)]
        for said in [_said(on, len(xyz))]
        for class_ in CLASSES
    ]
    n = len(rows)
    counts = np.array([row[2:] for row in rows], np.int64).reshape(n, 4)
    n_true, n_near, n_found, n_matched = counts.T
    return PointQuality(
        simulated=np.full(n, found.simulated or truth.simulated),
        classes=np.array([row[0] for row in rows], np.str_),
        buffer_m=np.array([row[1] for row in rows], float),
        true_points=n_true,
        near_points=n_near,
        found_points=n_found,
        matched_points=n_matched,
        completeness=_ratio(n_near, n_true),
        iou=_ratio(n_matched, n_true + n_found - n_matched),
    )


def _counts(
    on: NDArray[np.bool_], said: NDArray[np.bool_], true: NDArray[np.bool_]
) -> tuple[int, int, int, int]:
    return int(true.sum()), int((true & on).sum()), int(said.sum()), int((true & said).sum())


def _ratio(part: NDArray[np.int64], whole: NDArray[np.int64]) -> NDArray[np.float64]:
    return np.where(whole > 0, part / np.maximum(whole, 1), np.nan)


def _evened(truth: LabelledPoints, cell_m: float) -> tuple[NDArray[np.str_], NDArray[np.float64]]:
    """Return class and place of the first point of each class in each cube."""
    named = np.array([ANY if role in FURNITURE else role for role in ROLES] + [""])
    if not len(truth):
        return np.empty(0, named.dtype), truth.xyz
    cells = np.column_stack([np.floor(truth.xyz / cell_m).astype(np.int64), truth.roles])
    cells -= cells.min(axis=0)
    numbers = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
    first = np.unique(numbers, return_index=True)[1]
    return named[truth.roles[first]], truth.xyz[first]


def _said(on: dict[str, NDArray[np.bool_]], n: int) -> NDArray[np.str_]:
    return np.select([on[class_] for class_ in CLASSES], CLASSES, default="").reshape(n)


def _on(plan: Plan, xyz: NDArray[np.float64], buffer_m: float) -> dict[str, NDArray[np.bool_]]:
    """Return by class which points lie on one of its surfaces."""
    at, z = shapely.points(xyz[:, :2]), xyz[:, 2]
    thickness = {wall.id: wall.thickness_m or 0.0 for wall in plan.walls}
    rooms = np.array([room.polygon for room in plan.rooms], object)
    levels = np.array([(r.floor_m, r.ceiling_m) for r in plan.rooms], float).reshape(-1, 2)
    point, room = STRtree(at).query(shapely.buffer(rooms, buffer_m), predicate="intersects")[::-1]
    flat = np.abs(z[point, None] - levels[room]) <= buffer_m
    pieces = np.array([piece.footprint for piece in plan.furniture], object)
    heights = np.array([(p.base_m, p.top_m) for p in plan.furniture], float).reshape(-1, 2)
    return {
        DOOR: _in_openings(at, z, plan.doors, thickness, buffer_m),
        WINDOW: _in_openings(at, z, plan.windows, thickness, buffer_m),
        FLOOR: _marked(point[flat[:, 0]], len(z)),
        CEILING: _marked(point[flat[:, 1]], len(z)),
        WALL: _on_walls(at, z, plan, buffer_m),
        ANY: _within(at, z, shapely.buffer(pieces, buffer_m), heights, buffer_m),
    }


def _on_walls(
    at: NDArray[np.object_], z: NDArray[np.float64], plan: Plan, buffer_m: float
) -> NDArray[np.bool_]:
    lines = faces(plan.walls)
    of = np.repeat(np.arange(len(plan.walls)), [2 if w.thickness_m else 1 for w in plan.walls])
    heights = np.array([(w.base_m, w.top_m) for w in plan.walls], float).reshape(-1, 2)[of]
    # unknown is any height, of a wall alone: many plans draw walls flat
    heights = np.where(np.isnan(heights), [-np.inf, np.inf], heights)
    line, point = STRtree(at).query(lines, predicate="dwithin", distance=buffer_m)
    return _marked(point[_between(z[point], heights[line], buffer_m)], len(z))


def _in_openings(
    at: NDArray[np.object_],
    z: NDArray[np.float64],
    openings: tuple[PlanOpening, ...],
    thickness_m: dict[str, float],
    buffer_m: float,
) -> NDArray[np.bool_]:
    lines = np.array([opening.line for opening in openings], object)
    half = np.array([thickness_m.get(o.wall or "", 0.0) / 2 for o in openings], float)
    heights = np.array([(o.sill_m, o.head_m) for o in openings], float).reshape(-1, 2)
    strips = shapely.buffer(lines, half + buffer_m, cap_style="flat")
    return _within(at, z, strips, heights, buffer_m)


def _within(
    at: NDArray[np.object_],
    z: NDArray[np.float64],
    areas: NDArray[np.object_],
    heights: NDArray[np.float64],
    buffer_m: float,
) -> NDArray[np.bool_]:
    """Return which points lie over one of some areas, between its heights or the buffer beyond."""
    area, point = STRtree(at).query(areas, predicate="intersects")
    return _marked(point[_between(z[point], heights[area], buffer_m)], len(z))


def _between(
    z: NDArray[np.float64], heights: NDArray[np.float64], buffer_m: float
) -> NDArray[np.bool_]:
    return (z >= heights[:, 0] - buffer_m) & (z <= heights[:, 1] + buffer_m)


def _marked(which: NDArray[np.int64], n: int) -> NDArray[np.bool_]:
    marked = np.zeros(n, bool)
    marked[which] = True
    return marked
