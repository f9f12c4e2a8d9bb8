"""A mapped storey against a true one, object by object: matches, misses and false finds.

Nothing is ever aligned: what was mapped is taken where it lies in the building frame. True objects
that do not say what a metric compares (a door's height, the rooms it links) are left out of it, and
so is what was found in their place; a metric of which no true object says it has no rows. Found
objects that do not say it are false.
"""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from storage import detections as stored
from storage.detections import Detections
from storage.plan import Plan, PlanOpening
from storage.plan_geojson import read_plan
from storage.sources import Source
from tasks.evaluation.corners import corners
from tasks.evaluation.furniture import boxes, extents, footprints
from tasks.evaluation.matching import Pairs, most_overlapping, nearest, overlapping, within
from tasks.evaluation.objects import Objects, outcomes
from tasks.evaluation.openings import along_wall, linking
from tasks.evaluation.openings import extents as opening_extents
from tasks.evaluation.walls import both_ends, wall_ends
from tasks.params import Params

Share = Annotated[float, Field(ge=0, lt=1)]
Part = dict[str, NDArray[Any]]
"""The columns of one class, metric and threshold."""


class EvaluationParams(Params):
    """What counts as found."""

    room_iou: tuple[Share, ...] = (0.0, 0.5)
    """IoU of two rooms to be exceeded: 0 for the error of areas (Sec. 7.3), which must not leave
    the worst rooms out; 0.5 as Floor-SP and RoomFormer."""
    corner_m: tuple[PositiveFloat, ...] = (0.1, 0.2)
    """Greatest distance of two corners, metres (SLIBO-Net: Corner@0.1 m)."""
    wall_m: tuple[PositiveFloat, ...] = (0.05, 0.1, 0.2)
    """Greatest distance of two walls' ends, metres (CV4AEC)."""
    opening_iou: tuple[Share, ...] = (0.5,)
    """IoU of two doors or windows on the wall plane to be exceeded (SpatialLM)."""
    off_wall_m: PositiveFloat = 0.3
    """Greatest distance of a found opening from the true one's wall plane, metres: half a thick
    wall and what noise adds. Assumption."""
    link_iou: Share = 0.5
    """IoU of two rooms to be exceeded for a door of the one to be a door of the other (Room++)."""
    footprint_iou: tuple[Share, ...] = (0.25, 0.5)
    """IoU of two footprints of furniture to be exceeded (SpatialLM)."""
    box_iou: tuple[Share, ...] = (0.25, 0.3, 0.5)
    """IoU of two upright boxes of furniture to be exceeded (0.3: RoomPlan)."""


def evaluate_plans(found: Source, truth: Source, params: EvaluationParams) -> Detections:
    """Return what a plan has found of a true plan, both GeoJSON.

    Raises
    ------
    InputError
        Naming the file, feature and field that is wrong.
    """
    return detect(read_plan(Path(found.path)), read_plan(Path(truth.path)), params)


def detect(found: Plan, truth: Plan, params: EvaluationParams) -> Detections:
    """Return what a plan has found of a true plan, per class, metric and threshold.

    Matches are one-to-one and optimal among the pairs that pass the threshold: of the greatest sum
    of IoU; for distances, as many as there can be and of those the least sum.
    """
    parts = [
        *_rooms(found, truth, params),
        *_corners(found, truth, params),
        *_walls(found, truth, params),
        *_openings("door", found.doors, truth.doors, params),
        *_links(found, truth, params),
        *_openings("window", found.windows, truth.windows, params),
        *_furniture(found, truth, params),
    ]
    n = sum(len(part["classes"]) for part in parts)
    simulated = np.full(n, found.simulated or truth.simulated)
    names = [field.name for field in fields(Detections) if field.name != "simulated"]
    joined = {name: np.concatenate([part[name] for part in parts]) for name in names}
    return Detections(simulated=simulated, **joined)


def _rooms(found: Plan, truth: Plan, params: EvaluationParams) -> list[Part]:
    a, b = Objects.of_rooms(found.rooms), Objects.of_rooms(truth.rooms)
    pairs = overlapping([r.polygon for r in found.rooms], [r.polygon for r in truth.rooms])
    same = pairs.at(_of_one_class(pairs, a, b))
    parts = [
        outcomes("room", stored.IOU, limit, a, b, most_overlapping(pairs, limit))
        for limit in params.room_iou
    ]
    classed = np.flatnonzero(b.classes != "")
    if len(classed) or not len(b):
        for limit in params.room_iou:
            ours = _judged(a, most_overlapping(pairs, limit), classed)
            taken = most_overlapping(same, limit)
            parts.append(outcomes("room", stored.IOU_CLASS, limit, a, b, taken, classed, ours))
    return parts


def _corners(found: Plan, truth: Plan, params: EvaluationParams) -> list[Part]:
    (a, a_xy), (b, b_xy) = corners(found), corners(truth)
    pairs = within(a_xy, b_xy, max(params.corner_m, default=0.0))
    return _near("corner", Objects.of_ids(a), Objects.of_ids(b), pairs, params.corner_m)


