"""Outline edges moved onto the walls that the grammar of this building knows."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tasks.layout.placement.facing import Facing
from tasks.layout.placement.known_walls import KnownWalls
from tasks.layout.placement.moves import Moves, WallKey
from tasks.layout.placement.outline import Edges
from tasks.layout.placement.seen import face_sigma

SAME_COS = np.cos(np.radians(8))
"""Edges turned further from a wall are not its face."""
SHORTEST_M = 0.03
"""A shorter edge is rounding, metres; one a little longer a jog of its wall."""
LONG_M = 0.5
"""An outline has a face on a wall where an edge as long as this lies on it, metres."""
BESIDE = 0.5
"""Share of an edge that must run beside a wall to be its face."""
WELL_SEEN = 0.5
"""Share of an edge along which a wall was seen from which it may contradict a known one."""


def known_moves(
    walls: KnownWalls,
    edges: Edges,
    first: Sequence[int],
    facing: Facing,
    seen: NDArray[np.float64],
    reach_m: tuple[float, float],
    sigma_m: tuple[float, float, float],
    limit: float,
) -> Moves:
    """Return how edges move, outwards, so that they lie on the nearest known wall in their reach.

    Parameters
    ----------
    first : of each outline an initial room, to name it
    seen : (e,) share of each edge along which a wall was seen
    reach_m : how far an edge may lie before its wall, where furniture hides it, and behind it
    sigma_m : standard deviations of a known wall's place, of a face seen along all its length
        against others, and of how scans drift
    limit : standard deviations from which two faces of a wall contradict its known place

    Notes
    -----
    Known place and measured one count by their precisions. Where both faces of a wall were well
    seen, and both on the same side of their known places, the wall was built there: both stay.
    """
    edge, wall, by = _matched(walls, edges, reach_m)
    known, face, drift = sigma_m
    measured = np.hypot(face_sigma(seen[edge], face), drift)
    share = measured**2 / (measured**2 + known**2)
    # what is further off is no measurement of this wall: furniture hides it
    share = np.where(np.abs(by.mean(axis=1)) > limit * measured, 1.0, share)
    stays = _contradicting(edge, by.mean(axis=1), measured, seen, facing, limit)
    kept = np.flatnonzero(~stays)
    keys = tuple(
        WallKey(walls.kind[wall[i]], int(wall[i]), int(first[edges.shape[edge[i]]])) for i in kept
    )
    sigma = known * np.sqrt(share)
    return Moves(edge[kept], (share[:, None] * by)[kept], sigma[kept], keys)


def _matched(
    walls: KnownWalls, edges: Edges, reach_m: tuple[float, float]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return edges, the wall each lies on, and how far its ends are from it outwards."""
    none = np.zeros(0, np.int64)
    if not len(walls) or not len(edges):
        return none, none, np.zeros((0, 2))
    step = walls.ends[:, 1] - walls.ends[:, 0]
    length = np.linalg.norm(step, axis=1)
    along = step / length[:, None]
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    off = edges.ends[:, None] - walls.ends[None, :, :1]  # (e, w, 2, 2)
    x, out = np.einsum("ewpx,wx->ewp", off, along), np.einsum("ewpx,wx->ewp", off, outward)
    common = np.minimum(x.max(axis=2), length) - np.maximum(x.min(axis=2), 0.0)
    cosine = edges.outward @ outward.T
    by = -out / np.maximum(cosine, SAME_COS)[..., None]
    mean = by.mean(axis=2)
    before, behind = reach_m
    fits = (cosine >= SAME_COS) & (mean <= before) & (mean >= -behind)
    fits &= (common >= BESIDE * edges.length_m[:, None]) & (edges.length_m >= SHORTEST_M)[:, None]
    away = np.where(fits, np.abs(mean), np.inf)
    edge = np.flatnonzero(fits.any(axis=1))
    wall = away[edge].argmin(axis=1)
    long = edges.length_m[edge] >= LONG_M
    own = edges.shape[edge] * len(walls) + wall
    kept = long | np.isin(own, own[long])
    return edge[kept], wall[kept], by[edge[kept], wall[kept]]


def _contradicting(
    edge: NDArray[np.int64],
    by_m: NDArray[np.float64],
    sigma_m: NDArray[np.float64],
    seen: NDArray[np.float64],
    facing: Facing,
    limit: float,
) -> NDArray[np.bool_]:
    """Return which edges say, as the other faces of their walls do, that the wall is elsewhere."""
    out, far = np.zeros(len(seen)), np.zeros(len(seen), bool)
    out[edge] = by_m
    far[edge] = (np.abs(by_m) > limit * sigma_m) & (seen[edge] >= WELL_SEEN)
    both = far[facing.a] & far[facing.b] & (out[facing.a] * out[facing.b] < 0)
    stays = np.zeros(len(seen), bool)
    stays[facing.a[both]] = stays[facing.b[both]] = True
    return stays[edge]
