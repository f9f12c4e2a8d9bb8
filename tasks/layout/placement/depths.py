"""Fronts and backs of a row's rooms: each is one straight wall across several rooms."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tasks.layout.placement.decoded_rows import DecodedRow
from tasks.layout.placement.moves import Moves, WallKey, all_moves
from tasks.layout.placement.outline import Edges
from tasks.layout.placement.seen import face_sigma

SQUARE_COS = np.cos(np.radians(8))
"""Edges turned further from a line are no front or back of its rooms."""
SHORTEST_M = 0.5
"""A shorter edge is a niche or a pillar, metres: it tells of no wall, but goes with its room's."""
JOG_M = 0.3
"""An edge no further off the one of its room that moves goes with it, metres."""
ENOUGH, MOST = 3, 0.5
"""A wall that so many rooms have, and so much of a row's length lies on, is the row's."""
SLOPE_RAD = 0.0015
"""Standard deviation of a wall's turn against the line of its row, radians: a line derived from a
drifting scan of the corridor is turned by a tenth of a degree. Assumption."""
ON_LINE_M = 0.04
"""A front nearer to its line is the corridor's side of the wall, metres: the room's was not seen.
No wall is thinner (plaster slabs of 50 mm, DIN EN 12859, as seen)."""
FRONT_M = 0.7
"""A front is no further from its line than a thick wall, metres."""


def depth_moves(
    number: int,
    row: DecodedRow,
    edges: Edges,
    first: NDArray[np.int64],
    depth_m: NDArray[np.float64],
    depth_spread_m: NDArray[np.float64],
    part_of: NDArray[np.bool_],
    seen: NDArray[np.float64],
    face_sigma_m: float,
    align_m: float,
    hidden_m: float,
    limit: float,
) -> Moves:
    """Return how a row's fronts and backs move, outwards, so that they lie on straight walls.

    Parameters
    ----------
    number : of the row
    first : (shapes,) the first initial room of each outline
    depth_m, depth_spread_m : (shapes,) depth by each outline's rule; NaN: any
    part_of : (shapes,) whether an outline stands on the line and a rule explains it
    seen : (e,) share of each edge along which a wall was seen
    face_sigma_m : standard deviation of a face seen along all its length
    align_m : edges whose depths have no greater gap between them lie on one wall
    hidden_m : a single room's face no further before the wall of its row is furniture that hides
        it, unless the rule's depth tells otherwise
    limit : a face is moved by no more than this many of its standard deviations otherwise

    Notes
    -----
    A wall is the straight line of least squares through the edges on it, each with a variance that
    grows as less of it was seen, nearly parallel to the row's. A front on the line itself, on the
    corridor's side of the wall, goes to where most of the row's fronts are. The mean
    depth by the rules of the rooms that end there, once, is fused with it by their precisions.
    """
    s, t = row.frame.local(edges.middle).T
    facing = edges.outward @ row.frame.left
    along, ends = np.moveaxis(row.frame.local(edges.ends), -1, 0)
    sigma = face_sigma(seen, face_sigma_m)
    of_row = part_of[edges.shape] & (t > -align_m)
    parts = []
    for kind, look, near in (("front", -facing, t < FRONT_M), ("back", facing, t > FRONT_M)):
        of_kind = of_row & near & (look > SQUARE_COS)
        long = np.flatnonzero(of_kind & (edges.length_m >= SHORTEST_M))
        jogs = np.flatnonzero(of_kind & (edges.length_m < SHORTEST_M))
        on_line = long[np.abs(t[long]) < ON_LINE_M] if kind == "front" else long[:0]
        walls = _on_one_wall(np.setdiff1d(long, on_line), t, sigma, align_m, limit)
        main = _of_the_row(walls, edges)
        if len(on_line) and walls:
            longest = max(walls, key=lambda wall: float(edges.length_m[wall].sum()))
            straight = _straight(longest, s, t, sigma)
            edge = _with_jogs(on_line, jogs, t, edges)
            by = ends[edge] - straight.at(along[edge])
            keys = tuple(WallKey(kind, number, int(i)) for i in first[edges.shape[edge]])
            parts.append(Moves(edge, by, np.full(len(edge), straight.spread_m), keys))
        sign = 1 if kind == "back" else -1
        for wall in walls:
            straight = _straight(wall, s, t, sigma)
            if kind == "back":
                straight = _with_rules(straight, wall, edges, depth_m, depth_spread_m, limit)
            moves = np.abs(straight.at(s[wall]) - t[wall]) <= limit * sigma[wall]
            if main is not None and wall is not main:
                of_main = _straight(main, s, t, sigma)
                at, place = (float(line.at(s[wall]).mean()) for line in (straight, of_main))
                depth = depth_m[edges.shape[wall[0]]] if kind == "back" else np.nan
                alone = len(np.unique(edges.shape[wall])) == 1
                before = 0 < sign * (place - at) <= hidden_m
                if alone and before and not abs(depth - place) > abs(depth - at):
                    straight, moves = of_main, np.ones(len(wall), bool)
            edge = _with_jogs(wall[moves], jogs, t, edges)
            by = sign * (straight.at(along[edge]) - ends[edge])
            keys = tuple(WallKey(kind, number, int(i)) for i in first[edges.shape[edge]])
            parts.append(Moves(edge, by, np.full(len(edge), straight.spread_m), keys))
    return all_moves(*parts)


