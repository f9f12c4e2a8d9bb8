"""Connected patches of planes: fitting, clustering, merging, and the labels of all points."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

EIGHT = np.ones((3, 3), bool)
"""Neighbourhood in which two cells of a footprint touch."""
COPLANAR_COS = np.cos(np.radians(8))
"""Patches tilted more than this are never one plane: the tilt error of a 0.3 m patch under
2 cm of noise."""


@dataclass(frozen=True, eq=False)
class Footprint:
    """Which cells of its own plane a patch covers."""

    u: NDArray[np.float64]
    v: NDArray[np.float64]
    low: NDArray[np.float64]
    """(2,), metres, corner of cell (0, 0)"""
    cells: NDArray[np.bool_]


def fit_plane(xyz: NDArray[np.float32]) -> tuple[NDArray[np.float64], float]:
    """Return the unit normal and offset of the least-squares plane through (n, 3) points."""
    centre = xyz.mean(axis=0, dtype=np.float64)
    local = xyz - centre
    normal = np.linalg.eigh(local.T @ local)[1][:, 0]
    return normal, float(normal @ centre)


def breadth(xyz: NDArray[np.float32]) -> float:
    """Return how broad a patch is across its longest direction, metres, as if evenly filled."""
    local = xyz - xyz.mean(axis=0, dtype=np.float64)
    across = np.linalg.eigvalsh(local.T @ local)[1] / len(xyz)
    return float(np.sqrt(12 * max(across, 0.0)))


def plane_axes(normal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two unit vectors spanning the plane with this unit normal; the first is level."""
    level = np.cross([0.0, 0.0, 1.0], normal)
    if np.linalg.norm(level) < 0.1:  # a floor: any level direction will do
        level = np.cross(normal, [1.0, 0.0, 0.0])
    u = level / np.linalg.norm(level)
    return u, np.cross(normal, u)


def footprint(xyz: NDArray[np.float32], normal: NDArray[np.float64], cell: float) -> Footprint:
    """Return the cells of the plane that hold a point, with a margin of three empty cells."""
    u, v = plane_axes(normal)
    ab = np.stack((xyz @ u, xyz @ v), axis=1)
    low = ab.min(axis=0) - 3 * cell
    at = ((ab - low) / cell).astype(np.int64)
    cells = np.zeros(at.max(axis=0) + 4, bool)
    cells[at[:, 0], at[:, 1]] = True
    return Footprint(u, v, low, cells)


def largest_cluster(
    xyz: NDArray[np.float32], normal: NDArray[np.float64], cell: float
) -> tuple[NDArray[np.bool_], float]:
    """Return which points lie in the largest connected part of a footprint, and its area in m2."""
    at = _cells_of(xyz, normal, cell)
    grid = np.zeros(at.max(axis=0) + 1, bool)
    grid[at[:, 0], at[:, 1]] = True
    labels, count = ndimage.label(grid, EIGHT)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    best = int(sizes.argmax())
    return labels[at[:, 0], at[:, 1]] == best, float(sizes[best]) * cell**2


def _cells_of(
    xyz: NDArray[np.float32], normal: NDArray[np.float64], cell: float
) -> NDArray[np.int64]:
    u, v = plane_axes(normal)
    ab = np.stack((xyz @ u.astype(np.float32), xyz @ v.astype(np.float32)), axis=1)
    return ((ab - ab.min(axis=0)) / np.float32(cell)).astype(np.int64)


def merge_coplanar(
    xyz: NDArray[np.float32], labels: NDArray[np.int32], tolerance: float, cell: float
) -> NDArray[np.int32]:
    """Join touching patches of one plane, which the tiles' borders have cut.

    Parameters
    ----------
    xyz : (n, 3) float
        Points, metres.
    labels : (n,) int
        Patch of each point, -1 for none.
    tolerance : float
        Greatest distance of a point from its plane, metres.
    cell : float
        Patches closer than this, along their plane, touch.

    Returns
    -------
    (n,) int
        Labels renumbered from 0, most points first.
    """
    patch = members(labels)
    m = len(patch)
    if m == 0:
        return labels
    fits = [fit_plane(xyz[i]) for i in patch]
    normals = np.array([f[0] for f in fits])
    offsets = np.array([f[1] for f in fits])
    lows = np.array([xyz[i].min(axis=0) for i in patch]) - cell
    highs = np.array([xyz[i].max(axis=0) for i in patch]) + cell
    near = (lows[:, None] <= highs[None]).all(axis=2)
    candidates = near & near.T & (np.abs(normals @ normals.T) > COPLANAR_COS)
    first, second = np.nonzero(np.triu(candidates, 1))
    joined = [
        (i, j)
        for i, j in zip(first.tolist(), second.tolist(), strict=True)
        if _one_plane(xyz, patch[i], patch[j], normals, offsets, i, j, tolerance)
        and _touch(xyz, patch[i], patch[j], normals[i], cell)
    ]
    return _relabel(labels, _groups(m, joined))


def _one_plane(
    xyz: NDArray[np.float32],
    a: NDArray[np.int64],
    b: NDArray[np.int64],
    normals: NDArray[np.float64],
    offsets: NDArray[np.float64],
    i: int,
    j: int,
    tolerance: float,
) -> bool:
    """Whether the smaller patch lies within tolerance of the larger one's plane."""
    plane, patch = (i, b) if len(a) >= len(b) else (j, a)
    away = np.abs(xyz[patch] @ normals[plane] - offsets[plane])
    return bool(np.percentile(away, 80) < tolerance)


def _touch(
    xyz: NDArray[np.float32],
    a: NDArray[np.int64],
    b: NDArray[np.int64],
    normal: NDArray[np.float64],
    cell: float,
) -> bool:
    at = _cells_of(xyz[np.concatenate((a, b))], normal, cell)
    grid = np.zeros(at.max(axis=0) + 1, bool)
    grid[at[: len(a), 0], at[: len(a), 1]] = True
    grid = ndimage.binary_dilation(grid, EIGHT)
    return bool(grid[at[len(a) :, 0], at[len(a) :, 1]].any())


def members(labels: NDArray[np.int32]) -> list[NDArray[np.int64]]:
    """Return the indices of the points of each label from 0 on."""
    order = np.argsort(labels, kind="stable")
    starts = np.searchsorted(labels[order], np.arange(labels.max(initial=-1) + 2))
    return [order[a:b] for a, b in pairwise(starts)]


def _groups(m: int, joined: list[tuple[int, int]]) -> NDArray[np.int64]:
    pairs = np.array(joined, int).reshape(-1, 2)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(m, m))
    return connected_components(graph, directed=False)[1]


def _relabel(labels: NDArray[np.int32], groups: NDArray[np.int64]) -> NDArray[np.int32]:
    grouped = np.where(labels >= 0, groups[labels], -1)
    sizes = np.bincount(grouped[grouped >= 0], minlength=groups.max() + 1)
    rank = np.empty(len(sizes), np.int32)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
    return np.where(grouped >= 0, rank[grouped], -1).astype(np.int32)
