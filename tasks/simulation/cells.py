"""From a subdivision of the storey into cells to its walls and rooms.

A cell is a room measured to the centre lines of its walls. What two cells share is a wall between
them, what one has alone is an outer wall; a room is its cell less the walls.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon

from tasks.simulation.junctions import STRAIGHT, solid_area

SNAP_M = 1e-6
"""Two corners closer than this are one: rounding of the construction, far below a millimetre."""
SHORTEST_M = 1e-3
"""No wall is shorter: less is rounding of the construction."""


@dataclass(frozen=True, eq=False)
class Line:
    """One straight wall: its centre line, its thickness, the cells beside it."""

    line: LineString
    thickness_m: float
    cells: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Edges:
    """e straight edges of all cells, each cell on the left of its own."""

    ends: NDArray[np.float64]
    """(e, 2, 2), metres"""
    cells: NDArray[np.int64]
    """(e,)"""


def wall_lines(
    cells: Sequence[Polygon],
    bearing: Collection[int],
    outer_m: float,
    bearing_m: float,
    inner_m: float,
) -> tuple[Line, ...]:
    """Return the straight walls of a subdivision, inner ones first.

    Parameters
    ----------
    cells : k polygons that touch but do not overlap, metres
    bearing : the cells (corridors, stairs) whose walls bear
    outer_m, bearing_m, inner_m : thickness of outer walls, bearing walls, partitions, metres.
        What runs straight on keeps the greatest thickness, so that no room has a jog.
    """
    edges = _edges(cells)
    inner, spans = _shared(edges)
    walls = [
        Line(line, bearing_m if set(pair) & set(bearing) else inner_m, pair) for line, pair in inner
    ]
    for i, (ends, cell) in enumerate(zip(edges.ends, edges.cells, strict=True)):
        for start, stop in _gaps(spans[i], float(np.linalg.norm(ends[1] - ends[0]))):
            walls.append(Line(_piece(ends, start, stop), outer_m, (int(cell),)))
    return _evened(walls)


def inner_faces(cells: Sequence[Polygon], walls: Sequence[Line]) -> list[Polygon]:
    """Return the rooms that cells leave within the inner faces of the walls."""
    lines = np.array([shapely.get_coordinates(wall.line) for wall in walls])
    solid = solid_area(lines, np.array([wall.thickness_m for wall in walls]))
    return [_room(cell, solid) for cell in cells]


def cleaned(polygon: Polygon) -> Polygon:
    """Return a polygon anticlockwise, without corners that lie on a straight side."""
    oriented = shapely.orient_polygons(polygon)
    shell, *holes = [_corners(ring.coords) for ring in (oriented.exterior, *oriented.interiors)]
    return Polygon(shell, holes)


def _room(cell: Polygon, solid: shapely.Geometry) -> Polygon:
    parts = [part for part in shapely.get_parts(cell.difference(solid)) if part.area > SHORTEST_M]
    if len(parts) != 1 or not isinstance(parts[0], Polygon):
        raise ValueError(f"cell {cell.wkt}: expected one room within the walls, got {len(parts)}")
    return cleaned(parts[0].simplify(SNAP_M))


def _corners(coordinates: shapely.coords.CoordinateSequence) -> NDArray[np.float64]:
    ring = np.array(coordinates)[:-1, :2]
    ring = ring[np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1) > SNAP_M]
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    sine = np.abs(cross) / (np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1))
    return ring[sine > SNAP_M]


def _edges(cells: Sequence[Polygon]) -> Edges:
    ends, owners = [], []
    for i, cell in enumerate(cells):
        polygon = cleaned(cell)
        for ring in (polygon.exterior, *polygon.interiors):
            corners = np.array(ring.coords)
            ends.append(np.stack((corners[:-1], corners[1:]), axis=1))
            owners.append(np.full(len(corners) - 1, i))
    return Edges(np.concatenate(ends), np.concatenate(owners))


def _shared(
    edges: Edges,
) -> tuple[list[tuple[LineString, tuple[int, int]]], list[list[tuple[float, float]]]]:
    """Return what two cells share, and of every edge the spans it shares, metres along it."""
    shared: list[tuple[LineString, tuple[int, int]]] = []
    spans: list[list[tuple[float, float]]] = [[] for _ in edges.cells]
    lengths = np.linalg.norm(edges.ends[:, 1] - edges.ends[:, 0], axis=1)
    for i, (start, end) in enumerate(edges.ends):
        along = (end - start) / lengths[i]
        offset = edges.ends - start
        positions = offset @ along
        off = np.abs(offset @ np.array((-along[1], along[0])))
        # the neighbour's edge runs the other way
        low, high = np.maximum(positions[:, 1], 0), np.minimum(positions[:, 0], lengths[i])
        meets = (off < SNAP_M).all(axis=1) & (high - low > SHORTEST_M)
        for j in np.flatnonzero(meets & (edges.cells != edges.cells[i])):
            spans[i].append((float(low[j]), float(high[j])))
            pair = int(edges.cells[i]), int(edges.cells[j])
            if pair[0] < pair[1]:
                shared.append((_piece(edges.ends[i], float(low[j]), float(high[j])), pair))
    # pair by pair, in the order of the cells
    return sorted(shared, key=lambda item: item[1]), spans


def _gaps(spans: list[tuple[float, float]], length: float) -> Iterator[tuple[float, float]]:
    """Yield what some spans leave free between 0 and a length."""
    position = 0.0
    for start, stop in sorted(spans):
        if start - position > SHORTEST_M:
            yield position, start
        position = max(position, stop)
    if length - position > SHORTEST_M:
        yield position, length


def _piece(ends: NDArray[np.float64], start: float, stop: float) -> LineString:
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    return LineString((ends[0] + start * along, ends[0] + stop * along))


def _evened(walls: list[Line]) -> tuple[Line, ...]:
    """Return the walls with one thickness along everything that runs straight on."""
    lines = np.array([shapely.get_coordinates(wall.line) for wall in walls])
    thickness = np.array([wall.thickness_m for wall in walls])
    along = lines[:, 1] - lines[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    cross = np.abs(along[:, None, 0] * along[None, :, 1] - along[:, None, 1] * along[None, :, 0])
    ends = lines[:, None, :, None] - lines[None, :, None]
    touching = (np.linalg.norm(ends, axis=4) < 10 * SNAP_M).any(axis=(2, 3))
    straight = touching & (cross < STRAIGHT)
    while True:
        most = np.where(straight, thickness[None], 0.0).max(axis=1)
        if (most == thickness).all():
            break
        thickness = most
    return tuple(replace(w, thickness_m=float(t)) for w, t in zip(walls, thickness, strict=True))
