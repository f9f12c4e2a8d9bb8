"""Pieces of furniture in real sizes, and the groups they come in.

Sizes: desks of EN 527-1 (tops 740 mm high, 1200 to 2000 mm long, 600 or 800 mm deep); worktops of
DIN EN 1116 (600 mm deep, about 900 mm high). Of 84 chairs in a furnisher's 2020 catalogue (the
TidyTuesday `ikea` table) the total height has quantiles 77, 87 and 107 cm at 5, 50 and 95 %, the
side 42 to 69 cm; of 43 cabinets the width 41, 81, 180 cm, the depth 30, 38, 48 cm, the height 63,
123, 212 cm; of 150 shelves the depth 28, 37, 51 cm, the height 77, 179, 237 cm. Spreads and shares
not named there are assumptions.

A group lies in a frame of its own: x along the wall it may stand at, y from the wall into the room,
the origin in the middle of its back.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

DESK_SIZES_M = ((1.6, 0.8), (1.6, 0.8), (1.8, 0.8), (1.4, 0.8), (1.2, 0.6), (2.0, 0.8))
"""Length and depth of desks, the commonest twice."""
DESK_TOP_M, WORKTOP_M = 0.74, 0.9
"""Heights of desks and tables, and of worktops and benches."""
CABINET_WIDTHS_M, CABINET_TOPS_M = (0.8, 0.8, 1.0, 1.2), (0.74, 1.13, 1.5, 1.9, 2.1)
"""File cabinets: two to six file heights."""
CHAIR_CLEAR_M, FRONT_CLEAR_M, BEHIND_M = 0.25, 0.6, 0.02
"""Free floor behind a chair, before a cabinet, and between a piece and its wall. Assumption."""
BACK_OUT_M = 0.16
"""What of a chair stays before the table's edge however far it is pushed in: its back."""

Corners = NDArray[np.float64]
"""(4, 2), metres"""


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece; its kind becomes the first part of its id in the plan."""

    kind: str
    class_: str
    corners: Corners
    base_m: float
    top_m: float


@dataclass(frozen=True, eq=False)
class Group:
    """Pieces placed together, and the floor they need free of all others."""

    pieces: tuple[Piece, ...]
    low: tuple[float, float]
    """least x and y of the floor needed, metres"""
    high: tuple[float, float]
    """greatest x and y of it, metres"""
    pitch_m: float = 0.0
    """distance to the next of its kind on a grid, metres; 0: as near as the floor allows"""

    @property
    def floor(self) -> Corners:
        """Return the corners of the floor needed."""
        (x0, y0), (x1, y1) = self.low, self.high
        return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def rectangle(x: float, y: float, width: float, depth: float, turn_rad: float = 0.0) -> Corners:
    """Return a rectangle by its middle, turned about it."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (width / 2, depth / 2)
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    return corners @ np.array([(cosine, sine), (-sine, cosine)]) + (x, y)


def group(pieces: Sequence[Piece], front_m: float) -> Group:
    """Return a group at a wall that needs some floor before it."""
    corners = np.concatenate([piece.corners for piece in pieces])
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return Group(tuple(pieces), (x0, y0), (x1, y1 + front_m))


def chair(
    x: float, edge_y: float, side: int, p_pushed_in: float, swivel: bool, rng: np.random.Generator
) -> Piece:
    """Return a chair at a table's edge, on the side of greater (1) or lesser (-1) y."""
    width = round(float(np.clip(rng.normal(0.48, 0.03), 0.42, 0.54)), 2)
    if rng.uniform() < p_pushed_in:
        out, turn = BACK_OUT_M + rng.uniform(0.0, 0.1) - width / 2, rng.normal(0, 0.03)
    else:
        out, turn = width / 2 + rng.uniform(0.08, 0.3), rng.normal(0, 0.2)
    turn = float(np.clip(turn, -0.35, 0.35))
    return _chair(rectangle(x, edge_y + side * out, width, width, turn), swivel, rng)


def _chair(corners: Corners, swivel: bool, rng: np.random.Generator) -> Piece:
    middle = 0.95 if swivel else 0.86
    top = round(float(np.clip(rng.normal(middle, 0.06), 0.77, 1.1)), 2)
    return Piece("swivel" if swivel else "chair", "chair", corners, 0.0, top)


