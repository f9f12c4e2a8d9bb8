"""Which initial rooms make which decoded rooms: one each, several one, or one several."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely import Polygon

from tasks.layout.placement.cutting import joined
from tasks.layout.placement.decoded_rows import DecodedRow
from tasks.layout.placement.storey import Storey

COMMON_M, COMMON = 0.4, 0.5
"""A stretch of a line is an initial and a decoded room's in common from this length, metres, or
this share of the shorter one: less is what walls that nobody saw are uncertain by."""
BESIDE = 0.2
"""Rooms whose extents along a line have more in common, as a share of the shorter, do not stand
side by side: one is cut out of the other (Sec. 7.4's overlapped rooms)."""


@dataclass(frozen=True, eq=False)
class Shape:
    """An outline to be moved, and cut if several decoded rooms share it."""

    polygon: Polygon
    sources: tuple[int, ...]
    """initial rooms it is made of"""
    row: int = -1
    """the row that decides, -1: on no line"""
    decoded: tuple[tuple[int, ...], ...] = ()
    """per room to be, rooms of that row, in its order: several where another room is cut out of it
    and stands between (Sec. 7.4)"""
    refused: str = ""
    """why a join was refused; '' none was"""

    @property
    def all_decoded(self) -> list[int]:
        """Return the decoded rooms of all its rooms to be."""
        return [d for some in self.decoded for d in some]


def make_shapes(storey: Storey, apart: frozenset[int]) -> list[Shape]:
    """Return the initial rooms as outlines to be moved: some joined, some to be cut.

    Parameters
    ----------
    apart : rooms that are neither joined nor cut

    Notes
    -----
    Rooms are joined where one decoded room takes them all, and what was seen between them is almost
    surely no wall, unless one is cut out of the other. A room that takes several decoded ones is to
    be cut at the walls between them that are probable enough.
    """
    main, polygons = storey.main_rows, storey.initial
    shapes = [Shape(p, (i,)) for i, p in enumerate(polygons) if main[i] < 0]
    for number, row in enumerate(storey.rows):
        for rooms, decoded in _groups(row, np.flatnonzero(main == number)):
            for run, why in _runs(rooms, row, polygons, storey.undivided(number), apart):
                shapes += _shapes_of(run, why, number, decoded, storey, apart)
    return _each_once(sorted(shapes, key=lambda shape: shape.sources), storey.rows)


def _shapes_of(
    run: list[int],
    why: str,
    number: int,
    decoded: list[int],
    storey: Storey,
    apart: frozenset[int],
) -> list[Shape]:
    row, polygons = storey.rows[number], storey.initial
    own = [d for d in decoded if any(_alike(row, room, d) for room in run)]
    whole: Polygon | None = polygons[run[0]]
    if len(run) > 1:
        whole = joined([polygons[i] for i in run], storey.params.thickest_m)
    if whole is None:
        return [Shape(polygons[i], (i,), number, _side_by_side(_best(row, i, own))) for i in run]
    rooms = _side_by_side(own)
    if apart.isdisjoint(run):
        rooms = _at_walls(rooms, storey.probable_walls(number) & _inside(row, run))
    if not apart.isdisjoint(run) or len(rooms) == 1:
        rooms = _side_by_side(_best(row, run[0], own))
    return [Shape(whole, tuple(run), number, rooms, why)]


def _inside(row: DecodedRow, run: Sequence[int]) -> NDArray[np.bool_]:
    """Return which boundaries some rooms have on either side, the one before each room, (n,).

    What another room lies beside is that room's wall; the initial model knows it.
    """
    return np.array(
        [
            row.room_beside(k, 0) in run and row.room_beside(k, 1) in run
            for k in range(len(row.decoded))
        ],
        bool,
    )


def _at_walls(
    rooms: Sequence[tuple[int, ...]], probable: NDArray[np.bool_]
) -> tuple[tuple[int, ...], ...]:
    """Return rooms to be, those as one between which there is no wall that is probable enough."""
    found = [rooms[0]] if rooms else []
    for room in rooms[1:]:
        if probable[room[0]]:
            found.append(room)
        else:
            found[-1] = (*found[-1], *room)
    return tuple(found)


def _side_by_side(decoded: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """Return decoded rooms as the rooms they make: what another room stands between is one."""
    rooms: list[tuple[int, ...]] = []
    for d in decoded:
        if rooms and d > rooms[-1][-1] + 1:
            rooms[-1] = (*rooms[-1], d)
        else:
            rooms.append((d,))
    return tuple(rooms)


def _common_m(row: DecodedRow, room: int, decoded: int) -> float:
    """Return the length of line that a room and a decoded room have in common."""
    low, high = row.chain.observed_m[decoded], row.chain.observed_m[decoded + 1]
    spans = row.stretch_m(room)
    common = np.minimum(spans[:, 1], high) - np.maximum(spans[:, 0], low)
    return float(np.maximum(common, 0).sum())


def _alike(row: DecodedRow, room: int, decoded: int) -> bool:
    """Return whether a room and a decoded room are the same in part or as a whole."""
    decoded_m = float(np.diff(row.chain.observed_m)[decoded])
    shorter = min(float(np.diff(row.stretch_m(room), axis=1).sum()), decoded_m)
    return _common_m(row, room, decoded) > min(COMMON_M, COMMON * shorter)


def _best(row: DecodedRow, room: int, decoded: Sequence[int]) -> tuple[int, ...]:
    """Return the decoded room with which a room has the longest stretch in common."""
    return (max(decoded, key=lambda d: _common_m(row, room, d)),) if decoded else ()


def _groups(row: DecodedRow, rooms: NDArray[np.int64]) -> list[tuple[list[int], list[int]]]:
    """Return groups of initial rooms, in order along the line, and their decoded rooms."""
    if not len(rooms):
        return []
    count = len(rooms) + len(row.decoded)
    pairs = [
        (i, len(rooms) + d)
        for i, room in enumerate(rooms)
        for d in range(len(row.decoded))
        if _alike(row, int(room), d)
    ]
    at = np.array(pairs, np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(at)), (at[:, 0], at[:, 1])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    order = sorted(range(len(rooms)), key=lambda i: float(row.stretch_m(int(rooms[i]))[0, 0]))
    groups: dict[int, tuple[list[int], list[int]]] = {}
    for i in order:
        groups.setdefault(label[i], ([], []))[0].append(int(rooms[i]))
    for d in range(len(row.decoded)):
        if label[len(rooms) + d] in groups:
            groups[label[len(rooms) + d]][1].append(d)
    return list(groups.values())


def _runs(
    rooms: list[int],
    row: DecodedRow,
    polygons: Sequence[Polygon],
    undivided: NDArray[np.bool_],
    apart: frozenset[int],
) -> list[tuple[list[int], str]]:
    """Return the rooms of a group as runs to be joined, and why joining them was refused."""
    runs: list[tuple[list[int], str]] = [([rooms[0]], "")]
    for a, b in pairwise(rooms):
        if a in apart or b in apart or _overlapped(row, polygons[a], polygons[b]):
            runs.append(([b], ""))
        elif _divided_between(row, a, b, undivided):
            runs[-1] = (runs[-1][0], CONTRADICTS)
            runs.append(([b], CONTRADICTS))
        else:
            runs[-1][0].append(b)
    return runs


CONTRADICTS = "contradicts the data"
"""Why a correction was refused."""


def _overlapped(row: DecodedRow, a: Polygon, b: Polygon) -> bool:
    extents = []
    for polygon in (a, b):
        s = row.frame.local(shapely.get_coordinates(polygon))[:, 0]
        extents.append((s.min(), s.max()))
    (a0, a1), (b0, b1) = extents
    return bool(min(a1, b1) - max(a0, b0) > BESIDE * min(a1 - a0, b1 - b0))


def _divided_between(row: DecodedRow, a: int, b: int, undivided: NDArray[np.bool_]) -> bool:
    """Whether what was seen between two rooms may be a wall after all."""
    sides = np.flatnonzero(
        (row.standing[:-1] == a) & (row.standing[1:] == b)
        | (row.standing[:-1] == b) & (row.standing[1:] == a)
    )
    at = row.interval_m[sides, 1]
    within = np.searchsorted(row.chain.observed_m[1:-1], at, side="right")
    return not bool(undivided[within].all())


def _each_once(shapes: list[Shape], rows: list[DecodedRow]) -> list[Shape]:
    """Give each decoded room to one outline: to that with most of its stretch."""
    owner: dict[tuple[int, int], tuple[float, int]] = {}
    for i, shape in enumerate(shapes):
        for d in shape.all_decoded:
            share = sum(_common_m(rows[shape.row], room, d) for room in shape.sources)
            share += 1e-6 * shape.polygon.area  # of equals the larger
            if share > owner.get((shape.row, d), (-1.0, -1))[0]:
                owner[shape.row, d] = (share, i)

    def own(i: int, shape: Shape) -> tuple[tuple[int, ...], ...]:
        kept = [tuple(d for d in some if owner[shape.row, d][1] == i) for some in shape.decoded]
        return tuple(some for some in kept if some)

    return [replace(shape, decoded=own(i, shape)) for i, shape in enumerate(shapes)]
