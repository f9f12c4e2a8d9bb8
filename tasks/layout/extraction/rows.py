"""Rooms in a row along a line: which stand on it, and from where to where they reach.

A room stands on one line. Where it has walls to several, as in the corner of two corridors or
between two of them, it stands on the one that most of its row does, unless it shows another a
clearly longer wall; so no room is told twice, and the depth of a corner room is never mistaken for
its width. A row reaches from the axis of its first room's outer side wall to that of its last
one's, be that before or beyond the ends of the corridor.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.layout.extraction.branches import Branches, BranchParams, join_faces
from tasks.layout.extraction.fronts import Fronts
from tasks.layout.extraction.fusion import weighted_median
from tasks.layout.extraction.model import LineFrame, Model
from tasks.layout.extraction.sheets import find_sheets

AT_END_M = 0.3
"""A wall's face is a row's end if the last room's is no further off, metres."""
CORNER_M = 1.0
"""A row without a wall at its end reaches to the corridor's corner, if that is no further off; and
so far may a last room's side wall begin from where its face ends, metres."""
STEEP, SIDE_M = 0.4, 1.0
"""A side wall of a room rises by this share of its length at least, and is as long, metres."""
UNSEEN_M = 1.5
"""A corridor that runs on past a row by more than this leads to rooms not seen, metres: less is
narrower than a room. Assumption."""
DEPTH_M = 5.0
"""Depth of a row whose rooms tell none, metres. Assumption."""
DEPTH_MAX_M = 15.0
"""Deepest rooms of a row, metres. Assumption."""


@dataclass(frozen=True, eq=False)
class Row:
    """A line that rooms stand along, with its branches."""

    frame: LineFrame
    branches: Branches
    end_sigma: NDArray[np.float64]
    """(2,), of the centres of the walls it starts and ends at; NaN: at none"""
    end_faces: NDArray[np.float64]
    """(2, 2), their lower and upper faces along the line; NaN where not seen"""
    front_m: float
    depth_m: float


def lay_row(
    frame: LineFrame,
    fronts: Fronts,
    mine: NDArray[np.int64],
    corridors: NDArray[np.int64],
    model: Model,
    partition: tuple[float, float],
    params: BranchParams,
) -> Row:
    """Return the row of some rooms on a line, its frame from the row's first axis to its last.

    A line none of whose rooms were seen keeps its ends, and so does an end that they do not reach.
    """
    if len(mine):
        span = _span(fronts, mine, frame.length)
        front = weighted_median(fronts.off[mine], fronts.lengths[mine])
        depth = _depth(frame, fronts.rooms[mine], front, model)
    else:
        span, front, depth = (0.0, frame.length), 0.0, DEPTH_M
    reach = min(span[0], 0.0) - CORNER_M, max(span[1], frame.length) + CORNER_M
    sheets = find_sheets(frame, reach, front, corridors, model, params)
    branches = join_faces(sheets, frame, front, depth, model, partition, params)
    ends: list[float] = [0.0, frame.length]
    walls = [-1, -1]
    for k, side in enumerate((-1, 1) if len(mine) else ()):
        last = fronts.rooms[mine[np.argmax(side * fronts.spans[mine, k])]]
        oblique = _oblique(frame, int(last), span[k], side, partition[0], model, params)
        if oblique is None:
            ends[k], walls[k] = _end(span[k], ends[k], side, branches, params)
        else:
            ends[k] = oblique
    if ends[1] - ends[0] < params.sliver_m:  # walls of two rows that meet in a point
        ends, walls = [span[0], span[1]], [-1, -1]
    start = frame.building(np.array([ends[0], 0.0]))
    moved = LineFrame(start, frame.along, ends[1] - ends[0])
    inside = np.flatnonzero((branches.at > ends[0]) & (branches.at < ends[1]))
    kept = branches.take(inside)
    shifted = Branches(
        kept.at - ends[0],
        kept.faces - ends[0],
        kept.sigma,
        kept.scans,
        kept.presence,
        kept.beside,
        kept.outliers,
    )
    known = [w >= 0 for w in walls]
    sigma, faces = np.full(2, np.nan), np.full((2, 2), np.nan)
    sigma[known] = branches.sigma[[w for w in walls if w >= 0]]
    faces[known] = branches.faces[[w for w in walls if w >= 0]] - ends[0]
    return Row(moved, shifted, sigma, faces, front, depth)


def _span(fronts: Fronts, mine: NDArray[np.int64], length: float) -> tuple[float, float]:
    """Return from where to where along its line a row reaches.

    Where the corridor runs on past the last room that was seen, and along no room that stands on
    another line, the row does as well: rooms that nobody mapped.
    """
    low, high = float(fronts.spans[mine, 0].min()), float(fronts.spans[mine, 1].max())
    others = np.delete(fronts.spans, mine, axis=0)
    for a, b in ((0.0, low), (high, length)):
        common = np.minimum(others[:, 1], b) - np.maximum(others[:, 0], a)
        if b - a > UNSEEN_M and np.maximum(common, 0.0).sum() < (b - a) / 2:
            low, high = min(low, a), max(high, b)
    return low, high


def _oblique(
    frame: LineFrame,
    room: int,
    last: float,
    side: int,
    partition: float,
    model: Model,
    params: BranchParams,
) -> float | None:
    """Return where the axis of a last room's side wall crosses the line if the wall is oblique.

    Between two rows where a corridor bends the wall halves the bend: its axis meets the corner of
    the corridor. None if the room's longest side there stands square on the line.
    """
    local = frame.local(model.edges[model.owners == room])
    step = local[:, 1] - local[:, 0]
    foot = np.take_along_axis(local, local[..., 1].argmin(axis=1)[:, None, None], axis=1)[:, 0]
    lengths = np.linalg.norm(step, axis=1)
    steep = np.abs(step[:, 1]) > STEEP * lengths
    sides = steep & (lengths >= SIDE_M) & (np.abs(foot[:, 0] - last) <= CORNER_M)
    sides &= foot[:, 1] <= CORNER_M
    if not sides.any():
        return None
    k = int(np.flatnonzero(sides)[np.argmax(lengths[sides])])
    slope = step[k, 0] / step[k, 1]
    if abs(slope) <= np.tan(params.angle_rad):
        return None
    return float(foot[k, 0] - foot[k, 1] * slope + side * partition / 2 * np.hypot(1, slope))


def _end(
    last: float, corner: float, side: int, branches: Branches, params: BranchParams
) -> tuple[float, int]:
    """Return where a row ends whose last room's face ends at `last`, and the branch, -1 for none.

    At the axis of the wall there; where none stands square on the line, at the corridor's corner.
    """
    # the row lies before its upper end: that wall shows it the lower face
    inner = branches.faces[:, 0 if side > 0 else 1]
    inner = np.where(np.isnan(inner), branches.at - side * params.outer_m / 2, inner)
    off = np.abs(inner - last)
    near = np.flatnonzero(off <= AT_END_M)
    if len(near):
        wall = int(near[np.argmin(off[near])])
        return float(branches.at[wall]), wall
    return (corner if abs(corner - last) <= CORNER_M else last + side * params.outer_m / 2), -1


def _depth(frame: LineFrame, rooms: NDArray[np.int64], front: float, model: Model) -> float:
    """Return where the rear walls of a row's rooms are, to the left of the line: the median."""
    rear = [frame.local(model.edges[model.owners == r])[..., 1].max() for r in rooms]
    return float(np.clip(np.median(rear), front + CORNER_M, DEPTH_MAX_M))
