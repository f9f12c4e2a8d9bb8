"""Doors and windows against each other: on the plane of their wall, and by the rooms they link."""

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import STRtree

from storage.plan import PlanOpening
from tasks.evaluation.matching import Pairs


def along_wall(
    found: Sequence[PlanOpening], true: Sequence[PlanOpening], off_wall_m: float
) -> tuple[Pairs, Pairs]:
    """Return the pairs that overlap on the true opening's wall plane, with their IoU there.

    An opening is its interval along the wall, from sill to head. A found one is put on the plane
    of the true one if both its ends are within `off_wall_m` of it.

    Returns
    -------
    widths, faces : Pairs
        With the IoU of the intervals along the wall alone, and with that of the rectangles. One
        whose sill or head is unknown is in no pair of rectangles.
    """
    lines = np.array([opening.line for opening in found], object)
    others = np.array([opening.line for opening in true], object)
    j, i = STRtree(lines).query(others, predicate="dwithin", distance=off_wall_m)
    a, b = ends(found)[i], ends(true)[j]
    width = np.linalg.norm(b[:, 1] - b[:, 0], axis=1)
    axis = (b[:, 1] - b[:, 0]) / np.maximum(width, 1e-12)[:, None]
    from_start = a - b[:, :1]
    along = np.einsum("pek,pk->pe", from_start, axis)
    off = np.abs(from_start[..., 0] * axis[:, None, 1] - from_start[..., 1] * axis[:, None, 0])
    shared = np.minimum(along.max(axis=1), width) - np.maximum(along.min(axis=1), 0)
    shared = np.maximum(shared, 0)
    found_width = np.ptp(along, axis=1)
    on_plane = (off <= off_wall_m).all(axis=1) & (shared > 0)

    z, true_z = extents(found)[i], extents(true)[j]
    height = np.minimum(z[:, 1], true_z[:, 1]) - np.maximum(z[:, 0], true_z[:, 0])
    both = shared * np.maximum(height, 0)
    areas = found_width * np.ptp(z, axis=1) + width * np.ptp(true_z, axis=1)
    widths = Pairs(i, j, shared / np.maximum(width + found_width - shared, 1e-12))
    faces = Pairs(i, j, both / np.maximum(areas - both, 1e-12))
    # NaN, a height that nobody knows, is not greater than zero
    return widths.at(on_plane), faces.at(on_plane & (faces.values > 0))


def linking(
    found: Sequence[PlanOpening], true: Sequence[PlanOpening], true_room: Mapping[str, str]
) -> Pairs:
    """Return the pairs of doors that link the same two rooms, with the metres between them.

    A door that names one room leads outside; one that names none is in no pair, and so is one of a
    found room that is no true room.

    Parameters
    ----------
    true_room : true room of each found room that has one
    """
    of_rooms = defaultdict(list)
    for j, door in enumerate(true):
        if door.rooms:
            of_rooms[frozenset(door.rooms)].append(j)
    pairs = [
        (i, j)
        for i, door in enumerate(found)
        if door.rooms and all(room in true_room for room in door.rooms)
        for j in of_rooms.get(frozenset(true_room[room] for room in door.rooms), ())
    ]
    ours, theirs = np.array(pairs, np.int64).reshape(-1, 2).T
    apart = ends(found)[ours].mean(axis=1) - ends(true)[theirs].mean(axis=1)
    return Pairs(ours, theirs, np.linalg.norm(apart, axis=1))


def ends(openings: Sequence[PlanOpening]) -> NDArray[np.float64]:
    """Return the two ends of each opening's line, (n, 2, 2)."""
    lines = np.array([opening.line for opening in openings], object)
    first, last = shapely.get_point(lines, 0), shapely.get_point(lines, -1)
    both = [shapely.get_coordinates(points).reshape(-1, 2) for points in (first, last)]
    return np.stack(both, axis=1)


def extents(openings: Sequence[PlanOpening]) -> NDArray[np.float64]:
    """Return sill and head, (n, 2), NaN where unknown."""
    return np.array([(o.sill_m, o.head_m) for o in openings], float).reshape(-1, 2)