def _of_the_row(walls: list[NDArray[np.int64]], edges: Edges) -> NDArray[np.int64] | None:
    """Return the wall that most of a row's rooms share, None where they share none."""
    lengths = [float(edges.length_m[wall].sum()) for wall in walls]
    if not walls or max(lengths) < MOST * sum(lengths):
        return None
    main = walls[int(np.argmax(lengths))]
    return main if len(np.unique(edges.shape[main])) >= ENOUGH else None


def _with_jogs(
    moving: NDArray[np.int64], jogs: NDArray[np.int64], t: NDArray[np.float64], edges: Edges
) -> NDArray[np.int64]:
    """Return edges with the short ones of their rooms that are jogs of the same wall."""
    same = edges.shape[jogs][:, None] == edges.shape[moving][None, :]
    near = np.abs(t[jogs][:, None] - t[moving][None, :]) <= JOG_M
    return np.concatenate([moving, jogs[(same & near).any(axis=1)]])


def _on_one_wall(
    edges: NDArray[np.int64],
    t: NDArray[np.float64],
    sigma: NDArray[np.float64],
    align_m: float,
    limit: float,
) -> list[NDArray[np.int64]]:
    """Return the edges wall by wall: well-seen ones first, the others join the nearest wall."""
    if not len(edges):
        return []
    sharp = sigma[edges] * limit <= 2 * align_m
    ordered = edges[sharp][np.argsort(t[edges[sharp]], kind="stable")]
    gaps = np.flatnonzero(np.diff(t[ordered]) > align_m) + 1
    walls = [wall for wall in np.split(ordered, gaps) if len(wall)]
    places = [float(np.average(t[wall], weights=1 / sigma[wall] ** 2)) for wall in walls]
    for edge in edges[~sharp]:
        away = [abs(place - t[edge]) for place in places]
        if away and min(away) <= limit * sigma[edge]:
            nearest = int(np.argmin(away))
            walls[nearest] = np.append(walls[nearest], edge)
        else:
            walls.append(np.array([edge]))
    return walls


class _Straight(NamedTuple):
    """A straight wall beside a row."""

    place_m: float
    """depth at its middle"""
    middle_m: float
    """along the row"""
    slope: float
    spread_m: float
    """standard deviation of its place"""

    def at(self, s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return its depth at places along the row."""
        return self.place_m + self.slope * (s - self.middle_m)


def _straight(
    wall: NDArray[np.int64],
    s: NDArray[np.float64],
    t: NDArray[np.float64],
    sigma: NDArray[np.float64],
) -> _Straight:
    """Return the straight wall that edges of depths t at s lie on, turned by SLOPE_RAD or so."""
    weight = 1 / sigma[wall] ** 2
    place, middle = (float(weight @ x[wall] / weight.sum()) for x in (t, s))
    off = s[wall] - middle
    slope = float(weight @ (off * (t[wall] - place)) / (weight @ off**2 + SLOPE_RAD**-2))
    return _Straight(place, middle, slope, float(1 / np.sqrt(weight.sum())))


def _with_rules(
    straight: _Straight,
    wall: NDArray[np.int64],
    edges: Edges,
    depth_m: NDArray[np.float64],
    depth_spread_m: NDArray[np.float64],
    limit: float,
) -> _Straight:
    """Return a back wall with what the rules say of its depth, if they agree with it."""
    at, sigma = straight.place_m, straight.spread_m
    rooms = np.unique(edges.shape[wall])
    rooms = rooms[~np.isnan(depth_m[rooms])]
    agree = np.abs(depth_m[rooms] - at) <= limit * np.hypot(sigma, depth_spread_m[rooms])
    if not agree.any():
        return straight
    # rooms of one row share their depth: what rules say of it counts once
    rule = float(depth_m[rooms][agree].mean())
    spread = float(depth_spread_m[rooms][agree].mean())
    weights = np.array([1 / sigma**2, 1 / spread**2])
    place, spread = float(weights @ (at, rule) / weights.sum()), float(1 / np.sqrt(weights.sum()))
    return straight._replace(place_m=place, spread_m=spread)
