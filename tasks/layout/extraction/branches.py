"""Branches of a reference line: walls across it, from their faces (Sec. 4.2.2, Fig. 8 lines 2-9).

The paper takes each orthogonal segment for a branch and skips one that follows another by less
than tau. Which of the two stays decides where the room ends, half a wall off either way. Here the
two faces of one wall are told by what they face: the lower one is seen by the room before the wall,
the upper one by the room behind it, and the cut runs in the middle between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from tasks.layout.extraction.model import LineFrame, Model
from tasks.layout.extraction.presence import PresenceParams, presence
from tasks.layout.extraction.sheets import Sheet
from tasks.layout.extraction.walls import (
    PairParams,
    covered_share,
    depth_behind,
    pair_faces,
    wall_of,
)


class BranchParams(PairParams):
    """How faces across a line become walls across it."""

    outer_m: PositiveFloat = 0.3
    """Thickness of a wall behind which lies nothing of the storey, metres: a brick of 300 mm (DIN
    105). Assumption."""
    sliver_m: PositiveFloat = 0.8
    """Of two walls nearer to each other the less probable is none, metres: a quarter of the
    published widths are slivers. Assumption."""
    presence_min: float = Field(default=0.05, ge=0, lt=1)
    """What is less probably a wall than this is left out. Assumption."""
    presence: PresenceParams = PresenceParams()
    """How probable it is that a branch divides rooms."""


BEYOND = 0.3
"""How far behind a face its room is looked for, metres."""
OUTER_M = 1.0
"""How far from a corridor's end an outer wall is expected at most, metres. Assumption."""
DEPTHS = np.array([0.15, 0.3, 0.45, 0.6, 0.75, 0.9])
"""Where in the depth of the rooms it is asked who lies beside a wall."""


@dataclass(frozen=True, eq=False)
class Branches:
    """b walls across a line, along it."""

    at: NDArray[np.float64]
    """(b,), centre of the wall, metres along the line"""
    faces: NDArray[np.float64]
    """(b, 2), lower and upper; NaN where not seen"""
    sigma: NDArray[np.float64]
    scans: NDArray[np.int64]
    presence: NDArray[np.float64]
    beside: NDArray[np.int64]
    """(b, 2), the room most of its lower and of its upper side look into, -1 none"""
    outliers: tuple[tuple[int, ...], ...]

    def take(self, keep: NDArray[np.int64]) -> "Branches":
        """Return some of them."""
        return Branches(
            self.at[keep],
            self.faces[keep],
            self.sigma[keep],
            self.scans[keep],
            self.presence[keep],
            self.beside[keep],
            tuple(self.outliers[i] for i in keep),
        )


def join_faces(
    sheets: Sequence[Sheet],
    frame: LineFrame,
    front_m: float,
    depth_m: float,
    model: Model,
    partition: tuple[float, float],
    params: BranchParams,
) -> Branches:
    """Return the walls that faces across a line belong to.

    Parameters
    ----------
    front_m, depth_m : float
        Where the rooms' front and rear walls are, to the left of the line, metres.
    partition : usual thickness of a wall between rooms, and its spread, metres

    Notes
    -----
    The variance of a wall's centre is a quarter of the sum of its faces'; where one face was seen
    only, the face's and that of half the usual thickness; where it is not known which side of the
    wall was seen, the face's and a quarter of the thickness squared.
    """
    pairs, single = pair_faces(sheets, partition[0], params)
    walls = [wall_of(m, sheets, partition) for m in (*pairs, *((i,) for i in single))]
    walls.sort(key=lambda w: w.at)
    at = np.array([w.at for w in walls])
    half = np.array([w.half for w in walls])
    depth = np.array([depth_behind(w, depth_m) for w in walls])
    left = front_m + DEPTHS[None] * (depth - front_m)[:, None]
    sides = [
        model.room_at(frame.building(np.stack([x[:, None] + 0 * left, left], axis=-1)))
        for x in (at - half - BEYOND, at + half + BEYOND)
    ]
    divides = (sides[0] != sides[1]).mean(axis=1) if len(walls) else np.empty(0)
    covered = np.array([covered_share(w, front_m, d) for w, d in zip(walls, depth, strict=True)])
    scans = np.array([w.n_scans for w in walls], np.int64)
    both = np.array([len(w.seen) == 2 for w in walls], bool)
    height = np.array([min(w.height / model.height_m, 1.0) for w in walls])
    # behind an outer wall is nobody who could have seen its other face; along the corridor there
    # is a room behind each wall, mapped or not
    beyond = (at < OUTER_M) | (at > frame.length - OUTER_M)
    outer = np.array([(s < 0).all(axis=1) for s in sides]).any(axis=0) & beyond
    thick = np.array([w.single for w in walls], int)
    shift = np.where(outer & (thick != 0), thick * (params.outer_m - partition[0]) / 2, 0.0)
    return Branches(
        at=at + shift,
        faces=np.array([w.faces for w in walls]).reshape(-1, 2),
        sigma=np.array([w.sigma for w in walls], float),
        scans=scans,
        presence=presence(divides, covered, both | outer, height, scans, params.presence),
        beside=np.column_stack([_most(s) for s in sides]),
        outliers=tuple(w.outliers for w in walls),
    )


def all_branches(a: Branches, b: Branches) -> Branches:
    """Return the walls of two sources, along the line."""
    both = Branches(
        np.concatenate([a.at, b.at]),
        np.concatenate([a.faces, b.faces]),
        np.concatenate([a.sigma, b.sigma]),
        np.concatenate([a.scans, b.scans]),
        np.concatenate([a.presence, b.presence]),
        np.concatenate([a.beside, b.beside]),
        (*a.outliers, *b.outliers),
    )
    return both.take(np.argsort(both.at, kind="stable"))


def without_slivers(branches: Branches, params: BranchParams) -> Branches:
    """Return the branches no two of which are nearer than a sliver, the more probable ones."""
    strong = np.lexsort((branches.at, -branches.scans, -np.round(branches.presence, 12)))
    kept: list[int] = []
    for i in strong:
        near = any(abs(branches.at[i] - branches.at[k]) < params.sliver_m for k in kept)
        if not near and branches.presence[i] >= params.presence_min:
            kept.append(int(i))
    return branches.take(np.array(sorted(kept), np.int64))


def _most(rooms: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the value each row holds most often, the least of several."""
    found = [np.unique(row, return_counts=True) for row in rooms]
    return np.array([values[counts.argmax()] for values, counts in found], np.int64)
