"""Rooms of flats to learn from: what offices have little of, such as sofas, low tables, worktops.

Each room is boxes of real sizes; rays from a few places where a person would stand find what of
them a camera sees, so that what hides behind other things is missing here too. Sizes: sofas 1.4 to
2.4 m long and 0.66 to 1.0 m deep, seats 0.38 to 0.48 m high, low tables 0.35 to 0.62 m; worktops
0.6 to 0.65 m deep and 0.82 to 0.95 m high (DIN EN 1116); beds 0.9 to 2.0 m wide and 2.0 to 2.1 m
long; dining tables of the catalogue (dimensions.py). Spreads and shares are assumptions.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numba
import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt

from storage.plan import Plan, PlanFurniture
from storage.points import PointCloud
from storage.rooms import Rooms
from tasks.params import Params

BUILDING = "tasks/furniture/homes.py"
"""Where these examples come from, as the others' buildings."""
CEILING_M, EYE_M = 2.6, (1.3, 1.6)
"""Height of the rooms, and where the device is held, metres."""
TOP_M, LEG_M, GAP_M = 0.03, 0.05, 0.03
"""Thickness of a table's top, side of its legs, gap between a piece and its wall, metres."""
TRIES = 30
"""Places tried for a piece before it is left out."""


class HomeParams(Params):
    """How many rooms of flats are made to learn from, and how they are seen. Assumptions."""

    rooms: NonNegativeInt = 60
    """Rooms; half of them kitchens, the others living rooms and bedrooms."""
    views: PositiveInt = 4
    """Places that each is seen from."""
    rays: PositiveInt = 80_000
    """Rays from each place."""
    noise_m: PositiveFloat = 0.012
    """Standard deviation of a point, metres."""
    seed: int = Field(default=0, ge=0, lt=2**32)
    """Seed of the rooms and of the noise."""


Span = tuple[float, float]
"""Least and greatest, metres."""
Block = tuple[float, float, float, float, float, float]
"""Least and greatest x, y and z, metres."""


@dataclass
class _Room:
    """A room that is being furnished; walls along the axes, a corner at the origin."""

    width: float
    depth: float
    pieces: list[tuple[str, Block]] = field(default_factory=list)
    """class and extent"""
    blocks: list[Block] = field(default_factory=list)
    """what stands in it"""
    taken: list[shapely.Polygon] = field(default_factory=list)
    """floor that is no longer free"""

    def takes(self, block: Block, front: float = 0.0) -> bool:
        """Return whether a piece finds free floor within the walls, and keep it for it."""
        floor = shapely.box(block[0], block[2], block[1], block[3])
        inside = shapely.box(0, 0, self.width, self.depth).covers(floor)
        if not inside or any(shapely.dwithin(floor, other, front) for other in self.taken):
            return False
        self.taken.append(floor)
        return True


class _Wall:
    """One of four walls: x along it, y from it into the room, turned into the room's frame."""

    def __init__(self, room: _Room, number: int) -> None:
        self.room, self.number = room, number
        self.length = room.width if number % 2 == 0 else room.depth

    def block(
        self, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]
    ) -> Block:
        """Return a block by its distances along and from the wall, and its heights."""
        w, d = self.room.width, self.room.depth
        match self.number:
            case 0:
                return (*x, *y, *z)
            case 1:
                return (w - y[1], w - y[0], *x, *z)
            case 2:
                return (w - x[1], w - x[0], d - y[1], d - y[0], *z)
            case _:
                return (*y, d - x[1], d - x[0], *z)


def homes(params: HomeParams) -> Iterator[tuple[Rooms, list[PointCloud], Plan]]:
    """Yield rooms of flats one by one: outline, what was seen of it, and what is true."""
    for i in range(params.rooms):
        rng = np.random.default_rng((params.seed, i))
        room = _Room(float(rng.uniform(3.0, 5.5)), float(rng.uniform(2.8, 4.5)))
        make = (_kitchen, _living_room, _kitchen, _bedroom)[i % 4]
        make(room, rng)
        outline = shapely.box(0, 0, room.width, room.depth)
        one = np.ones(1)
        rooms = Rooms(np.array([outline], object), 0 * one, CEILING_M * one, one, one, ((0,),))
        plan = Plan(BUILDING, str(i), furniture=tuple(_planned(room)))
        yield rooms, [_seen(room, params, rng)], plan


