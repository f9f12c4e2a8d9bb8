"""How far each outline edge moves, and for which walls' sake."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tasks.layout.placement.facing import Facing

THIN_M, THICK_M = 0.06, 0.35
"""Two faces nearer to or further from each other are not those of one wall as it was built: one is
where its wall is not, metres. Assumption."""


class WallKey(NamedTuple):
    """A wall as corrections name it: a side of rooms, or the front or back of some."""

    kind: str
    row: int
    number: int
    """boundary of the row; for a front or back the first room that has it"""


@dataclass(frozen=True, eq=False)
class Moves:
    """c wishes that an edge move; an edge may have several."""

    edge: NDArray[np.int64]
    by_m: NDArray[np.float64]
    """(c, 2), outwards, of the edge's start and of its end"""
    sigma_m: NDArray[np.float64]
    wall: tuple[WallKey, ...]

    def at(self, which: NDArray[np.bool_]) -> "Moves":
        """Return some of the wishes."""
        wall = tuple(w for w, yes in zip(self.wall, which, strict=True) if yes)
        return Moves(self.edge[which], self.by_m[which], self.sigma_m[which], wall)


def all_moves(*parts: Moves) -> Moves:
    """Return the wishes of several sources."""
    return Moves(
        np.concatenate([np.zeros(0, np.int64), *(p.edge for p in parts)]),
        np.concatenate([np.zeros((0, 2)), *(p.by_m for p in parts)]),
        np.concatenate([np.zeros(0), *(p.sigma_m for p in parts)]),
        tuple(w for p in parts for w in p.wall),
    )


def without(moves: Moves, frozen: Collection[WallKey]) -> Moves:
    """Return the wishes of walls that may move."""
    return moves.at(np.array([w not in frozen for w in moves.wall], bool))


def agreed(
    moves: Moves, facing: Facing, lengths_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], dict[int, set[WallKey]]]:
    """Return how far each edge's ends move, (e, 2), and the walls each moved edge moves for.

    Parameters
    ----------
    lengths_m : (e,) float
        Lengths of all edges.

    Notes
    -----
    Several wishes for one edge count by their precisions. An edge without a wish that faces one
    that moves is the same wall's other face and moves along, by the share of its length that the
    moving one covers: rooms off the lines make way, and no wall grows thick. Where the two were no
    wall as it is built, one of them was hidden or never seen: the other stays, or makes way for the
    thinnest wall. Fronts take nobody along: what faces them is the corridor, whose faces the lines
    lie on.
    """
    weight = 1 / moves.sigma_m**2
    total, pull = np.zeros(len(lengths_m)), np.zeros((len(lengths_m), 2))
    np.add.at(total, moves.edge, weight)
    np.add.at(pull, moves.edge, weight[:, None] * moves.by_m)
    by = pull / np.where(total > 0, total, 1.0)[:, None]
    walls: dict[int, set[WallKey]] = {}
    fronts = set()
    for edge, wall in zip(moves.edge.tolist(), moves.wall, strict=True):
        walls.setdefault(edge, set()).add(wall)
        if wall.kind in ("front", "near", "corridor"):
            fronts.add(edge)
    wished = total > 0
    along = np.zeros_like(by)
    common = np.diff(facing.common_m, axis=1)[:, 0]
    for a, b, gap, run in zip(
        facing.a.tolist(), facing.b.tolist(), facing.gap_m.tolist(), common, strict=True
    ):
        for lead, other in ((a, b), (b, a)):
            if not wished[lead] or wished[other] or lead in fronts:
                continue
            moved = float(by[lead].mean())
            if not THIN_M <= gap <= THICK_M:
                left = gap - moved
                moved = float(np.clip(left, THIN_M, THICK_M)) - left
            if moved:
                along[other] -= moved * min(1.0, run / lengths_m[other])
                walls.setdefault(other, set()).update(walls[lead])
    return by + along, walls
