"""Mapped rooms against true ones: matched one to one, with the error of their areas (Sec. 7.3)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from storage.errors import MapSenseError
from storage.plan_geojson import read_plan
from storage.room_errors import RoomErrors
from storage.rooms import Rooms
from storage.sources import Source
from tasks.evaluation.matching import Pairs, most_overlapping, overlapping
from tasks.params import Params


class EvaluateParams(Params):
    """What is compared."""

    rooms: tuple[str, ...] | None = None
    """Ids of the true rooms asked for; None: all. A scan answers a query for one room."""


def room_errors(rooms: Rooms, truth: Source, params: EvaluateParams) -> RoomErrors:
    """Return the error of each true room's area, matched one to one at the greatest IoU in all.

    Nothing is aligned: what was mapped is taken where it lies in the building frame.

    Raises
    ------
    MapSenseError
        If the truth has no room of a name asked for.
    """
    plan = read_plan(Path(truth.path))
    known = {room.id: room for room in plan.rooms}
    asked = list(known) if params.rooms is None else list(params.rooms)
    if unknown := [name for name in asked if name not in known]:
        raise MapSenseError(f"{truth.path}: has no room '{unknown[0]}'; it has {', '.join(known)}")
    true = [known[name].polygon for name in asked]
    overlap = ious(list(rooms.polygons), true)
    partner = match(overlap)
    areas = np.append(shapely.area(rooms.polygons.astype(object)), np.nan)
    true_m2, found_m2 = np.array([p.area for p in true], float), areas[partner]
    best = np.append(overlap, np.zeros((1, len(true))), axis=0)[partner, np.arange(len(true))]
    return RoomErrors(
        rooms=np.array(asked, np.str_),
        classes=np.array([known[name].class_ or "" for name in asked], np.str_),
        true_m2=true_m2,
        found_m2=found_m2,
        error_m2=np.abs(true_m2 - found_m2),
        iou=best,
    )


def ious(found: Sequence[Polygon], true: Sequence[Polygon]) -> NDArray[np.float64]:
    """Return the intersection over union of every pair, (f, t)."""
    pairs = overlapping(found, true)
    values = np.zeros((len(found), len(true)))
    values[pairs.found, pairs.true] = pairs.values
    return values


def match(overlap: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the partner of each column, (t,), -1 for none, of the greatest sum (Hungarian).

    Pairs that do not overlap are none.
    """
    partner = np.full(overlap.shape[1], -1)
    i, j = np.nonzero(overlap)
    taken = most_overlapping(Pairs(i, j, overlap[i, j]), 0)
    partner[taken.true] = taken.found
    return partner
