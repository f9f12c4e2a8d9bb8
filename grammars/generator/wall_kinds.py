"""How thick the walls of a plan are: between rooms, along corridors, around the storey."""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from grammars.model import WallKind
from storage.plan import Plan

SPREAD_FLOOR_M = 0.01
"""Least spread of a thickness, metres: plaster. Assumption."""
METRE_DECIMALS = 4
BEYOND_M = 0.1
"""Rooms are looked for so far behind a wall's faces, metres."""


def kind_of(thickness_m: NDArray[np.float64]) -> WallKind | None:
    """Return the median of some thicknesses and the spread about it, None without any."""
    walls = thickness_m[thickness_m > 0]
    if not len(walls):
        return None
    median = float(np.median(walls))
    spread = max(float(np.sqrt(np.mean((walls - median) ** 2))), SPREAD_FLOOR_M)
    return WallKind(round(median, METRE_DECIMALS), round(spread, METRE_DECIMALS))


def outer_walls(plans: Sequence[Plan]) -> NDArray[np.float64]:
    """Return the thickness of each wall with a room on one of its sides only."""
    found = []
    for plan in plans:
        rooms = shapely.STRtree([room.polygon for room in plan.rooms])
        for wall in plan.walls:
            if wall.thickness_m is None:
                continue
            start, end = np.asarray(wall.line.coords)[[0, -1], :2]
            length = float(np.linalg.norm(end - start))
            if length == 0:
                continue
            normal = np.array((start[1] - end[1], end[0] - start[0])) / length
            away = (wall.thickness_m / 2 + BEYOND_M) * normal
            sides = shapely.points([(start + end) / 2 + away, (start + end) / 2 - away])
            if len(set(rooms.query(sides, "within")[0].tolist())) == 1:
                found.append(wall.thickness_m)
    return np.array(found, float)
