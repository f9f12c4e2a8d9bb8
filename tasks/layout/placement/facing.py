"""Edges that run back to back: the two faces of one wall."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from tasks.layout.placement.outline import Edges

OPPOSITE_COS = np.cos(np.radians(8))
"""Faces of one wall look away from each other but for this."""
SHORTEST_M = 0.3
"""Faces that run beside each other for less are corners, metres."""


@dataclass(frozen=True, eq=False)
class Facing:
    """p pairs of edges of two outlines that look at each other through a wall, each pair once."""

    a: NDArray[np.int64]
    b: NDArray[np.int64]
    """(p,), edges, a < b"""
    gap_m: NDArray[np.float64]
    """(p,), from a's face to b's, negative where they overlap"""
    common_m: NDArray[np.float64]
    """(p, 2), from and to along a, from its start, where they run beside each other"""

    def __len__(self) -> int:
        return len(self.a)


def facing_edges(edges: Edges, thickest_m: float) -> Facing:
    """Return the pairs of different outlines' edges no further apart than a wall is thick."""
    if not len(edges):
        none = np.zeros(0, np.int64)
        return Facing(none, none, np.zeros(0), np.zeros((0, 2)))
    lines = shapely.linestrings(edges.ends)
    a, b = shapely.STRtree(lines).query(lines, "dwithin", thickest_m)
    opposite = np.einsum("px,px->p", edges.outward[a], edges.outward[b]) < -OPPOSITE_COS
    kept = (a < b) & (edges.shape[a] != edges.shape[b]) & opposite
    order = np.lexsort((b[kept], a[kept]))
    a, b = a[kept][order], b[kept][order]
    normal = edges.outward[a]
    along = np.column_stack([-normal[:, 1], normal[:, 0]])
    off = edges.ends[b] - edges.ends[a, :1]
    gap = np.einsum("pex,px->pe", off, normal).mean(axis=1)
    x = np.sort(np.einsum("pex,px->pe", off, along), axis=1)
    common = np.column_stack([np.maximum(x[:, 0], 0), np.minimum(x[:, 1], edges.length_m[a])])
    near = (np.diff(common, axis=1)[:, 0] >= SHORTEST_M) & (np.abs(gap) <= thickest_m)
    return Facing(a[near], b[near], gap[near], common[near])