def _planned(room: _Room) -> Iterator[PlanFurniture]:
    for i, (class_, (x0, x1, y0, y1, z0, z1)) in enumerate(room.pieces):
        yield PlanFurniture(f"{class_}-{i}", shapely.box(x0, y0, x1, y1), class_, z0, z1)


def _kitchen(room: _Room, rng: np.random.Generator) -> None:
    """Worktops on one wall or two, cupboards over some, a dining table, at times a desk."""
    depth, top = float(rng.uniform(0.58, 0.66)), float(rng.uniform(0.82, 1.0))
    first = int(rng.integers(4))
    wall = _Wall(room, first)
    length = min(float(rng.uniform(1.2, 4.0)), wall.length)
    _worktop(room, wall, 0.0, length, depth, top, rng)
    if rng.uniform() < 0.6:
        # round the corner, or along the wall across
        other = _Wall(room, (first + (3 if rng.uniform() < 0.7 else 2)) % 4)
        end = other.length - (depth if (other.number - first) % 4 == 3 else 0.0)
        start = max(0.0, end - float(rng.uniform(1.0, 3.0)))
        _worktop(room, other, start, end, depth, top, rng)
    _dining_table(room, rng)
    if rng.uniform() < 0.5:
        _table_at_wall(room, rng)
    if rng.uniform() < 0.5:
        _cabinet(room, rng)


def _living_room(room: _Room, rng: np.random.Generator) -> None:
    """One or two sofas with low tables before and beside them, a low cabinet, at times a table."""
    for _ in range(int(rng.integers(1, 3))):
        _sofa(room, rng)
    for _ in range(int(rng.integers(1, 3))):
        _table(room, _low_table(rng), rng)
    for _ in range(int(rng.integers(0, 2))):
        _cabinet(room, rng)
    if rng.uniform() < 0.6:
        _dining_table(room, rng)


def _bedroom(room: _Room, rng: np.random.Generator) -> None:
    """A bed, low tables beside it, a cabinet, at times a desk."""
    wall = _Wall(room, int(rng.integers(4)))
    width, length = float(rng.uniform(0.9, 2.0)), float(rng.uniform(1.98, 2.15))
    top = float(rng.uniform(0.42, 0.66))
    x = float(rng.uniform(0, max(wall.length - width, 0.01)))
    bed = wall.block((x, x + width), (0.0, length), (0.0, top))
    if room.takes(bed):
        room.blocks.append(bed)
        room.pieces.append(("other", bed))
        if rng.uniform() < 0.5:  # a headboard
            height = top + float(rng.uniform(0.2, 0.5))
            room.blocks.append(wall.block((x, x + width), (0.0, 0.06), (0.0, height)))
    for _ in range(2):
        side = float(rng.uniform(0.4, 0.65))
        _table(room, (side, side, float(rng.uniform(0.45, 0.65))), rng)
    _cabinet(room, rng)
    if rng.uniform() < 0.6:
        _table_at_wall(room, rng)


def _worktop(
    room: _Room,
    wall: _Wall,
    start: float,
    end: float,
    depth: float,
    top: float,
    rng: np.random.Generator,
) -> None:
    """Put cupboards with one worktop along a wall, things on it, cupboards over it."""
    whole = wall.block((start, end), (0.0, depth), (0.0, top))
    if end - start < 0.6 or not room.takes(whole):
        return
    back = float(rng.uniform(0.0, 0.06))
    room.blocks.append(wall.block((start, end), (0.0, depth - back), (0.1, top - 0.04)))
    room.blocks.append(wall.block((start, end), (0.0, depth), (top - 0.04, top)))
    n = max(1, round((end - start) / 0.6))
    unit = (end - start) / n
    for i in range(n):
        x = start + i * unit, start + (i + 1) * unit
        room.pieces.append(("other", wall.block(x, (0.0, depth), (0.0, top))))
        if rng.uniform() < 0.4:
            room.blocks.append(wall.block(x, (0.0, 0.34), (1.4, 2.1)))
        if rng.uniform() < 0.4:  # a kettle, a toaster, a box
            size, at = rng.uniform(0.12, 0.35, 2), rng.uniform(0.02, 0.2)
            thing = (x[0] + 0.05, x[0] + 0.05 + size[0]), (at, at + size[1])
            room.blocks.append(wall.block(*thing, (top, top + float(rng.uniform(0.1, 0.35)))))


