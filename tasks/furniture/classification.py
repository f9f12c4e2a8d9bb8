"""From segments to furniture: a forest names them, and one object keeps one box (Sec. 6)."""

from pathlib import Path
from typing import Annotated

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field

from grammars.workplaces.rules import WorkplaceGrammar, read_workplaces
from storage.forest import Forest, read_forest
from storage.furniture import CLASSES, Furniture
from storage.furniture_segments import FurnitureSegments
from storage.layout_rooms import LayoutRooms
from storage.rooms import Rooms
from storage.sources import Source
from tasks.forest import predict
from tasks.furniture.examples import CLASS_NAMES
from tasks.furniture.workplaces import believed
from tasks.params import Params

Share = Annotated[float, Field(ge=0, le=1)]


class FurnitureParams(Params):
    """What of the segments becomes furniture. Assumptions."""

    table: Share = 0.4
    """Least confidence of a table."""
    chair: Share = 0.35
    """Least confidence of a chair."""
    other: Share = 0.5
    """Least confidence of anything else."""
    overlap: Share = 0.35
    """Greatest share of the smaller of two pieces of one class, or of a piece and what is no
    table or chair, that the two may have in common."""
    workplaces: Annotated[float, Field(ge=0, le=2)] = 0.0
    """How much the split rules of workplaces count (Sec. 7.4): exponent of their odds; 0: not."""


def classify_furniture(
    segments: FurnitureSegments,
    rooms: Rooms,
    forest: Source,
    workplaces: Source,
    params: FurnitureParams,
) -> Furniture:
    """Return the furniture among the segments: its class, box, heights and confidence.

    Of two pieces in one place the more confident is kept; chairs may stand under tables, and
    things on them.

    Parameters
    ----------
    rooms : those the segments lie in
    forest : tells `CLASS_NAMES` apart by `FEATURES`
    workplaces : split rules of workplaces (Sec. 7.4), applied by `params.workplaces`

    Raises
    ------
    InputError
        If the forest or the rules cannot be read, or the forest is of other features or classes.
    """
    known = read_forest(Path(forest.path), segments.names, CLASS_NAMES)
    return named(segments, rooms, known, read_workplaces(Path(workplaces.path)), params)


def classify_furniture_of_layout(
    segments: FurnitureSegments,
    layout: LayoutRooms,
    forest: Source,
    workplaces: Source,
    params: FurnitureParams,
) -> Furniture:
    """As `classify_furniture`, in the rooms a grammar has corrected."""
    return classify_furniture(segments, layout.rooms, forest, workplaces, params)


def named(
    segments: FurnitureSegments,
    rooms: Rooms,
    forest: Forest,
    workplaces: WorkplaceGrammar,
    params: FurnitureParams,
) -> Furniture:
    """As `classify_furniture`, with forest and rules at hand."""
    chances = predict(forest, segments.features)
    least = _least(params)
    chances = believed(segments, chances, rooms.polygons, least, workplaces, params.workplaces)
    return _chosen(segments, chances, params)


def _least(params: FurnitureParams) -> list[float]:
    """Return the least confidence of each of CLASSES."""
    return [params.table, params.chair, params.other]


def _chosen(
    segments: FurnitureSegments, chances: NDArray[np.float64], params: FurnitureParams
) -> Furniture:
    """Return the pieces that are confident enough, one for each place."""
    best = np.argmax(chances[:, : len(CLASSES)], axis=1)
    confidences = chances[np.arange(len(best)), best]
    classes = np.array(CLASSES)[best]
    least = np.array(_least(params))[best]
    kept = np.flatnonzero(confidences >= least)
    kept = kept[_one_each(segments, classes, confidences, kept, params.overlap)]
    tops = np.where(classes == "table", segments.surface_m, segments.top_m)[kept]
    return Furniture(
        segments.footprints[kept],
        classes[kept],
        segments.base_m[kept].copy(),
        tops,
        segments.rooms[kept],
        confidences[kept],
    )


def _one_each(
    segments: FurnitureSegments,
    classes: NDArray[np.str_],
    confidences: NDArray[np.float64],
    kept: NDArray[np.int64],
    overlap: float,
) -> NDArray[np.int64]:
    """Return which of the kept segments stay when those in one place give way, in order."""
    order = kept[np.argsort(-confidences[kept], kind="stable")]
    rank = np.empty(len(classes), np.int64)
    rank[order] = np.arange(len(order))
    shapes = segments.footprints
    tree = shapely.STRtree(shapes[kept])
    gone = np.zeros(len(classes), bool)
    for i in order:
        if gone[i]:
            continue
        near = kept[tree.query(shapes[i], predicate="intersects")]
        near = near[(rank[near] > rank[i]) & ~gone[near]]
        rivals = near[[_rivals(segments, classes, i, j) for j in near]] if len(near) else near
        shared = shapely.area(shapely.intersection(shapes[rivals], shapes[i]))
        smaller = np.minimum(shapely.area(shapes[rivals]), shapes[i].area)
        gone[rivals[shared > overlap * smaller]] = True
    return np.flatnonzero(~gone[kept])


def _rivals(segments: FurnitureSegments, classes: NDArray[np.str_], i: int, j: int) -> bool:
    """Return whether two pieces cannot both stand in one place."""
    if {classes[i], classes[j]} == {"table", "chair"}:
        return False
    # what lies on a table is something else
    return classes[i] == classes[j] or abs(segments.surface_m[i] - segments.surface_m[j]) < 0.1
