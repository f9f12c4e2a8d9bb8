"""Fronts and backs of a row's rooms: each is one straight wall across several rooms."""

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
    The depths of edges on one wall, each with a variance that grows as less of it was seen, and
    the mean depth by the rules of the rooms that end there, once, are fused by their precisions.
    """
    t, facing = row.frame.local(edges.middle)[:, 1], edges.outward @ row.frame.left
    ends = row.frame.local(edges.ends)[..., 1]
    sigma = face_sigma(seen, face_sigma_m)
    of_row = part_of[edges.shape] & (t > -align_m)
    parts = []
    for kind, look, near in (("front", -facing, t < FRONT_M), ("back", facing, t > FRONT_M)):
        of_kind = of_row & near & (look > SQUARE_COS)
        long = np.flatnonzero(of_kind & (edges.length_m >= SHORTEST_M))
        jogs = np.flatnonzero(of_kind & (edges.length_m < SHORTEST_M))
        walls = _on_one_wall(long, t, sigma, align_m, limit)
        main = _of_the_row(walls, edges)
        sign = 1 if kind == "back" else -1
        for wall in walls:
            at, spread = _fused(wall, t, sigma)
            if kind == "back":
                at, spread = _with_rules(at, spread, wall, t, edges, depth_m, depth_spread_m, limit)
            moves = np.abs(at - t[wall]) <= limit * sigma[wall]
            if main is not None and wall is not main:
                place, of_main = _fused(main, t, sigma)
                depth = depth_m[edges.shape[wall[0]]] if kind == "back" else np.nan
                alone = len(np.unique(edges.shape[wall])) == 1
                before = 0 < sign * (place - at) <= hidden_m
                if alone and before and not abs(depth - place) > abs(depth - at):
                    at, spread, moves = place, of_main, np.ones(len(wall), bool)
            edge = _with_jogs(wall[moves], jogs, t, edges)
            by = sign * (at - ends[edge])
            keys = tuple(WallKey(kind, number, int(i)) for i in first[edges.shape[edge]])
            parts.append(Moves(edge, by, np.full(len(edge), spread), keys))
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
    places = [float(_fused(wall, t, sigma)[0]) for wall in walls]
    for edge in edges[~sharp]:
        away = [abs(place - t[edge]) for place in places]
        if away and min(away) <= limit * sigma[edge]:
            nearest = int(np.argmin(away))
            walls[nearest] = np.append(walls[nearest], edge)
        else:
            walls.append(np.array([edge]))
    return walls


def _fused(
    wall: NDArray[np.int64], t: NDArray[np.float64], sigma: NDArray[np.float64]
) -> tuple[float, float]:
    weight = 1 / sigma[wall] ** 2
    return float(weight @ t[wall] / weight.sum()), float(1 / np.sqrt(weight.sum()))


def _with_rules(
    at: float,
    sigma: float,
    wall: NDArray[np.int64],
    t: NDArray[np.float64],
    edges: Edges,
    depth_m: NDArray[np.float64],
    depth_spread_m: NDArray[np.float64],
    limit: float,
) -> tuple[float, float]:
    """Return a back wall's depth and deviation with what the rules say of it, if they agree."""
    rooms = np.unique(edges.shape[wall])
    rooms = rooms[~np.isnan(depth_m[rooms])]
    agree = np.abs(depth_m[rooms] - at) <= limit * np.hypot(sigma, depth_spread_m[rooms])
    if not agree.any():
        return at, sigma
    # rooms of one row share their depth: what rules say of it counts once
    rule = float(depth_m[rooms][agree].mean())
    spread = float(depth_spread_m[rooms][agree].mean())
    weights = np.array([1 / sigma**2, 1 / spread**2])
    return float(weights @ (at, rule) / weights.sum()), float(1 / np.sqrt(weights.sum()))
