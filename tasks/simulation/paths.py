"""Where a person can stand in a room, and a way from spot to spot through it."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree
from shapely import Polygon

CELL_M = 0.2
"""Spacing of the places a way leads over, metres: less than a step."""
FROM_FURNITURE_M = 0.35
"""Distance of a standing person from furniture one looks over. Assumption."""
PASSING_M = 0.3
"""Distance of a passing person's middle from everything: half of one's breadth. Assumption."""
SMOOTH = 5
"""Places of a way that are averaged into one, so that it bends instead of zigzagging."""


@dataclass(frozen=True, eq=False)
class Tour:
    """A way over p places, with stops at n of them."""

    places: NDArray[np.float64]
    """(p, 2), metres"""
    stops: NDArray[np.int64]
    """(n,), ascending indices of places; the first is 0, the last p - 1"""


def tour(
    room: Polygon,
    furniture: tuple[Polygon, ...],
    from_wall_m: float,
    n: int,
    rng: np.random.Generator,
) -> Tour:
    """Return a way through a room by up to n spots, each as far as can be from those before it.

    Parameters
    ----------
    room : the floor one can stand on, without what is as tall as a person, metres
    furniture : footprints of what one looks over, metres
    from_wall_m : distance kept from the walls where there is room for it, metres
    n : spots; fewer in a room with fewer places
    """
    floor = _floor(room, furniture, from_wall_m)
    spots = floor.roomy[_spread(floor.places[floor.roomy], n, rng)]
    lengths, before = dijkstra(floor.steps, indices=spots, return_predecessors=True)
    order = _nearest_next(lengths[:, spots])
    way, stops = [int(spots[order[0]])], [0]
    for start, end in pairwise(order):
        leg = [int(spots[end])]
        while leg[-1] != spots[start]:
            leg.append(int(before[start, leg[-1]]))
        way += leg[-2::-1]
        stops.append(len(way) - 1)
    return Tour(_smoothed(floor.places[way], np.array(stops)), np.array(stops))


@dataclass(frozen=True, eq=False)
class _Floor:
    """m places of a room that are connected."""

    places: NDArray[np.float64]
    """(m, 2), metres"""
    roomy: NDArray[np.int64]
    """those of them where one would stop, at least one"""
    steps: csr_array
    """(m, m), lengths of the steps between neighbours, metres"""


def _floor(room: Polygon, furniture: tuple[Polygon, ...], from_wall_m: float) -> _Floor:
    """Return the connected floor of a room that has most places to stop at."""
    passable = _free(room, furniture, PASSING_M, PASSING_M)
    if passable.is_empty:  # a closet: from the middle
        places = shapely.get_coordinates(room.representative_point())
        return _Floor(places, np.zeros(1, np.int64), _steps(places))
    low, high = np.split(np.array(passable.bounds), 2)
    x, y = (np.arange(low[i], high[i] + CELL_M, CELL_M) for i in range(2))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    middle = shapely.get_coordinates(passable.representative_point())
    places = np.concatenate((middle, grid[shapely.contains_xy(passable, grid)]))
    roomy = shapely.contains_xy(_free(room, furniture, from_wall_m, FROM_FURNITURE_M), places)
    _, part = connected_components(_steps(places), directed=False)
    # a place to stop outweighs any number of places to pass
    kept = part == np.bincount(part, weights=np.where(roomy, float(len(places)), 1.0)).argmax()
    places, roomy = places[kept], roomy[kept]
    stops = np.flatnonzero(roomy if roomy.any() else np.ones(len(places), bool))
    return _Floor(places, stops, _steps(places))


def _free(
    room: Polygon, furniture: tuple[Polygon, ...], from_wall_m: float, from_furniture_m: float
) -> Polygon:
    around = [piece.buffer(from_furniture_m) for piece in furniture]
    return room.buffer(-from_wall_m).difference(shapely.union_all(around))


def _steps(places: NDArray[np.float64]) -> csr_array:
    """Return the (m, m) lengths of the steps between neighbouring places, metres."""
    pairs = cKDTree(places).query_pairs(1.5 * CELL_M, output_type="ndarray")
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    lengths = np.linalg.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1)
    both = np.concatenate((pairs, pairs[:, ::-1]))
    m = len(places)
    return csr_array((np.tile(lengths, 2), both.T), shape=(m, m))


def _spread(places: NDArray[np.float64], n: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return up to n indices of places, each as far as can be from those before it."""
    chosen = [int(rng.integers(len(places)))]
    gap = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < n and gap.max() > CELL_M:
        chosen.append(int(gap.argmax()))
        gap = np.minimum(gap, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return np.array(chosen)


def _nearest_next(lengths: NDArray[np.float64]) -> list[int]:
    """Return an order of n spots from the first one, going on to the nearest that is left."""
    order, left = [0], set(range(1, len(lengths)))
    while left:
        order.append(min(left, key=lambda spot: (lengths[order[-1], spot], spot)))
        left.remove(order[-1])
    return order


def _smoothed(way: NDArray[np.float64], stops: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return a way with its bends rounded and its stops where they were."""
    half = SMOOTH // 2
    padded = np.pad(way, ((half, half), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, SMOOTH, axis=0)
    smooth: NDArray[np.float64] = windows.mean(axis=-1)
    smooth[stops] = way[stops]
    return smooth
