"""The faces of decoded walls, and where each scan saw them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.layout.extraction.model import Strips
from tasks.layout.extraction.pieces import pieces_across
from tasks.layout.placement.decoded_rows import DecodedRow

ANGLE_RAD, SHORTEST_M = 0.2, 0.5
"""A strip is across a line as a branch is: turned by no more, and as long."""
NEAR_M, REACH_M = 0.25, 0.6
"""How far from where a face was observed a scan's strip is looked for, metres: first near it, then
as far as the face of a scan may lie that drifts. Assumption."""
BESIDE = 0.5
"""Share of a strip that must lie within the depth of the row's rooms,"""
COVERED = 0.4
"""and share of that depth it must cover: what is seen from the corridor, through a door, is less
and may be anything. Assumption."""


@dataclass(frozen=True, eq=False)
class Faces:
    """f faces of decoded walls; entry i is one of them in every array."""

    rows: NDArray[np.int64]
    """(f,), row each is of"""
    walls: NDArray[np.int64]
    """(f,), boundary of that row"""
    sides: NDArray[np.int64]
    """(f,), 0 lower, 1 upper face"""
    at_m: NDArray[np.float64]
    """(f,), where along the line it was observed, or is expected"""
    opposite: NDArray[np.int64]
    """(f,), the other face of the same wall, -1 none"""

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True, eq=False)
class Seen:
    """n faces as scans saw them, each scan each face once; entry i is one in every array."""

    faces: NDArray[np.int64]
    scans: NDArray[np.int64]
    at_m: NDArray[np.float64]
    """(n,), along the face's line"""

    def __len__(self) -> int:
        return len(self.faces)

    def take(self, keep: NDArray[np.int64]) -> "Seen":
        """Return some of them."""
        return Seen(self.faces[keep], self.scans[keep], self.at_m[keep])


def faces_of(rows: Sequence[DecodedRow], partition_m: float) -> Faces:
    """Return the faces of all decoded walls that were observed.

    Parameters
    ----------
    partition_m : float
        Thickness of a wall between rooms: where a face is expected of which only the opposite one
        was observed.
    """
    found: list[tuple[int, int, int, float]] = []
    for r, row in enumerate(rows):
        for k in np.flatnonzero((row.cuts >= 0) | row.walled_ends):
            at = row.chain.observed_m[k] + np.array([-0.5, 0.5]) * partition_m
            at = np.where(np.isnan(row.faces_m[k]), at, row.faces_m[k])
            found += [(r, int(k), side, float(at[side])) for side in (0, 1)]
    table = np.array(found, float).reshape(-1, 4)
    of_row, walls, sides = table[:, :3].astype(np.int64).T
    number = np.arange(len(found))
    opposite = number + 1 - 2 * (number % 2)
    return Faces(of_row, walls, sides, table[:, 3], opposite)


def seen_by_scans(rows: Sequence[DecodedRow], faces: Faces, strips: Strips) -> Seen:
    """Return where each scan saw each face: its largest strip near it that faces the same way."""
    found, at = [np.empty((0, 2), np.int64)], [np.empty(0)]
    for r, row in enumerate(rows):
        frame = row.frame
        reach = -REACH_M, frame.length + REACH_M
        across = pieces_across(strips.lines, frame, reach, ANGLE_RAD, SHORTEST_M)
        common = np.minimum(across.far, row.depth_m) - np.maximum(across.near, 0.0)
        beside = across.across & (common >= BESIDE * (across.far - across.near))
        if np.isfinite(row.depth_m):
            beside &= common >= COVERED * row.depth_m
        facing = np.sign(strips.normals @ frame.along)
        of_row = np.flatnonzero(faces.rows == r)
        for face in of_row:
            same = of_row[faces.sides[of_row] == faces.sides[face]]
            away = np.abs(across.at[None] - faces.at_m[same, None])
            own = away[same == face][0]
            fits = beside & (facing == 2 * faces.sides[face] - 1) & (own <= REACH_M)
            fits &= own <= away.min(axis=0)
            # of one scan the largest strip near the face; where it has none there, the largest
            order = np.lexsort((-strips.areas, own > NEAR_M, strips.scans))
            order = order[fits[order]]
            scans, first = np.unique(strips.scans[order], return_index=True)
            found.append(np.column_stack([np.full(len(scans), face), scans]))
            at.append(across.at[order[first]])
    which, scans_ = np.concatenate(found).T
    return Seen(which, scans_, np.concatenate(at))
