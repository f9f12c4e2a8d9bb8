"""Which cells are indoors, and which of them are one room."""

import heapq

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

CAPACITY = 1000.0
"""Whole units of flow per unit of cost: the solver counts in integers."""


def indoors(
    outside_cost: NDArray[np.float64],
    inside_cost: NDArray[np.float64],
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    cut_cost: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Choose the cells that are indoors at least cost, exactly (a minimum cut).

    Parameters
    ----------
    outside_cost, inside_cost : (n,) float
        Cost of a cell being outdoors, and of its being indoors.
    left, right : (m,) int
        The cells an edge lies between; -1 stands for the outdoors around everything.
    cut_cost : (m,) float
        Cost of the edge being a limit between indoors and outdoors.

    Returns
    -------
    (n,) bool
    """
    n = len(outside_cost)
    source, sink = n, n + 1  # the source's side is indoors
    inner = right >= 0
    border = np.bincount(left[~inner], cut_cost[~inner], minlength=n)
    cell = np.arange(n)
    tails = np.concatenate((np.full(n, source), cell, left[inner], right[inner]))
    heads = np.concatenate((cell, np.full(n, sink), right[inner], left[inner]))
    costs = np.concatenate((outside_cost, inside_cost + border, cut_cost[inner], cut_cost[inner]))
    units = np.rint(costs * CAPACITY).astype(np.int32)
    graph = coo_array((units, (tails, heads)), shape=(n + 2, n + 2)).tocsr()
    flow = maximum_flow(graph, source, sink).flow
    rest = graph - flow
    rest.data = np.maximum(rest.data, 0)
    rest.eliminate_zeros()
    reached = breadth_first_order(rest, source, return_predecessors=False)
    inside = np.zeros(n + 2, bool)
    inside[reached] = True
    return inside[:n]


def join_open(
    members: NDArray[np.bool_],
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    length: NDArray[np.float64],
    open_length: NDArray[np.float64],
    open_share: float,
) -> NDArray[np.int64]:
    """Join cells into rooms over the borders no wall stands on, the most open borders first.

    Two regions are joined while the open share of their whole common border exceeds
    `open_share`: a doorway does not join two rooms, and a gap in a wall's scan does not either.

    Parameters
    ----------
    members : (n,) bool
        Cells that take part.
    left, right : (m,) int
        The cells a border lies between, -1 for none.
    length, open_length : (m,) float
        Length of each border, and how much of it has no wall, metres.

    Returns
    -------
    (n,) int
        Room of each cell, numbered by its first cell; -1 for cells that take no part.
    """
    borders = _borders(members, left, right, length, open_length)
    parent = np.where(members, np.arange(len(members)), -1)
    heap = [(-b[1] / b[0], i, j) for i, near in borders.items() for j, b in near.items() if i < j]
    heapq.heapify(heap)
    while heap:
        share, i, j = heapq.heappop(heap)
        if -share <= open_share:
            break
        current = borders.get(i, {}).get(j)
        if current is None or -current[1] / current[0] != share:
            continue  # one of the two has been joined to another since
        _join(borders, heap, i, j)
        parent[j] = i
    return _roots(parent)


Border = tuple[float, float]
Borders = dict[int, dict[int, Border]]


def _borders(
    members: NDArray[np.bool_],
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    length: NDArray[np.float64],
    open_length: NDArray[np.float64],
) -> Borders:
    borders: Borders = {int(i): {} for i in np.flatnonzero(members)}
    inner = (right >= 0) & members[left] & members[right] & (left != right)
    for e in np.flatnonzero(inner):
        i, j = int(left[e]), int(right[e])
        whole, open_ = borders[i].get(j, (0.0, 0.0))
        borders[i][j] = borders[j][i] = (whole + float(length[e]), open_ + float(open_length[e]))
    return borders


def _join(borders: Borders, heap: list[tuple[float, int, int]], i: int, j: int) -> None:
    """Give region j's borders to region i."""
    for k, (whole, open_) in borders.pop(j).items():
        del borders[k][j]
        if k == i:
            continue
        a, b = borders[i].get(k, (0.0, 0.0))
        joint = (a + whole, b + open_)
        borders[i][k] = borders[k][i] = joint
        heapq.heappush(heap, (-joint[1] / joint[0], min(i, k), max(i, k)))


def _roots(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    roots = parent.copy()
    while True:
        valid = roots >= 0
        following = roots.copy()
        following[valid] = parent[roots[valid]]
        if (following == roots).all():
            return roots
        roots = following
