"""What of true furniture scans saw, and how it stands: apart, touching, half hidden."""

import itertools

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.plan import Plan, PlanFurniture
from storage.points import PointCloud
from tasks.simulation.furniture_solids import seat_height_m

SEPARATE, TOUCHING, HIDDEN = "separate", "touching", "half hidden"
STANDING = (SEPARATE, TOUCHING, HIDDEN)
CELL_M = 0.04
NEAR_M = 0.04
"""How far a point may lie off the surface it shows, metres: noise and drift."""
LEAST = 0.1
"""Share of a surface's cells from which it counts as seen."""
BACK_POINTS = 15
"""Points over a seat from which a chair's back counts as seen."""
TOUCH_M = 0.03
"""Distance under which two pieces touch, metres."""
UNDER, HALF = 0.3, 0.5
"""Share of a chair under a table, and seen share of a level surface, at which it is half hidden."""


def seen_shares(truth: Plan, clouds: list[PointCloud]) -> NDArray[np.float64]:
    """Return of each true piece the (n, 2) shares seen by all scans together.

    The first is of its level surface (a chair's seat), in cells of 4 cm that hold a point within
    4 cm of its height; the second of what stands upright: of a chair 1 if its back was seen, of
    anything else but tables the best seen of those of its sides that stand at no wall.
    """
    xyz = np.concatenate([cloud.xyz + cloud.origin for cloud in clouds]).astype(np.float32)
    xyz = xyz[np.argsort(xyz[:, 0])]
    walls = shapely.union_all([room.polygon.boundary for room in truth.rooms])
    shapely.prepare(walls)
    found = np.zeros((len(truth.furniture), 2))
    for i, piece in enumerate(truth.furniture):
        x_low, y_low, x_high, y_high = shapely.buffer(piece.footprint, NEAR_M).bounds
        first, last = np.searchsorted(xyz[:, 0], (x_low, x_high))
        near = xyz[first:last]
        near = near[(near[:, 1] > y_low) & (near[:, 1] < y_high)].astype(float)
        inside = near[shapely.contains_xy(piece.footprint, near[:, 0], near[:, 1])]
        found[i] = _level(piece, inside), _upright(piece, inside, near, walls)
    return found


def is_seen(shares: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which pieces some scan saw: a tenth of their level surface, or of a side."""
    seen: NDArray[np.bool_] = (shares >= LEAST).any(axis=1)
    return seen


def standing(truth: Plan, shares: NDArray[np.float64]) -> NDArray[np.str_]:
    """Return of each true piece how it stands, one of STANDING.

    Half hidden: a chair with 30 % of it under a table, or a piece of whose level surface no half
    was seen; touching: within 3 cm of another of its class, and not under a table.
    """
    pieces = truth.furniture
    shapes = np.array([piece.footprint for piece in pieces], object)
    names = np.array([piece.class_ for piece in pieces])
    found = np.full(len(pieces), SEPARATE, "U16")
    for i, piece in enumerate(pieces):
        alike = (names == piece.class_) & (np.arange(len(pieces)) != i)
        tables = shapely.intersection(shapes[names == "table"], piece.footprint)
        under = shapely.area(tables).max(initial=0.0) > UNDER * piece.footprint.area
        if piece.class_ == "chair" and under:
            found[i] = HIDDEN
        elif shapely.dwithin(shapes[alike], piece.footprint, TOUCH_M).any():
            found[i] = TOUCHING
        elif shares[i, 0] < HALF:
            found[i] = HIDDEN
    return found


def _level(piece: PlanFurniture, inside: NDArray[np.float64]) -> float:
    height = _surface(piece)
    level = inside[np.abs(inside[:, 2] - height) < NEAR_M, :2]
    return min(_cells(level) * CELL_M**2 / piece.footprint.area, 1.0)


def _surface(piece: PlanFurniture) -> float:
    if piece.class_ == "chair":
        return float(piece.base_m + seat_height_m(piece.base_m, piece.top_m))
    return float(piece.top_m)


def _upright(
    piece: PlanFurniture,
    inside: NDArray[np.float64],
    near: NDArray[np.float64],
    walls: shapely.Geometry,
) -> float:
    if piece.class_ == "table":
        return 0.0
    if piece.class_ == "chair":
        over = inside[:, 2] > _surface(piece) + 0.08
        return float((over & (inside[:, 2] < piece.top_m + 0.03)).sum() >= BACK_POINTS)
    corners = shapely.get_coordinates(piece.footprint.exterior)
    best = 0.0
    for start, end in itertools.pairwise(corners):
        length = float(np.linalg.norm(end - start))
        # a side at a wall shows the wall's points, not the piece's
        if length < CELL_M or shapely.dwithin(walls, shapely.Point((start + end) / 2), 0.1):
            continue
        axis = (end - start) / length
        along, off = (near[:, :2] - start) @ axis, (near[:, :2] - start) @ (-axis[1], axis[0])
        held = (np.abs(off) < NEAR_M) & (along > 0) & (along < length)
        held &= (near[:, 2] > piece.base_m + 0.1) & (near[:, 2] < piece.top_m - 0.05)
        area = length * max(piece.top_m - piece.base_m - 0.15, CELL_M)
        cells = _cells(np.column_stack((along[held], near[held, 2])))
        best = max(best, cells * CELL_M**2 / area)
    return min(best, 1.0)


def _cells(places: NDArray[np.float64]) -> int:
    return len(np.unique(np.floor(places / CELL_M).astype(np.int64), axis=0))