def workplace(p_pushed_in: float, rng: np.random.Generator) -> Group:
    """Return a desk with its back to the wall, a swivel chair, mostly a screen."""
    length, depth = DESK_SIZES_M[int(rng.integers(len(DESK_SIZES_M)))]
    pieces = [_desk(0.0, BEHIND_M + depth / 2, length, depth)]
    x = rng.uniform(-0.15, 0.15)
    pieces.append(chair(x, BEHIND_M + depth, 1, p_pushed_in, True, rng))
    if rng.uniform() < 0.8:
        pieces.append(_screen(x, BEHIND_M + 0.12, rng))
    return group(pieces, CHAIR_CLEAR_M)


def turned(of: Group) -> Group:
    """Return a group turned anticlockwise by a quarter about its origin."""
    quarter = np.array([(0.0, 1.0), (-1.0, 0.0)])
    pieces = tuple(replace(piece, corners=piece.corners @ quarter) for piece in of.pieces)
    (x0, y0), (x1, y1) = of.low, of.high
    return Group(pieces, (-y1, x0), (-y0, x1), of.pitch_m)


def sideways(of: Group) -> Group:
    """Return a group turned so that it stands with a narrow side to the wall."""
    quarter = turned(of)
    (x0, y0), (x1, y1) = quarter.low, quarter.high
    shift = np.array((-(x0 + x1) / 2, BEHIND_M - y0))
    pieces = tuple(replace(piece, corners=piece.corners + shift) for piece in quarter.pieces)
    return Group(pieces, (x0 + shift[0], BEHIND_M), (x1 + shift[0], y1 + shift[1]))


def desk_block(pairs: int, p_pushed_in: float, rng: np.random.Generator) -> Group:
    """Return desks face to face, touching, with chairs on both outer sides."""
    length, depth = DESK_SIZES_M[int(rng.integers(2))]
    pieces: list[Piece] = []
    for i in range(pairs):
        x = (i - (pairs - 1) / 2) * length
        for side in (-1, 1):
            pieces.append(_desk(x, side * depth / 2, length, depth))
            at = x + rng.uniform(-0.2, 0.2)
            if rng.uniform() < 0.9:
                pieces.append(chair(at, side * depth, side, p_pushed_in, True, rng))
            if rng.uniform() < 0.8:
                pieces.append(_screen(at, side * 0.17, rng))
    return _island(pieces)


def table_with_chairs(
    length: float, depth: float, per_side: int, p_pushed_in: float, rng: np.random.Generator
) -> Group:
    """Return a table with as many chairs on both long sides."""
    pieces = [Piece("table", "table", rectangle(0, 0, length, depth), 0.0, DESK_TOP_M)]
    for side in (-1, 1):
        for i in range(per_side):
            x = (i + 0.5) * length / per_side - length / 2
            pieces.append(chair(x, side * depth / 2, side, p_pushed_in, False, rng))
    return _island(pieces)


def seminar_row(tables: int, p_pushed_in: float, rng: np.random.Generator) -> Group:
    """Return touching tables with two chairs each on one side, some of which touch."""
    length, depth = 1.4, 0.7
    pieces: list[Piece] = []
    for i in range(tables):
        x = (i - (tables - 1) / 2) * length
        pieces.append(Piece("table", "table", rectangle(x, 0, length, depth), 0.0, DESK_TOP_M))
        if rng.uniform() < 0.3:
            pieces += _touching(x, depth / 2 + rng.uniform(0.0, 0.1), 2, rng)
        else:
            for at in (x - length / 4, x + length / 4):
                pieces.append(chair(at, depth / 2, 1, p_pushed_in, False, rng))
    return _island(pieces)


def bench(rng: np.random.Generator) -> Group:
    """Return two laboratory benches back to back with a stool or two."""
    length, depth = 1.8, 0.75
    pieces = [
        Piece("bench", "table", rectangle(0, side * depth / 2, length, depth), 0.0, WORKTOP_M)
        for side in (-1, 1)
    ]
    for side in (-1, 1):
        if rng.uniform() < 0.6:
            pieces.append(chair(rng.uniform(-0.4, 0.4), side * depth, side, 0.2, True, rng))
    return _island(pieces)


def wall_bench() -> Group:
    """Return a laboratory bench at a wall."""
    footprint = rectangle(0, BEHIND_M + 0.375, 1.8, 0.75)
    return group([Piece("bench", "table", footprint, 0.0, WORKTOP_M)], FRONT_CLEAR_M)