def _sofa(room: _Room, rng: np.random.Generator) -> None:
    length, depth = float(rng.uniform(1.4, 2.4)), float(rng.uniform(0.64, 1.0))
    seat, top = float(rng.uniform(0.38, 0.48)), float(rng.uniform(0.68, 0.92))
    arm, back = float(rng.uniform(0.08, 0.25)), float(rng.uniform(0.12, 0.25))
    arm_top = min(top, float(rng.uniform(0.52, 0.75)))
    for _ in range(TRIES):
        wall = _Wall(room, int(rng.integers(4)))
        if wall.length < length:
            continue
        x = float(rng.uniform(0, wall.length - length))
        y = float(rng.choice((GAP_M, GAP_M, rng.uniform(0.1, 1.0))))
        block = wall.block((x, x + length), (y, y + depth), (0.0, top))
        if not room.takes(block, 0.05):
            continue
        ends = x + arm, x + length - arm
        under = float(rng.choice((0.0, 0.1)))
        room.blocks += [
            wall.block((x, x + length), (y, y + back), (under, top)),
            wall.block((x, ends[0]), (y, y + depth), (under, arm_top)),
            wall.block((ends[1], x + length), (y, y + depth), (under, arm_top)),
            wall.block(ends, (y + back, y + depth), (under, seat)),
        ]
        room.pieces.append(("other", block))
        table, gap = _low_table(rng), float(rng.uniform(0.25, 0.5))
        middle, near = x + length / 2, y + depth + gap
        if rng.uniform() < 0.7:
            _legged(room, wall, (middle - table[0] / 2, middle + table[0] / 2),
                    (near, near + table[1]), table[2])  # fmt: skip
        return


def _low_table(rng: np.random.Generator) -> tuple[float, float, float]:
    """Return length, depth and height."""
    length = float(rng.uniform(0.55, 1.85))
    return length, min(length, float(rng.uniform(0.5, 0.95))), float(rng.uniform(0.35, 0.62))


def _table(room: _Room, size: tuple[float, float, float], rng: np.random.Generator) -> None:
    """Put a table anywhere."""
    for _ in range(TRIES):
        wall = _Wall(room, int(rng.integers(4)))
        x = float(rng.uniform(0, max(wall.length - size[0], 0.01)))
        y = float(rng.choice((GAP_M, rng.uniform(0.0, 2.0))))
        if _legged(room, wall, (x, x + size[0]), (y, y + size[1]), size[2]):
            return


def _table_at_wall(room: _Room, rng: np.random.Generator) -> None:
    size = (float(rng.uniform(1.0, 1.8)), float(rng.choice((0.6, 0.7, 0.75, 0.8))))
    top = float(rng.choice((0.74, 0.74, 0.9)))
    for _ in range(TRIES):
        wall = _Wall(room, int(rng.integers(4)))
        x = float(rng.uniform(0, max(wall.length - size[0], 0.01)))
        if _legged(room, wall, (x, x + size[0]), (GAP_M, GAP_M + size[1]), top):
            if rng.uniform() < 0.8:
                _chair(room, wall, x + size[0] / 2, GAP_M + size[1], 1, rng)
            return


def _dining_table(room: _Room, rng: np.random.Generator) -> None:
    length, depth = float(rng.uniform(0.8, 2.2)), float(rng.uniform(0.7, 1.0))
    wall = _Wall(room, int(rng.integers(4)))
    for _ in range(TRIES):
        x = float(rng.uniform(0.0, max(wall.length - length, 0.01)))
        y = float(rng.uniform(0.0, 2.0))
        if not _legged(room, wall, (x, x + length), (y, y + depth), float(rng.uniform(0.7, 0.77))):
            continue
        for side, edge in ((1, y + depth), (-1, y)):
            for i in range(max(1, int(length / 0.7))):
                if rng.uniform() < 0.7:
                    _chair(room, wall, x + (i + 0.5) * length / max(1, int(length / 0.7)),
                           edge, side, rng)  # fmt: skip
        return


