"""The level segments of a storey that may be furniture (Sec. 6)."""

import numpy as np

from storage.furniture_segments import FurnitureSegments
from storage.layout_rooms import LayoutRooms
from storage.points import PointCloud
from storage.rooms import Rooms
from tasks.furniture.backs import BackParams
from tasks.furniture.chairs import ChairParams, find_chairs
from tasks.furniture.columns import ColumnParams, cut_columns
from tasks.furniture.dimensions import TABLES_M
from tasks.furniture.features import FEATURES, features_of
from tasks.furniture.fronts import FrontParams, find_fronts
from tasks.furniture.patches import PatchParams
from tasks.furniture.scene import scenes
from tasks.furniture.sofas import SofaParams, find_sofas
from tasks.furniture.splitting import RunParams, SplitParams
from tasks.furniture.standing import find_standing
from tasks.furniture.tops import TopParams, candidates, find_tops, tables_among
from tasks.params import Params


class FurnitureSegmentParams(Params):
    """How level segments are found, put together and split."""

    columns: ColumnParams = ColumnParams()
    """How finely a storey is cut."""
    patches: PatchParams = PatchParams()
    """Which level patches count."""
    backs: BackParams = BackParams()
    """What may be the back of a chair."""
    chairs: ChairParams = ChairParams()
    """How chairs are put together."""
    tops: TopParams = TopParams()
    """How patches become tops."""
    split: SplitParams = SplitParams()
    """When one top is several tables."""
    runs: RunParams = RunParams()
    """When a run of cabinets is several."""
    fronts: FrontParams = FrontParams()
    """What may be the front of a tall piece."""
    sofas: SofaParams = SofaParams()
    """What may be a sofa."""
    standing: BackParams = BackParams(
        low_m=0.9, high_m=1.45, deep_m=0.2, width_m=0.58, narrow_m=0.2, wide_m=0.9, thick_m=0.2
    )
    """What may be a screen on a table: 0.3 to 0.6 m high and up to 0.9 m wide. Assumption."""


def find_furniture_segments(
    rooms: Rooms, points: list[PointCloud], params: FurnitureSegmentParams
) -> FurnitureSegments:
    """Return all that may be furniture between floor and ceiling of each room, with its features.

    Rooms whose floor nobody saw are taken to have the others'. The clouds' own segments are not
    used: planes of a whole scan miss seats, and what several scans saw is one thing here.
    """
    columns = cut_columns(rooms, points, params.columns)
    rows, hulls, boxes, heights, tops, bases, owners = [], [], [], [], [], [], []
    for scene in scenes(rooms, columns, params.patches, params.backs, params.standing):
        level = find_tops(scene, params.tops)
        tables = tables_among(level)
        table_boxes = [table.box for table in tables]
        outlines = _objects([box.polygon for box in table_boxes])
        found = [
            *candidates(scene, level, TABLES_M, params.tops, params.split, params.runs),
            *find_chairs(scene, tables, params.backs, params.chairs),
            *find_fronts(scene, params.fronts, params.runs),
            *find_standing(scene, tables, params.standing),
            *find_sofas(scene, level, params.sofas),
        ]
        for candidate in found:
            hull, row = features_of(scene, candidate, table_boxes, outlines)
            hulls.append(hull)
            rows.append(row)
            boxes.append(candidate.box.polygon)
            heights.append(candidate.height + scene.floor_m)
            tops.append(candidate.top + scene.floor_m)
            bases.append(candidate.base + scene.floor_m)
            owners.append(scene.room)
    n = len(rows)
    return FurnitureSegments(
        FEATURES,
        np.array(rows, float).reshape(n, len(FEATURES)),
        _objects(boxes),
        _objects(hulls),
        np.array(heights, float),
        np.array(tops, float),
        np.array(bases, float),
        np.array(owners, np.int32),
    )


def find_furniture_segments_of_layout(
    layout: LayoutRooms, points: list[PointCloud], params: FurnitureSegmentParams
) -> FurnitureSegments:
    """As `find_furniture_segments`, in the rooms a grammar has corrected."""
    return find_furniture_segments(layout.rooms, points, params)


def _objects(values: list) -> np.ndarray:
    found = np.empty(len(values), object)
    found[:] = values
    return found
