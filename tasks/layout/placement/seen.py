"""How much of each outline edge was seen as a wall."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from storage.walls import Walls
from tasks.layout.placement.outline import Edges

PARALLEL_COS = np.cos(np.radians(5))
LEAST_SEEN = 0.01
"""An edge nobody saw still counts as if so much of it had been seen: it lies somewhere near."""
BESIDE_M = 0.05
"""A wall's face is the edge it lies this near to, metres."""
ONE_FACED_M = 0.0
"""A wall of which one face was seen is drawn as that face."""


def seen_share(
    edges: Edges, sources: Sequence[tuple[int, ...]], walls: Walls
) -> NDArray[np.float64]:
    """Return the share of each edge along which a wall was seen, (e,), 0 where none was.

    Parameters
    ----------
    sources : of each outline the initial rooms it is made of; `walls` name those
    """
    share = np.zeros(len(edges))
    if not len(walls) or not len(edges):
        return share
    half = np.nan_to_num(walls.thickness_m, nan=ONE_FACED_M) / 2
    for e in range(len(edges)):
        start, normal = edges.ends[e, 0], edges.outward[e]
        along = np.array([-normal[1], normal[0]])
        of_room = np.isin(walls.rooms, sources[edges.shape[e]]).any(axis=1)
        off = walls.lines - start
        away = (off @ normal).mean(axis=1) - half
        x = np.sort(off @ along, axis=1)
        length = max(float(edges.length_m[e]), 1e-9)
        common = np.clip(np.minimum(x[:, 1], length) - np.maximum(x[:, 0], 0), 0, None)
        parallel = np.diff(x, axis=1)[:, 0] >= PARALLEL_COS * np.linalg.norm(
            walls.lines[:, 1] - walls.lines[:, 0], axis=1
        )
        on = of_room & parallel & (np.abs(away) <= BESIDE_M)
        share[e] = min(1.0, float((common * walls.seen)[on].sum()) / length)
    return share


def face_sigma(seen: NDArray[np.float64], whole_m: float) -> NDArray[np.float64]:
    """Return the standard deviation of faces seen in part, by that of one seen as a whole."""
    return whole_m / np.sqrt(np.clip(seen, LEAST_SEEN, 1.0))
