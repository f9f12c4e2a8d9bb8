"""Tables, chairs and cabinets put into rooms by trial: no two overlap, doors stay clear."""

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon, box
from shapely.affinity import rotate, translate

from storage.plan import PlanFurniture, PlanOpening, PlanRoom

Piece = tuple[str, Polygon, float]
"""class, footprint around the group's centre, top in metres"""

TABLE_TOP_M = 0.74
"""Height of a fixed desk: EN 527-1 asks for 740 +- 20 mm."""
CHAIR_SIDE_M, CHAIR_TOP_M = 0.46, 0.84
"""A plain visitor's chair: total height; catalogues give 800 to 1100 mm. Assumption."""
CABINET_TOP_M = 1.9
"""Five file heights. Assumption."""
DOOR_CLEAR_M = 1.0
"""Nothing stands this near to a door's middle. Assumption."""
AISLE_M = 0.5
"""Free floor between two groups of furniture. Assumption."""
WALL_GAP_M = 0.03
"""What keeps furniture off the wall: a skirting board. Assumption."""
TRIALS = 60
"""Draws for one group before the room goes without it."""


def furnish(
    rooms: tuple[PlanRoom, ...], doors: tuple[PlanOpening, ...], rng: np.random.Generator
) -> tuple[PlanFurniture, ...]:
    """Return the furniture of all rooms; a group that finds no space is left out."""
    clear = shapely.union_all([d.line.centroid.buffer(DOOR_CLEAR_M) for d in doors])
    placed: list[PlanFurniture] = []
    for room in rooms:
        for class_, footprint, top in _furnish_room(room, clear, rng):
            id_ = f"f{len(placed) + 1}"
            placed.append(PlanFurniture(id_, footprint, class_, 0.0, top, room.id))
    return tuple(placed)


def _furnish_room(
    room: PlanRoom, clear: shapely.Geometry, rng: np.random.Generator
) -> Iterator[Piece]:
    free = room.polygon.buffer(-WALL_GAP_M / 2, join_style="mitre").difference(clear)
    for against_wall, group in _groups(room.class_, room.polygon.area, rng):
        place = _against_a_wall if against_wall else _in_the_open
        for _ in range(TRIALS):
            pieces = place(group, room.polygon, rng)
            taken = shapely.union_all([footprint for _, footprint, _ in pieces])
            if free.contains(taken):
                free = free.difference(taken.buffer(AISLE_M))
                yield from pieces
                break


def _groups(
    class_: str | None, area_m2: float, rng: np.random.Generator
) -> list[tuple[bool, list[Piece]]]:
    """Return what a room of a class holds: (whether against a wall, pieces) per group."""
    cabinet = (True, [_cabinet(rng)])
    match class_:
        case "office":
            desks = [(False, _desk(rng)) for _ in range(2 if area_m2 > 14 else 1)]
            return [*desks, cabinet]
        case "meeting":
            return [(False, _seats(2.0, 1.0, (2, 2), rng)), cabinet]
        case "kitchen":
            return [(False, _seats(0.8, 0.8, (1, 1), rng)), cabinet, cabinet]
        case "storage":
            return [cabinet, cabinet]
        case _:
            return []


def _desk(rng: np.random.Generator) -> list[Piece]:
    """Return a 1600 x 800 mm desk, the commonest of EN 527-1, and a chair before it."""
    return _seats(1.6, 0.8, (1, 0), rng)


def _seats(
    length: float, depth: float, chairs: tuple[int, int], rng: np.random.Generator
) -> list[Piece]:
    """Return a table with some chairs on its two long sides, drawn up as people leave them."""
    pieces: list[Piece] = [("table", _rectangle(length, depth), TABLE_TOP_M)]
    for side, n in zip((-1, 1), chairs, strict=True):
        for i in range(n):
            x = (i + 0.5) * length / n - length / 2 + rng.uniform(-0.05, 0.05)
            y = side * (depth / 2 + CHAIR_SIDE_M / 2 + rng.uniform(0.1, 0.25))
            chair = rotate(_rectangle(CHAIR_SIDE_M, CHAIR_SIDE_M), rng.uniform(-15, 15))
            pieces.append(("chair", translate(chair, x, y), CHAIR_TOP_M))
    return pieces


def _cabinet(rng: np.random.Generator) -> Piece:
    return ("other", _rectangle(float(rng.choice([0.8, 1.0, 1.2])), 0.42), CABINET_TOP_M)


def _rectangle(length: float, depth: float) -> Polygon:
    return box(-length / 2, -depth / 2, length / 2, depth / 2)


def _in_the_open(group: list[Piece], room: Polygon, rng: np.random.Generator) -> list[Piece]:
    """Return the group somewhere in the room, square to a wall drawn at random."""
    start, end = _wall_of(room, rng)
    low_x, low_y, high_x, high_y = room.bounds
    x, y = rng.uniform((low_x, low_y), (high_x, high_y))
    return _moved(group, np.arctan2(*(end - start)[::-1]), np.array((x, y)))


def _against_a_wall(group: list[Piece], room: Polygon, rng: np.random.Generator) -> list[Piece]:
    """Return the group with its long side against a wall drawn at random."""
    start, end = _wall_of(room, rng)
    along = (end - start) / np.linalg.norm(end - start)
    inwards = np.array((-along[1], along[0]))  # the ring runs anticlockwise
    depth = max(footprint.bounds[3] for _, footprint, _ in group)
    centre = start + rng.uniform() * (end - start) + (depth + WALL_GAP_M) * inwards
    return _moved(group, np.arctan2(along[1], along[0]), centre)


def _wall_of(
    room: Polygon, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    ring = shapely.get_coordinates(shapely.orient_polygons(room).exterior)
    lengths = np.linalg.norm(np.diff(ring, axis=0), axis=1)
    edge = rng.choice(len(lengths), p=lengths / lengths.sum())
    return ring[edge], ring[edge + 1]


def _moved(group: list[Piece], angle_rad: float, to: NDArray[np.float64]) -> list[Piece]:
    return [
        (
            class_,
            translate(rotate(footprint, angle_rad, origin=(0, 0), use_radians=True), *to),
            top,
        )
        for class_, footprint, top in group
    ]