def _walls(found: Plan, truth: Plan, params: EvaluationParams) -> list[Part]:
    a, b = wall_ends(found.walls), wall_ends(truth.walls)
    reach = max(params.wall_m, default=0.0)
    walls = [Objects.of_ids([wall.id for wall in plan.walls]) for plan in (found, truth)]
    ends = [
        Objects.of_ids([f"{wall.id}/{end}" for wall in plan.walls for end in (0, 1)])
        for plan in (found, truth)
    ]
    points = within(a.reshape(-1, 2), b.reshape(-1, 2), reach)
    return [
        *_near("wall", walls[0], walls[1], both_ends(a, b, reach), params.wall_m),
        *_near("wall_end", ends[0], ends[1], points, params.wall_m),
    ]


def _near(
    class_: str, a: Objects, b: Objects, pairs: Pairs, limits_m: Sequence[float]
) -> list[Part]:
    return [
        outcomes(class_, stored.DISTANCE, limit, a, b, nearest(pairs, limit)) for limit in limits_m
    ]


def _openings(
    class_: str,
    found: Sequence[PlanOpening],
    true: Sequence[PlanOpening],
    params: EvaluationParams,
) -> list[Part]:
    a, b = Objects.of_openings(found), Objects.of_openings(true)
    widths, rectangles = along_wall(found, true, params.off_wall_m)
    parts = [
        outcomes(class_, stored.IOU_WIDTH, limit, a, b, most_overlapping(widths, limit))
        for limit in params.opening_iou
    ]
    tall = np.flatnonzero(~np.isnan(opening_extents(true)).any(axis=1))
    if len(tall) or not len(b):
        for limit in params.opening_iou:
            ours = _judged(a, most_overlapping(widths, limit), tall)
            taken = most_overlapping(rectangles, limit)
            parts.append(outcomes(class_, stored.IOU, limit, a, b, taken, tall, ours))
    return parts


def _links(found: Plan, truth: Plan, params: EvaluationParams) -> list[Part]:
    a, b = Objects.of_openings(found.doors), Objects.of_openings(truth.doors)
    linking_doors = np.flatnonzero(np.array([bool(door.rooms) for door in truth.doors], bool))
    if len(b) and not len(linking_doors):
        return []
    rooms = overlapping([r.polygon for r in found.rooms], [r.polygon for r in truth.rooms])
    same = most_overlapping(rooms, params.link_iou)
    true_room = {
        found.rooms[i].id: truth.rooms[j].id for i, j in zip(same.found, same.true, strict=True)
    }
    pairs = linking(found.doors, truth.doors, true_room)
    taken = nearest(pairs, float(pairs.values.max(initial=0.0)) + 1)
    widths, _ = along_wall(found.doors, truth.doors, params.off_wall_m)
    ours = _judged(a, most_overlapping(widths, params.link_iou), linking_doors)
    return [outcomes("door", stored.LINKS, params.link_iou, a, b, taken, linking_doors, ours)]


def _furniture(found: Plan, truth: Plan, params: EvaluationParams) -> list[Part]:
    a, b = Objects.of_furniture(found.furniture), Objects.of_furniture(truth.furniture)
    flat = footprints(found.furniture, truth.furniture)
    solid = boxes(found.furniture, truth.furniture, flat)
    tall = np.flatnonzero(~np.isnan(extents(truth.furniture)).any(axis=1))
    parts = []
    for class_ in ("furniture", *sorted((set(a.classes) | set(b.classes)) - {""})):
        ours, theirs = a.of_class(class_), b.of_class(class_)
        flat_ours = _between(flat, ours, theirs)
        parts += [
            outcomes(
                class_, stored.IOU, limit, a, b, most_overlapping(flat_ours, limit), theirs, ours
            )
            for limit in params.footprint_iou
        ]
        judged = np.intersect1d(theirs, tall)
        if len(theirs) and not len(judged):
            continue
        solid_ours = _between(solid, ours, judged)
        for limit in params.box_iou:
            kept = np.intersect1d(ours, _judged(a, most_overlapping(flat_ours, limit), judged))
            taken = most_overlapping(solid_ours, limit)
            parts.append(outcomes(class_, stored.IOU_3D, limit, a, b, taken, judged, kept))
    return parts


def _of_one_class(pairs: Pairs, a: Objects, b: Objects) -> NDArray[np.bool_]:
    classes = b.classes[pairs.true]
    return (a.classes[pairs.found] == classes) & (classes != "")


def _between(pairs: Pairs, found: NDArray[np.int64], true: NDArray[np.int64]) -> Pairs:
    return pairs.at(np.isin(pairs.found, found) & np.isin(pairs.true, true))


def _judged(found: Objects, plain: Pairs, true: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the found objects but those in place of a true one that is left out.

    Parameters
    ----------
    plain : the matches by position alone
    true : the true objects that are not left out
    """
    return np.setdiff1d(np.arange(len(found)), plain.found[~np.isin(plain.true, true)])
