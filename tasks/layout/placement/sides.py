"""Side walls of rooms along reference lines: which edges lie on them, and where these go."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from storage.layout import HIDDEN, LINE_END
from tasks.layout.placement.choice import Choice
from tasks.layout.placement.decoded_rows import DecodedRow
from tasks.layout.placement.hypotheses import THICKEST_M, Hypotheses
from tasks.layout.placement.moves import Moves, WallKey
from tasks.layout.placement.outline import Edges
from tasks.layout.placement.seen import face_sigma
from tasks.layout.placement.widths import Chain, Fused, Tie

SQUARE_COS = np.cos(np.radians(8))
"""Edges turned further from square on the line are no side walls of its rooms."""
THINNEST_M = 0.04
"""No wall between rooms is thinner, metres: plaster slabs of 50 mm (DIN EN 12859), as seen."""
TIE_SIGMA_M = 0.02
"""A wall that two lines cross is straight but for this, metres."""
ASTRAY_M = 0.5
"""How far from its wall a room's side may have been put in the initial model, metres."""
END_REACH_M = 1.0
"""An end room's outer wall is looked for so far around the line's end, metres: a room in a corner
may reach past it."""


@dataclass(frozen=True, eq=False)
class Sides:
    """a edges that lie on side walls: entry i says that an edge is a face of a row's boundary."""

    row: NDArray[np.int64]
    boundary: NDArray[np.int64]
    side: NDArray[np.int64]
    """(a,), 0: lower face, of the room before the wall; 1: upper face, of the one after"""
    edge: NDArray[np.int64]
    at_m: NDArray[np.float64]
    """(a, 2), where along the line the edge starts and ends"""


def find_sides(
    rows: Sequence[DecodedRow],
    edges: Edges,
    stands: NDArray[np.bool_],
    shape_of: NDArray[np.int64],
    partition_m: float,
    on_wall_m: float,
    firm_presence: float,
) -> Sides:
    """Return which edges lie on the side walls of each row's rooms.

    Parameters
    ----------
    stands : (rows, shapes) bool
        Which outlines stand on which line.
    shape_of : (rooms,) int
        The outline each initial room is part of.
    partition_m : float
        Thickness of the grammar's partitions: where a face that was not seen is expected.
    on_wall_m : float
        An edge nearer to a wall's face lies on it.
    firm_presence : float
        Presence from which a wall whose two faces were seen is well observed.

    Notes
    -----
    The outline right beside a wall has a side on it: where none is as near, the longest one no
    further than ASTRAY_M is it, and was put elsewhere in the initial model. Where a short one lies
    on a well-observed wall and a longer one no further before it, furniture hides the wall for most
    of the room's depth: these are its side as well.
    """
    found, at = [np.zeros((0, 4), np.int64)], [np.zeros((0, 2))]
    for number, row in enumerate(rows):
        s, t = row.frame.local(edges.middle).T
        ends = row.frame.local(edges.ends)[..., 0]
        of_row = stands[number][edges.shape] & (t > 0)
        facing = edges.outward @ row.frame.along
        firm = row.firm(firm_presence)
        for k, cut in enumerate(row.cuts):
            if cut == HIDDEN:
                continue
            for side, look in ((0, facing), (1, -facing)):
                beside = of_row & (look > SQUARE_COS)
                if cut == LINE_END and side != int(k == 0):
                    continue  # the rooms beyond are another line's
                if cut == LINE_END and not row.walled_ends[k]:
                    on = beside & (np.abs(s - row.chain.observed_m[k]) <= END_REACH_M)
                else:
                    face = row.faces_m[k, side]
                    if np.isnan(face):
                        face = row.chain.observed_m[k] + (side - 0.5) * partition_m
                    away = np.where(beside, np.abs(s - face), np.nan)
                    on = away <= on_wall_m
                    room = row.room_beside(k, side)
                    own = edges.shape == shape_of[room] if room >= 0 else np.zeros(len(s), bool)
                    astray = np.where(own & (away <= ASTRAY_M), edges.length_m, 0.0)
                    if not (on & own).any() and astray.any():
                        on[astray.argmax()] = True
                    elif firm[k] and not np.isnan(row.faces_m[k, side]):
                        # the room's side is where most of it is: what stands before is furniture
                        before = astray * ((1 - 2 * side) * (face - s) > 0) * ~on
                        if before.max(initial=0.0) > astray[on].sum():
                            on |= before > 0
                edge = np.flatnonzero(on)
                found.append(np.column_stack([np.full((len(edge), 3), (number, k, side)), edge]))
                at.append(ends[edge])
    row_, boundary, side_, edge_ = np.concatenate(found).T
    return Sides(row_, boundary, side_, edge_, np.concatenate(at))


