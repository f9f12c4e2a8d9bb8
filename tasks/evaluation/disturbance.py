"""Walls missed and walls imagined, put into an initial model: what a grammar is there to mend.

The paper's grammar repairs what the scans left out (Sec. 4.2); how much of that it can bear shows
only if it is known what was left out. So some walls between rooms are taken away, as if nobody had
seen them, and some rooms are cut by a partition that is not there, as if a row of cabinets up to
the ceiling had been taken for one.
"""

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat
from shapely import Polygon
from shapely.geometry.polygon import orient

from storage.faces import Faces
from storage.rooms import Rooms
from storage.walls import Walls
from tasks.evaluation.disturbed_surfaces import (
    with_faces,
    with_walls,
    without_faces,
    without_walls,
)
from tasks.evaluation.neighbours import Neighbours, Strip, corridor_of, find_neighbours
from tasks.evaluation.partitions import Partition, place_partition
from tasks.params import Params


class DisturbParams(Params):
    """How an initial model is spoilt before a grammar corrects it. Not in the paper."""

    missing: float = Field(default=0.0, ge=0, le=1)
    """Share of the walls between neighbouring rooms that are taken away."""
    spurious: float = Field(default=0.0, ge=0, le=1)
    """False partitions put in, as a share of the walls between neighbouring rooms."""
    thickness_m: PositiveFloat = 0.1
    """Thickness of a false partition, metres: boards on a 50 mm stud (DIN 18183 W111)."""
    clear_m: PositiveFloat = 0.8
    """How far a false partition keeps from walls that run the same way, metres. Assumption: a
    nearer one is a sliver that nobody takes for a room."""
    thickest_m: PositiveFloat = 0.6
    """Rooms further apart are no neighbours, metres. Assumption."""
    shortest_m: PositiveFloat = 1.0
    """Rooms that turn less to each other are no neighbours, metres. Assumption."""
    seed: int = 0
    """Seed of which walls, which rooms, and where in them."""


def disturb(
    rooms: Rooms, walls: Walls, faces: Faces, params: DisturbParams
) -> tuple[Rooms, Walls, Faces]:
    """Take walls between neighbouring rooms out of an initial model, and put false ones in.

    The room with most neighbours, the corridor, is left as it is. Rooms that were joined are not
    cut, so that no mistake undoes another; no room is cut twice. Where too few rooms can be joined
    or cut to simple polygons, fewer are.

    Returns
    -------
    Rooms
        Joined rooms stand where the first of them stood, the halves of a cut one behind each other.
    Walls
        Without those taken away, with those put in; their `rooms` are rows of the new table.
    Faces
        Without what was seen of the former; a false partition was seen from either side all over,
        by as many scans as the room.
    """
    pairs = find_neighbours(list(rooms.polygons), params.thickest_m, params.shortest_m)
    corridor = corridor_of(list(rooms.polygons), pairs)
    inner = [pair for pair in pairs if corridor not in (pair.a, pair.b)]
    missing, spurious = (round(share * len(inner)) for share in (params.missing, params.spurious))
    if not missing and not spurious:
        return rooms, walls, faces
    rng = np.random.default_rng(params.seed)
    joined, shapes, gone = _join(rooms, inner, missing, rng)
    cut = _partitions(shapes, joined, corridor, spurious, params, rng)
    faces = with_faces(without_faces(faces, gone), rooms, cut)
    numbers = _numbers(joined, cut)
    walls = with_walls(without_walls(walls, gone), rooms, cut, numbers, params.thickness_m)
    return _rooms(rooms, shapes, joined, cut), walls, faces


def _join(
    rooms: Rooms, pairs: list[Neighbours], count: int, rng: np.random.Generator
) -> tuple[NDArray[np.int64], dict[int, Polygon], list[Strip]]:
    """Return the first room of the joined ones each belongs to, their outlines, and what went."""
    first = np.arange(len(rooms))
    shapes: dict[int, Polygon] = dict(enumerate(rooms.polygons))
    gone: list[Strip] = []
    for i in rng.permutation(len(pairs)):
        if count == 0:
            break
        low, high = sorted((int(first[pairs[i].a]), int(first[pairs[i].b])))
        if low == high:
            continue
        strips = pairs[i].strips
        union = shapely.union_all([shapes[low], shapes[high], *(s.polygon for s in strips)])
        if not isinstance(union, Polygon) or union.interiors:
            continue
        first[first == high] = low
        shapes[low] = orient(union)
        del shapes[high]
        gone += strips
        count -= 1
    return first, shapes, gone


def _partitions(
    shapes: dict[int, Polygon],
    joined: NDArray[np.int64],
    corridor: int,
    count: int,
    params: DisturbParams,
    rng: np.random.Generator,
) -> dict[int, Partition]:
    """Return the false partitions by the rooms they cut."""
    alone = [i for i in shapes if i != corridor and (joined == i).sum() == 1]
    cut: dict[int, Partition] = {}
    for i in rng.permutation(alone).astype(int).tolist():
        if len(cut) == count:
            break
        partition = place_partition(shapes[i], params.thickness_m, params.clear_m, rng)
        if partition is not None:
            cut[i] = partition
    return cut


def _numbers(joined: NDArray[np.int64], cut: dict[int, Partition]) -> NDArray[np.int64]:
    """Return the new number of each room, of the first half of it if it was cut."""
    size = [0 if first != i else 1 + (i in cut) for i, first in enumerate(joined)]
    return np.asarray((np.cumsum(size) - size)[joined], np.int64)


def _rooms(
    rooms: Rooms,
    shapes: dict[int, Polygon],
    joined: NDArray[np.int64],
    cut: dict[int, Partition],
) -> Rooms:
    of = [i for i in sorted(shapes) for _ in range(1 + (i in cut))]
    members = [np.flatnonzero(joined == i) for i in of]
    area = shapely.area(rooms.polygons)
    largest = [m[area[m].argmax()] for m in members]
    made = [p for i in sorted(shapes) for p in (cut[i].pieces if i in cut else (shapes[i],))]
    polygons = np.empty(len(made), object)
    polygons[:] = made
    return Rooms(
        polygons=polygons,
        floor_m=rooms.floor_m[largest],
        ceiling_m=rooms.ceiling_m[largest],
        seen=np.array([np.average(rooms.seen[m], weights=area[m]) for m in members]),
        walled=np.array([np.average(rooms.walled[m], weights=area[m]) for m in members]),
        scans=tuple(tuple(sorted({s for i in m for s in rooms.scans[i]})) for m in members),
    )