def chair_row(n: int, rng: np.random.Generator) -> Group:
    """Return chairs side by side that touch, backs to the wall."""
    return group(_touching(0.0, BEHIND_M, n, rng), 0.5)


def cabinets(n: int, rng: np.random.Generator) -> Group:
    """Return equal cabinets side by side."""
    width = float(rng.choice(CABINET_WIDTHS_M))
    top = float(rng.choice(CABINET_TOPS_M))
    return group(_run("cabinet", n, width, 0.42, top), FRONT_CLEAR_M)


def shelves(n: int, rng: np.random.Generator) -> Group:
    """Return equal open shelves side by side."""
    depth, top = float(rng.choice((0.3, 0.35, 0.4))), round(float(rng.uniform(1.7, 2.2)), 2)
    return group(_run("shelf", n, float(rng.choice((0.8, 1.0))), depth, top), FRONT_CLEAR_M)


def kitchenette(rng: np.random.Generator) -> Group:
    """Return a worktop on cupboards with a refrigerator beside it."""
    n = int(rng.integers(3, 5))
    pieces = _run("counter", n, 0.6, 0.6, WORKTOP_M)
    x = n * 0.6 / 2 + 0.3
    fridge = rectangle(x, BEHIND_M + 0.3, 0.6, 0.6)
    return group([*pieces, Piece("cabinet", "other", fridge, 0.0, 1.8)], FRONT_CLEAR_M)


def washbasins(rng: np.random.Generator) -> Group:
    """Return one to three washbasins in a counter."""
    return group(_run("counter", int(rng.integers(1, 4)), 0.7, 0.5, 0.85), 0.8)


def clutter(rng: np.random.Generator) -> Group:
    """Return a bin, a cardboard box, a plant or a pedestal."""
    sizes = ((0.3, 0.3, 0.35), (0.4, 0.3, 0.3), (0.4, 0.4, 1.2), (0.43, 0.6, 0.58))
    width, depth, top = sizes[int(rng.integers(len(sizes)))]
    footprint = rectangle(0, BEHIND_M + depth / 2, width, depth)
    return group([Piece("clutter", "other", footprint, 0.0, top)], 0.0)


def column(ceiling_m: float, side_m: float, grid_m: float) -> Group:
    """Return a square column up to the ceiling, alone in its field of a grid."""
    piece = Piece("column", "other", rectangle(0, 0, side_m, side_m), 0.0, ceiling_m)
    return Group((piece,), (-side_m / 2, -side_m / 2), (side_m / 2, side_m / 2), grid_m)


def _desk(x: float, y: float, length: float, depth: float) -> Piece:
    return Piece("desk", "table", rectangle(x, y, length, depth), 0.0, DESK_TOP_M)


def _screen(x: float, y: float, rng: np.random.Generator) -> Piece:
    width, top = float(rng.choice((0.54, 0.61))), round(DESK_TOP_M + rng.uniform(0.42, 0.52), 2)
    return Piece("screen", "other", rectangle(x, y, width, 0.2), DESK_TOP_M, top)


def _run(kind: str, n: int, width: float, depth: float, top: float) -> list[Piece]:
    y = BEHIND_M + depth / 2
    return [
        Piece(kind, "other", rectangle((i - (n - 1) / 2) * width, y, width, depth), 0.0, top)
        for i in range(n)
    ]


def _touching(x: float, low_y: float, n: int, rng: np.random.Generator) -> list[Piece]:
    side = round(rng.uniform(0.44, 0.52), 2)
    top = round(float(np.clip(rng.normal(0.86, 0.05), 0.77, 1.0)), 2)
    places = [
        rectangle(x + (i - (n - 1) / 2) * side, low_y + side / 2, side, side) for i in range(n)
    ]
    return [Piece("chair", "chair", place, 0.0, top) for place in places]


def _island(pieces: Sequence[Piece], aisle_m: float = CHAIR_CLEAR_M) -> Group:
    """Return a group that stands in the open, with an aisle on all sides."""
    corners = np.concatenate([piece.corners for piece in pieces])
    (x0, y0), (x1, y1) = corners.min(axis=0) - aisle_m, corners.max(axis=0) + aisle_m
    return Group(tuple(pieces), (x0, y0), (x1, y1))
