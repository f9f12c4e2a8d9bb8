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
from pydantic import Field, NonNegativeFloat, PositiveFloat

from tasks.layout.extraction.model import LineFrame, Model
from tasks.layout.extraction.presence import PresenceParams, presence
from tasks.layout.extraction.sheets import Sheet, SheetParams


class BranchParams(SheetParams):
    """How faces across a line become walls across it."""

    tau_m: PositiveFloat = 0.5
    """Two faces nearer than this are of one wall, metres: tau of Fig. 8, whose value is not
    published. Assumption: the thickest wall within a storey."""
    crossed_m: NonNegativeFloat = 0.06
    """By how much the two faces of a thin wall may be registered across each other, metres.
    Assumption."""
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
FAINT_M = 0.05
"""A face that hardly shows has to fit a partition's thickness better than another by this much,
metres, to be the wall's. Assumption."""
GRAIN = 0.1
"""Step in which the depth covered by wall is added up, metres."""


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
    pairs, single = _pair(sheets, partition[0], params)
    walls = [_wall(m, sheets, partition) for m in (*pairs, *((i,) for i in single))]
    walls.sort(key=lambda w: w.at)
    at = np.array([w.at for w in walls])
    half = np.array([w.half for w in walls])
    depth = np.array([_depth(w, depth_m) for w in walls])
    left = front_m + DEPTHS[None] * (depth - front_m)[:, None]
    sides = [
        model.room_at(frame.building(np.stack([x[:, None] + 0 * left, left], axis=-1)))
        for x in (at - half - BEYOND, at + half + BEYOND)
    ]
    divides = (sides[0] != sides[1]).mean(axis=1) if len(walls) else np.empty(0)
    covered = np.array([_covered(w, front_m, d) for w, d in zip(walls, depth, strict=True)])
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


@dataclass(frozen=True, eq=False)
class _Wall:
    at: float
    faces: tuple[float, float]
    half: float
    """half its thickness"""
    single: int
    """where it lies seen from the only face known: 1 further along the line, -1 before, 0 both are
    known, or none is"""
    sigma: float
    sheets: tuple[Sheet, ...]

    @property
    def seen(self) -> list[Sheet]:
        return [s for s in self.sheets if s.seen]

    @property
    def n_scans(self) -> int:
        named = frozenset[int]().union(*(s.scans for s in self.sheets))
        return max(len(named), *(s.n_scans for s in self.sheets))

    @property
    def height(self) -> float:
        return max(s.height for s in self.sheets)

    @property
    def outliers(self) -> tuple[int, ...]:
        return tuple(sorted({o for s in self.sheets for o in s.outliers}))


def _pair(
    sheets: Sequence[Sheet], partition: float, params: BranchParams
) -> tuple[list[tuple[int, int]], list[int]]:
    """Return which sheets are two faces of one wall, and which stand alone.

    The pair whose distance is most like a partition's comes first. A face of unknown side may be
    either; one that lies within a wall, or on one of its faces, is that wall's. One that
    hardly shows comes after those that do, unless it fits clearly better.
    """
    at = np.array([s.at for s in sheets])
    facing = np.array([s.facing for s in sheets], int)
    gaps = at[None] - at[:, None]
    fits = (gaps <= params.tau_m) & (gaps >= -params.crossed_m)
    # of the pair (i, j) i is the lower face: seen from below
    fits &= (facing[:, None] <= 0) & (facing[None] >= 0) & ~np.eye(len(sheets), dtype=bool)
    fits &= (facing[:, None] != 0) | (facing[None] != 0)
    i, j = np.nonzero(fits)
    unknown = (facing[i] == 0) | (facing[j] == 0)
    faint = np.array([s.faint for s in sheets], float)
    off = np.abs(gaps[i, j] - partition) + FAINT_M * (faint[i] + faint[j])
    order = np.lexsort((j, i, off, unknown))
    free = np.ones(len(sheets), bool)
    pairs = []
    for k in order:
        if free[i[k]] and free[j[k]]:
            pairs.append((int(i[k]), int(j[k])))
            free[[i[k], j[k]]] = False
            within = (facing == 0) & (at >= at[i[k]] - params.same_m)
            free &= ~(within & (at <= at[j[k]] + params.same_m))
    return pairs, np.flatnonzero(free).tolist()


def _wall(
    members: tuple[int, ...], sheets: Sequence[Sheet], partition: tuple[float, float]
) -> _Wall:
    mine = tuple(sheets[i] for i in members)
    # an outline's edge that nobody saw tells less of the other face than how thick walls are
    tell = tuple(i for i, sheet in enumerate(mine) if sheet.seen) or tuple(range(len(mine)))
    if len(tell) == 2:
        low, high = mine
        faces = low.at if low.seen else np.nan, high.at if high.seen else np.nan
        half = max((high.at - low.at) / 2, 0.0)
        sigma = np.hypot(low.sigma, high.sigma) / 2
        return _Wall((low.at + high.at) / 2, faces, half, 0, float(sigma), mine)
    one = mine[tell[0]]
    # of a pair the first is the lower face
    facing = one.facing if len(mine) == 1 else 2 * tell[0] - 1
    half = partition[0] / 2
    at = one.at - facing * half
    spread = partition[1] / 2 if facing else half
    at_face = one.at if one.seen else np.nan
    faces = (at_face if facing < 0 else np.nan, at_face if facing > 0 else np.nan)
    return _Wall(at, faces, half, -facing, float(np.hypot(one.sigma, spread)), mine)


def _depth(wall: _Wall, usual: float) -> float:
    """Return how deep the rooms beside a wall are: to the end of their edges on it."""
    edges = [s.far for s in wall.sheets if s.bounds]
    return max(edges) if edges else usual


def _covered(wall: _Wall, front: float, depth: float) -> float:
    """Return the share of the depth between front and rear along which wall was seen."""
    steps = max(1, round((depth - front) / GRAIN))
    at = front + (np.arange(steps) + 0.5) / steps * (depth - front)
    seen = np.zeros(steps, bool)
    for sheet in wall.sheets:
        for low, high in sheet.stretches:
            seen |= (at >= low - GRAIN / 2) & (at <= high + GRAIN / 2)
    return float(seen.mean())


def _most(rooms: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the value each row holds most often, the least of several."""
    found = [np.unique(row, return_counts=True) for row in rooms]
    return np.array([values[counts.argmax()] for values, counts in found], np.int64)
