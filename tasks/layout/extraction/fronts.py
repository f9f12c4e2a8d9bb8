"""The faces that rooms turn to a line, and which line each room stands on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.layout.extraction.fusion import weighted_median
from tasks.layout.extraction.model import LineFrame, Model

WALL_MAX_M = 0.6
"""Thickest wall between a corridor and its rooms, metres. Assumption."""
ACROSS_M = 0.15
"""How far before the line a room's face may lie, metres: corridor and room are registered apart."""
LEVEL = 0.2
"""Greatest rise of a room's face along the line: as eps_norm (Fig. 13)."""
CONTACT_M = 0.6
"""A room stands on a line if it shows the corridor as much wall as a door needs, metres."""
CLEARLY = 0.8
"""A room shows another line a clearly longer wall if this one's is less than this share of it."""
NOOK = 0.4
"""A line with less wall of rooms than this share of another's is a nook of the corridor or a cut
corner: rooms stand on the other. Assumption."""


@dataclass(frozen=True, eq=False)
class Fronts:
    """The faces rooms turn to a line; entry i is one room."""

    rooms: NDArray[np.int64]
    spans: NDArray[np.float64]
    """(f, 2), from where to where along the line"""
    lengths: NDArray[np.float64]
    """(f,), metres of face"""
    contacts: NDArray[np.float64]
    """(f,), metres of it between the line's ends"""
    off: NDArray[np.float64]
    """(f,), to the left of the line, metres"""


def fronts_on(frame: LineFrame, corridors: NDArray[np.int64], model: Model) -> Fronts:
    """Return the faces that rooms, corridors aside, turn to a line."""
    local = frame.local(model.edges)
    step = local[:, 1] - local[:, 0]
    level = (step[:, 0] > 0) & (np.abs(step[:, 1]) <= LEVEL * step[:, 0])
    off = local[..., 1].mean(axis=1)
    level &= (off >= -ACROSS_M) & (off <= WALL_MAX_M) & ~np.isin(model.owners, corridors)
    e = np.flatnonzero(level)
    inside = np.minimum(local[e, 1, 0], frame.length) - np.maximum(local[e, 0, 0], 0.0)
    rooms = np.unique(model.owners[e])
    of = [model.owners[e] == r for r in rooms]
    return Fronts(
        rooms=rooms,
        spans=np.array([(local[e[m], 0, 0].min(), local[e[m], 1, 0].max()) for m in of]).reshape(
            -1, 2
        ),
        lengths=np.array([step[e[m], 0].sum() for m in of], float),
        contacts=np.array([np.maximum(inside[m], 0).sum() for m in of], float),
        off=np.array([weighted_median(off[e[m]], step[e[m], 0]) for m in of], float),
    )


def share_out(fronts: list[Fronts]) -> list[NDArray[np.int64]]:
    """Return for each line which of its fronts are those of rooms that stand on it.

    The line with most wall of rooms not yet taken is next, and takes those that do not show a
    clearly longer wall to another line left, unless that is a mere nook beside it.
    """
    left = {i: set(np.flatnonzero(f.contacts >= CONTACT_M).tolist()) for i, f in enumerate(fronts)}
    taken: set[int] = set()
    found = [np.empty(0, np.int64) for _ in fronts]
    while left:
        sums = {i: _sum(fronts[i], members, taken) for i, members in left.items()}
        best = max(left, key=lambda i: (round(sums[i], 3), -i))
        rivals = [i for i in left if sums[i] >= NOOK * sums[best]]
        longest: dict[int, float] = {}
        for i in rivals:
            for k in left[i]:
                room = int(fronts[i].rooms[k])
                longest[room] = max(longest.get(room, 0.0), float(fronts[i].lengths[k]))
        own = fronts[best]
        mine = [
            k
            for k in sorted(left.pop(best))
            if (room := int(own.rooms[k])) not in taken
            and own.lengths[k] >= CLEARLY * longest[room]
        ]
        taken |= {int(own.rooms[k]) for k in mine}
        found[best] = np.array(mine, np.int64)
    return found


def _sum(fronts: Fronts, members: set[int], taken: set[int]) -> float:
    return float(sum(fronts.lengths[k] for k in members if int(fronts.rooms[k]) not in taken))
