"""Pairs of found and true objects, and the best way to make them one-to-one.

Only pairs that may match are ever listed, so that a storey of many rooms costs no more than its
neighbourhoods: an assignment is solved within each group of objects that candidate pairs connect.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from shapely import Polygon, STRtree


@dataclass(frozen=True, eq=False)
class Pairs:
    """k pairs of a found and a true object; entry i is one pair in every array."""

    found: NDArray[np.int64]
    """(k,), index of the found object"""
    true: NDArray[np.int64]
    """(k,), index of the true object"""
    values: NDArray[np.float64]
    """(k,), what is compared: intersection over union, or metres"""

    def __len__(self) -> int:
        return len(self.values)

    def at(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> "Pairs":
        """Return some of the pairs."""
        return Pairs(self.found[which], self.true[which], self.values[which])


def overlapping(found: Sequence[Polygon], true: Sequence[Polygon]) -> Pairs:
    """Return the pairs of polygons that share area, with their intersection over union."""
    a, b = np.array(found, object), np.array(true, object)
    j, i = STRtree(a).query(b)
    both = shapely.area(shapely.intersection(a[i], b[j]))
    either = shapely.area(a[i]) + shapely.area(b[j]) - both
    pairs = Pairs(i, j, both / np.maximum(either, 1e-12))
    return pairs.at(both > 0)


def within(found: NDArray[np.float64], true: NDArray[np.float64], limit_m: float) -> Pairs:
    """Return the pairs of points, (f, 2) and (t, 2), at most a true Euclidean distance apart."""
    if not len(found) or not len(true):
        return Pairs(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))
    near = KDTree(true).query_ball_point(found, limit_m * (1 + 1e-9), return_sorted=True)
    i = np.repeat(np.arange(len(found)), [len(some) for some in near])
    j = np.concatenate([np.asarray(some, np.int64) for some in near])
    pairs = Pairs(i, j, np.linalg.norm(found[i] - true[j], axis=1))
    return pairs.at(pairs.values <= limit_m)


def most_overlapping(pairs: Pairs, threshold: float) -> Pairs:
    """Return the one-to-one pairs of the greatest sum, of those whose value exceeds `threshold`."""
    over = pairs.at(pairs.values > threshold)
    return over.at(assign(over, over.values))


def nearest(pairs: Pairs, limit_m: float) -> Pairs:
    """Return the one-to-one pairs, as many as there can be, and of those the least in sum.

    Only pairs at most `limit_m` metres apart count: a far object never takes a near one's place.
    """
    near = pairs.at(pairs.values <= limit_m)
    # one pair more outweighs whatever distance it adds to all others
    return near.at(assign(near, (len(near) + 1) * limit_m - near.values))


def assign(pairs: Pairs, gains: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return which pairs to keep, one-to-one, at the greatest total gain (Hungarian).

    Parameters
    ----------
    gains : (k,) float
        Greater than zero.

    Returns
    -------
    (m,) int
        Indices of pairs in the order of the true objects.
    """
    kept: list[NDArray[np.int64]] = []
    for some in _groups(pairs):
        rows, i = np.unique(pairs.found[some], return_inverse=True)
        columns, j = np.unique(pairs.true[some], return_inverse=True)
        shape = (len(rows), len(columns))
        gain, pair = np.zeros(shape), np.full(shape, -1)
        gain[i, j], pair[i, j] = gains[some], some
        chosen = pair[linear_sum_assignment(gain, maximize=True)]
        kept.append(chosen[chosen >= 0])
    if not kept:
        return np.empty(0, np.int64)
    all_kept = np.concatenate(kept)
    return all_kept[np.argsort(pairs.true[all_kept])]


def _groups(pairs: Pairs) -> list[NDArray[np.int64]]:
    """Return the pairs of each connected group of objects: no pair joins two groups."""
    if not len(pairs):
        return []
    n_found, n_true = pairs.found.max() + 1, pairs.true.max() + 1
    edges = (np.ones(len(pairs)), (pairs.found, n_found + pairs.true))
    graph = coo_array(edges, shape=(n_found + n_true, n_found + n_true))
    _, labels = connected_components(graph, directed=False)
    group = labels[pairs.found]
    order = np.argsort(group, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(group[order])) + 1)
