"""Which faces across a reference line are of one wall, and where that wall stands."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from tasks.layout.extraction.sheets import Sheet, SheetParams


class PairParams(SheetParams):
    """Which faces across a line are of one wall."""

    tau_m: PositiveFloat = 0.5
    """Two faces nearer than this are of one wall, metres: tau of Fig. 8, whose value is not
    published. Assumption: the thickest wall within a storey."""
    crossed_m: NonNegativeFloat = 0.06
    """By how much the two faces of a thin wall may be registered across each other, metres.
    Assumption."""


FAINT_M = 0.05
"""A face that hardly shows has to fit a partition's thickness better than another by this much,
metres, to be the wall's. Assumption."""
GRAIN = 0.1
"""Step in which the depth covered by wall is added up, metres."""


@dataclass(frozen=True, eq=False)
class Wall:
    """A wall across a line, by the faces that are its."""

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
        """The faces that were found, not an outline's edge alone."""
        return [s for s in self.sheets if s.seen]

    @property
    def n_scans(self) -> int:
        """Scans that saw it."""
        named = frozenset[int]().union(*(s.scans for s in self.sheets))
        return max(len(named), *(s.n_scans for s in self.sheets))

    @property
    def height(self) -> float:
        """Metres it was seen over."""
        return max(s.height for s in self.sheets)

    @property
    def outliers(self) -> tuple[int, ...]:
        """Scans that lie off what the others agree on."""
        return tuple(sorted({o for s in self.sheets for o in s.outliers}))


def pair_faces(
    sheets: Sequence[Sheet], partition: float, params: PairParams
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


def wall_of(
    members: tuple[int, ...], sheets: Sequence[Sheet], partition: tuple[float, float]
) -> Wall:
    """Return the wall that some faces are of."""
    mine = tuple(sheets[i] for i in members)
    # an outline's edge that nobody saw tells less of the other face than how thick walls are
    tell = tuple(i for i, sheet in enumerate(mine) if sheet.seen) or tuple(range(len(mine)))
    if len(tell) == 2:
        low, high = mine
        faces = low.at if low.seen else np.nan, high.at if high.seen else np.nan
        half = max((high.at - low.at) / 2, 0.0)
        sigma = np.hypot(low.sigma, high.sigma) / 2
        return Wall((low.at + high.at) / 2, faces, half, 0, float(sigma), mine)
    one = mine[tell[0]]
    # of a pair the first is the lower face
    facing = one.facing if len(mine) == 1 else 2 * tell[0] - 1
    half = partition[0] / 2
    at = one.at - facing * half
    spread = partition[1] / 2 if facing else half
    at_face = one.at if one.seen else np.nan
    faces = (at_face if facing < 0 else np.nan, at_face if facing > 0 else np.nan)
    return Wall(at, faces, half, -facing, float(np.hypot(one.sigma, spread)), mine)


def depth_behind(wall: Wall, usual: float) -> float:
    """Return how deep the rooms beside a wall are: to the end of their edges on it."""
    edges = [s.far for s in wall.sheets if s.bounds]
    return max(edges) if edges else usual


def covered_share(wall: Wall, front: float, depth: float) -> float:
    """Return the share of the depth between front and rear along which wall was seen."""
    steps = max(1, round((depth - front) / GRAIN))
    at = front + (np.arange(steps) + 0.5) / steps * (depth - front)
    seen = np.zeros(steps, bool)
    for sheet in wall.sheets:
        for low, high in sheet.stretches:
            seen |= (at >= low - GRAIN / 2) & (at <= high + GRAIN / 2)
    return float(seen.mean())