def with_end_walls(
    rows: Sequence[DecodedRow],
    sides: Sides,
    seen: NDArray[np.float64],
    face_sigma_m: float,
    axis_sigma_m: float,
) -> list[Chain]:
    """Return the rows' chains, the ends as uncertain as the end rooms' outer walls are.

    Parameters
    ----------
    seen : (e,) float
        Share of each edge along which a wall was seen.
    axis_sigma_m : float
        Standard deviation of an outer wall's axis where its inner face is known.
    """
    chains = []
    for number, row in enumerate(rows):
        sigma = row.chain.sigma_m.copy()
        for k in np.flatnonzero((row.cuts == LINE_END) & ~row.walled_ends):
            on = sides.edge[(sides.row == number) & (sides.boundary == k)]
            if len(on):
                face = face_sigma(seen[on].max(), face_sigma_m)
                sigma[k] = np.hypot(face, axis_sigma_m)
        chains.append(replace(row.chain, sigma_m=sigma))
    return chains


def shared_walls(rows: Sequence[DecodedRow], sides: Sides, edges: Edges) -> list[Tie]:
    """Return the walls that two parallel lines cross, found by the edges both claim."""
    ties: dict[tuple[int, int, int, int], Tie] = {}
    for edge in np.unique(sides.edge):
        on = np.flatnonzero(sides.edge == edge)
        for i in on:
            for j in on[on > i]:
                a, b = int(sides.row[i]), int(sides.row[j])
                f, g = rows[a].frame, rows[b].frame
                sign = float(np.sign(f.along @ g.along))
                if a == b or abs(f.along @ g.along) < SQUARE_COS:
                    continue
                # the same point of the edge along both lines
                offset = float((sides.at_m[j] - sign * sides.at_m[i]).mean())
                k, m = int(sides.boundary[i]), int(sides.boundary[j])
                if rows[a].cuts[k] >= 0 and rows[b].cuts[m] >= 0:
                    ties.setdefault((a, k, b, m), Tie(a, k, b, m, sign, offset, TIE_SIGMA_M))
    return list(ties.values())


def thickness(
    row: DecodedRow, fused: Fused, hypotheses: Sequence[Hypotheses], choice: Choice
) -> NDArray[np.float64]:
    """Return the thickness of each boundary's wall, (n + 1,); 0 where a line ends at none seen.

    By the chosen hypothesis: a wall of which one face is known is as thick as its centre is off
    that face.
    """
    found = [
        np.clip(wall.thickness_at(h, at), THINNEST_M, THICKEST_M)
        for wall, h, at in zip(hypotheses, choice.walls.tolist(), fused.position_m, strict=True)
    ]
    return np.where((row.cuts == LINE_END) & ~row.walled_ends, 0.0, found)


def side_moves(
    rows: Sequence[DecodedRow],
    sides: Sides,
    chains: Sequence[Chain],
    fused: Sequence[Fused],
    thick: Sequence[NDArray[np.float64]],
    explained: Sequence[NDArray[np.bool_]],
    axis_sigma_m: float,
) -> Moves:
    """Return how edges on side walls move, outwards, so that they lie on the fused walls' faces.

    Walls between rooms of a row stand square on its line. Those between two rooms that no rule
    explains stay as observed. Of an end room's outer wall
    only the face was seen: it follows its axis by the share of the axis' variance that is its own.
    """
    kept, by, sigma, key = [], [], [], []
    for i in range(len(sides.edge)):
        r, k, side = int(sides.row[i]), int(sides.boundary[i]), int(sides.side[i])
        if not explained[r][max(k - 1, 0) : k + 1].any():
            continue
        position, outwards = fused[r].position_m[k], 1 if side == 0 else -1
        if rows[r].cuts[k] == LINE_END and not rows[r].walled_ends[k]:
            share = 1 - min(axis_sigma_m / chains[r].sigma_m[k], 1.0) ** 2
            move = np.full(2, share * (position - chains[r].observed_m[k]))
        else:
            move = position - outwards * thick[r][k] / 2 - sides.at_m[i]
        kept.append(i)
        by.append(outwards * move)
        sigma.append(float(fused[r].sigma_m[k]))
        key.append(WallKey("side", r, k))
    return Moves(
        sides.edge[kept], np.array(by, float).reshape(-1, 2), np.array(sigma, float), tuple(key)
    )
