"""Workplaces completed by split rules: what stands where a rule places it is likelier (Sec. 7.4).

Fig. 20 derives a workplace from a free face: tables along the room's largest edge, then chairs
along the tables. Here the same rules speak of what was half seen: whatever may be a table along a
wall, or a chair at a table, is believed more readily there than in the middle of nowhere.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from grammars.workplaces.rules import WorkplaceGrammar, WorkplaceRule
from storage.furniture import CLASSES
from storage.furniture_segments import FurnitureSegments


def believed(
    segments: FurnitureSegments,
    chances: NDArray[np.float64],
    polygons: NDArray[np.object_],
    least: Sequence[float],
    grammar: WorkplaceGrammar,
    weight: float,
) -> NDArray[np.float64]:
    """Return the chances of segments after the rules have been applied, each edge by its length.

    Parameters
    ----------
    chances : (n, c) float
        Probability of each class, those of CLASSES first.
    polygons : (r,) of shapely polygons
        Outlines of the rooms.
    least : (k,) float
        Probability from which a segment is of each of CLASSES.
    weight : float
        Exponent of a rule's odds: 0 leaves all chances as they are.

    Returns
    -------
    (n, c) float
        Rows sum to one.
    """
    chances = chances.copy()
    if weight == 0:
        return chances
    for rule in grammar.rules:
        column = CLASSES.index(rule.places)
        for edges, room in _edges(rule, segments, chances, polygons, least):
            mine = np.flatnonzero((segments.rooms == room) & (chances[:, column] > 0))
            # the largest edge is split first
            for edge in sorted(edges, key=lambda edge: -float(np.linalg.norm(edge[1] - edge[0]))):
                placed = _placed(rule, edge, segments, chances[:, column], mine)
                _raise(chances, placed, column, rule.odds**weight)
                mine = np.setdiff1d(mine, placed)
    return chances


def _edges(
    rule: WorkplaceRule,
    segments: FurnitureSegments,
    chances: NDArray[np.float64],
    polygons: NDArray[np.object_],
    least: Sequence[float],
) -> list[tuple[list[NDArray[np.float64]], int]]:
    """Return the (2, 2) edges of each parent, its inside to the left, and its room."""
    if rule.parent == "wall":
        rooms = np.unique(segments.rooms)
        return [(_sides(shapely.orient_polygons(polygons[room])), int(room)) for room in rooms]
    table = CLASSES.index("table")
    rows = np.flatnonzero(chances[:, table] >= least[table])
    return [(_sides(segments.footprints[i]), int(segments.rooms[i])) for i in rows]


def _sides(polygon: shapely.Polygon) -> list[NDArray[np.float64]]:
    corners = shapely.get_coordinates(polygon.exterior)
    return [corners[i : i + 2] for i in range(len(corners) - 1)]


def _placed(
    rule: WorkplaceRule,
    edge: NDArray[np.float64],
    segments: FurnitureSegments,
    chances: NDArray[np.float64],
    rows: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Return the segments a rule places along an edge: the likeliest, as many as it holds."""
    length = float(np.linalg.norm(edge[1] - edge[0]))
    if length < rule.each_m or not len(rows):
        return np.empty(0, np.int64)
    along = (edge[1] - edge[0]) / length
    # into the room from a wall, away from a table
    into = np.array((-along[1], along[0])) * (1.0 if rule.parent == "wall" else -1.0)
    kept = []
    for i in rows:
        corners = shapely.get_coordinates(segments.footprints[i])[:4]
        out = (corners - edge[0]) @ into
        at = (corners - edge[0]) @ along
        sides = np.diff(corners, axis=0)[:2]
        angles = np.abs(np.arctan2(sides @ into, sides @ along))
        turn = np.minimum(angles % (np.pi / 2), np.pi / 2 - angles % (np.pi / 2)).min()
        middle = float(at.mean())
        near = rule.near_m[0] <= out.min() <= rule.near_m[1] and out.max() > 0
        if near and turn <= rule.turn_rad and 0 <= middle <= length:
            kept.append(i)
    order = sorted(kept, key=lambda i: (-chances[i], i))
    return np.array(order[: int(length / rule.each_m + 0.1)], np.int64)


def _raise(chances: NDArray[np.float64], rows: NDArray[np.int64], column: int, odds: float) -> None:
    """Multiply the odds of a class, the others keeping their proportions."""
    old = chances[rows, column]
    new = odds * old / (odds * old + 1 - old)
    rest = np.divide(1 - new, 1 - old, out=np.zeros_like(old), where=old < 1)
    chances[rows] *= rest[:, None]
    chances[rows, column] = new