def _chair(
    room: _Room, wall: _Wall, x: float, edge: float, side: int, rng: np.random.Generator
) -> None:
    """Put a chair before a table's edge, at times pushed under it."""
    width, out = float(rng.uniform(0.42, 0.54)), float(rng.uniform(0.14, 0.7))
    seat, top = float(rng.uniform(0.42, 0.48)), float(rng.uniform(0.78, 1.0))
    far, near = edge + side * out, edge + side * (out - width)
    y = min(far, near), max(far, near)
    across = x - width / 2, x + width / 2
    block = wall.block(across, y, (0.0, top))
    floor = shapely.box(block[0], block[2], block[1], block[3])
    inside = shapely.box(0, 0, room.width, room.depth).covers(floor)
    crowd = [shapely.area(shapely.intersection(floor, other)) for other in room.taken]
    if not inside or sum(area > 0 for area in crowd) > 1:  # its own table only
        return
    room.taken.append(floor)
    room.pieces.append(("chair", block))
    room.blocks.append(wall.block(across, y, (seat - 0.04, seat)))
    back = (far - TOP_M, far) if side > 0 else (far, far + TOP_M)
    room.blocks.append(wall.block(across, back, (seat, top)))
    room.blocks += _legs(wall, across, y, seat, 0.03)


def _legged(room: _Room, wall: _Wall, x: Span, y: Span, top: float) -> bool:
    """Put a table on four legs; return whether there was space for it."""
    block = wall.block(x, y, (0.0, top))
    if not room.takes(block, 0.03):
        return False
    room.pieces.append(("table", block))
    room.blocks.append(wall.block(x, y, (top - TOP_M, top)))
    room.blocks += _legs(wall, x, y, top, LEG_M)
    return True


def _legs(wall: _Wall, x: Span, y: Span, top: float, side: float) -> Iterator[Block]:
    for a in ((x[0], x[0] + side), (x[1] - side, x[1])):
        for b in ((y[0], y[0] + side), (y[1] - side, y[1])):
            yield wall.block(a, b, (0.0, top - TOP_M))


def _cabinet(room: _Room, rng: np.random.Generator) -> None:
    """Put a low or tall cabinet at a wall."""
    width, depth = float(rng.uniform(0.6, 2.0)), float(rng.uniform(0.35, 0.6))
    top = float(rng.choice((rng.uniform(0.35, 0.6), rng.uniform(0.7, 1.2), 2.0)))
    for _ in range(TRIES):
        wall = _Wall(room, int(rng.integers(4)))
        x = float(rng.uniform(0, max(wall.length - width, 0.01)))
        block = wall.block((x, x + width), (0.0, depth), (0.0, top))
        if room.takes(block, 0.03):
            room.blocks.append(block)
            room.pieces.append(("other", block))
            return


def _seen(room: _Room, params: HomeParams, rng: np.random.Generator) -> PointCloud:
    """Return the points where rays from free places in the room meet something."""
    blocks = np.array(room.blocks).reshape(-1, 6)
    parts = []
    for _ in range(params.views):
        at = _standpoint(room, rng)
        ways = rng.normal(size=(params.rays, 3))
        ways[:, 2] -= 0.35 * np.abs(ways[:, 2])  # held a little downwards
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        reach = _hits(at, ways, blocks, (room.width, room.depth, CEILING_M))
        parts.append(at + ways * reach[:, None])
    xyz = np.concatenate(parts)
    xyz += rng.normal(0, params.noise_m, xyz.shape)
    return PointCloud(xyz.astype(np.float32), np.zeros(3))


def _standpoint(room: _Room, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return where a device is held; over low furniture where no floor is free."""
    for _ in range(TRIES):
        x, y = rng.uniform(0.2, room.width - 0.2), rng.uniform(0.2, room.depth - 0.2)
        if not any(shapely.intersects_xy(floor, x, y) for floor in room.taken):
            break
    return np.array((x, y, rng.uniform(*EYE_M)))


@numba.njit(cache=True, nogil=True)
def _hits(
    start: NDArray[np.float64],
    ways: NDArray[np.float64],
    blocks: NDArray[np.float64],
    room: tuple[float, float, float],
) -> NDArray[np.float64]:  # pragma: no cover - compiled
    """Return how far each ray goes from a place in a room: to a block, else to the room's hull."""
    found = np.empty(len(ways))
    for i in range(len(ways)):
        best = np.inf
        for axis in range(3):
            way = ways[i, axis]
            if way != 0:
                best = min(best, ((room[axis] if way > 0 else 0.0) - start[axis]) / way)
        for b in range(len(blocks)):
            enter, leave = 0.0, best
            for axis in range(3):
                way = ways[i, axis]
                low, high = blocks[b, 2 * axis] - start[axis], blocks[b, 2 * axis + 1] - start[axis]
                if way == 0:
                    if low > 0 or high < 0:
                        leave = -1.0
                    continue
                one, two = low / way, high / way
                enter, leave = max(enter, min(one, two)), min(leave, max(one, two))
            if 0 < enter <= leave:
                best = enter
        found[i] = best
    return found
