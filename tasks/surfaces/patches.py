"""Connected patches of planes: fitting, clustering, merging, and the labels of all points."""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tasks.surfaces.thinning import bounds

EIGHT = np.ones((3, 3), bool)
"""Neighbourhood in which two cells of a footprint touch."""
COPLANAR_COS = np.cos(np.radians(8))
"""Patches tilted more than this are never one plane: the tilt error of a 0.3 m patch under
2 cm of noise."""
COPLANAR_SHARE = 0.8
"""Share of the smaller patch's points that lie within tolerance of the larger one's plane, if they
are one: the rest may be noise."""


class Fit(NamedTuple):
    """A least-squares plane."""

    normal: NDArray[np.float64]
    """(3,), unit length"""
    offset: float
    """metres"""
    breadth: float
    """across the points' longest direction, metres, as if they filled it evenly"""


@dataclass(frozen=True, eq=False)
class Footprint:
    """Which cells of its own plane a patch covers."""

    u: NDArray[np.float64]
    v: NDArray[np.float64]
    low: NDArray[np.float64]
    """(2,), metres, corner of cell (0, 0)"""
    cells: NDArray[np.bool_]


def fit_plane(xyz: NDArray[np.float32], members: NDArray[np.int64]) -> Fit:
    """Return the least-squares plane through some of (n, 3) points."""
    centre, scatter = _moments(xyz, members)
    values, vectors = np.linalg.eigh(scatter)
    breadth = float(np.sqrt(12 * max(values[1], 0.0)))
    return Fit(vectors[:, 0], float(vectors[:, 0] @ centre), breadth)


def near_plane(
    xyz: NDArray[np.float32], normal: NDArray[np.float64], offset: float, distance: float
) -> NDArray[np.int64]:
    """Return the indices of the points closer to a plane than a distance."""
    nx, ny, nz = normal.astype(np.float32)
    return _near_plane(xyz, nx, ny, nz, np.float32(offset), np.float32(distance))


def plane_axes(normal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two unit vectors spanning the plane with this unit normal; the first is level."""
    x, y, z = normal.tolist()
    # a floor: any level direction will do
    level = np.array((-y, x, 0.0) if np.hypot(x, y) > 0.1 else (0.0, z, -y))
    u = level / np.sqrt(level @ level)
    a, b, c = u.tolist()
    return u, np.array((y * c - z * b, z * a - x * c, x * b - y * a))


def footprint(
    xyz: NDArray[np.float32], members: NDArray[np.int64], normal: NDArray[np.float64], cell: float
) -> Footprint:
    """Return the cells of the plane that hold a member, with a margin of three empty cells."""
    u, v = plane_axes(normal)
    at, low, shape = _cells_of(xyz, members, u, v, cell)
    return Footprint(u, v, low - 3 * cell, np.pad(_filled(at, shape), 3))


def largest_cluster(
    xyz: NDArray[np.float32], members: NDArray[np.int64], normal: NDArray[np.float64], cell: float
) -> tuple[NDArray[np.int64], float]:
    """Return the members in the largest connected part of their footprint, and its area in m2."""
    at, _, shape = _cells_of(xyz, members, *plane_axes(normal), cell)
    labels, count = ndimage.label(_filled(at, shape), EIGHT)
    labels = labels.ravel()
    sizes = np.bincount(labels, minlength=count + 1)
    sizes[0] = 0
    best = int(sizes.argmax())
    return members[labels[at] == best], float(sizes[best]) * cell**2


def _filled(at: NDArray[np.int64], shape: tuple[int, int]) -> NDArray[np.bool_]:
    grid = np.zeros(shape, bool)
    grid.reshape(-1)[at] = True
    return grid


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
    fits = [fit_plane(xyz, i) for i in patch]
    normals = np.array([f.normal for f in fits])
    boxes = np.array([bounds(xyz[i]) for i in patch])
    lows, highs = boxes[:, 0] - cell, boxes[:, 1] + cell
    near = (lows[:, None] <= highs[None]).all(axis=2)
    candidates = near & near.T & (np.abs(normals @ normals.T) > COPLANAR_COS)
    first, second = np.nonzero(np.triu(candidates, 1))
    joined = [
        (i, j)
        for i, j in zip(first.tolist(), second.tolist(), strict=True)
        if _one_plane(xyz, patch[i], patch[j], fits[i], fits[j], tolerance)
        and _touch(xyz, patch[i], patch[j], normals[i], cell)
    ]
    return _relabel(labels, _groups(m, joined))


def _one_plane(
    xyz: NDArray[np.float32],
    a: NDArray[np.int64],
    b: NDArray[np.int64],
    fit_a: Fit,
    fit_b: Fit,
    tolerance: float,
) -> bool:
    """Whether the smaller patch lies within tolerance of the larger one's plane."""
    plane, patch = (fit_a, b) if len(a) >= len(b) else (fit_b, a)
    near = near_plane(xyz[patch], plane.normal, plane.offset, tolerance)
    return len(near) >= COPLANAR_SHARE * len(patch)


def _touch(
    xyz: NDArray[np.float32],
    a: NDArray[np.int64],
    b: NDArray[np.int64],
    normal: NDArray[np.float64],
    cell: float,
) -> bool:
    at, _, shape = _cells_of(xyz, np.concatenate((a, b)), *plane_axes(normal), cell)
    grid = ndimage.binary_dilation(_filled(at[: len(a)], shape), EIGHT)
    return bool(grid.reshape(-1)[at[len(a) :]].any())


def members(labels: NDArray[np.int32]) -> list[NDArray[np.int64]]:
    """Return the indices of the points of each label from 0 on."""
    order, starts = _by_label(labels, int(labels.max(initial=-1)) + 1)
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


@nb.njit(cache=True, nogil=True)
def _moments(
    xyz: NDArray[np.float32], members: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean (3,) and the covariance (3, 3) of some points."""
    n = members.size
    mx = my = mz = 0.0
    for i in members:
        mx += xyz[i, 0]
        my += xyz[i, 1]
        mz += xyz[i, 2]
    mx, my, mz = mx / n, my / n, mz / n
    xx = yy = zz = xy = xz = yz = 0.0
    for i in members:
        x, y, z = xyz[i, 0] - mx, xyz[i, 1] - my, xyz[i, 2] - mz
        xx += x * x
        yy += y * y
        zz += z * z
        xy += x * y
        xz += x * z
        yz += y * z
    return np.array([mx, my, mz]), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) / n


@nb.njit(cache=True, nogil=True)
def _near_plane(
    xyz: NDArray[np.float32],
    nx: np.float32,
    ny: np.float32,
    nz: np.float32,
    offset: np.float32,
    distance: np.float32,
) -> NDArray[np.int64]:
    near = np.empty(xyz.shape[0], np.int64)
    count = 0
    for i in range(xyz.shape[0]):
        away = xyz[i, 0] * nx + xyz[i, 1] * ny + xyz[i, 2] * nz - offset
        near[count] = i
        count += abs(away) < distance
    return near[:count].copy()


@nb.njit(cache=True, nogil=True)
def _cells_of(
    xyz: NDArray[np.float32],
    members: NDArray[np.int64],
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    cell: float,
) -> tuple[NDArray[np.int64], NDArray[np.float64], tuple[int, int]]:
    """Return the cell of each member in a plane's grid, its lowest corner (2,) and its shape."""
    n = members.size
    ab = np.empty((n, 2))
    low_a = low_b = np.inf
    high_a = high_b = -np.inf
    for q in range(n):
        i = members[q]
        a = xyz[i, 0] * u[0] + xyz[i, 1] * u[1] + xyz[i, 2] * u[2]
        b = xyz[i, 0] * v[0] + xyz[i, 1] * v[1] + xyz[i, 2] * v[2]
        ab[q, 0], ab[q, 1] = a, b
        low_a, low_b = min(low_a, a), min(low_b, b)
        high_a, high_b = max(high_a, a), max(high_b, b)
    shape = (int((high_a - low_a) / cell) + 1, int((high_b - low_b) / cell) + 1)
    at = np.empty(n, np.int64)
    for q in range(n):
        at[q] = int((ab[q, 0] - low_a) / cell) * shape[1] + int((ab[q, 1] - low_b) / cell)
    return at, np.array([low_a, low_b]), shape


@nb.njit(cache=True, nogil=True)
def _by_label(
    labels: NDArray[np.int32], n_labels: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the points' order by label, ascending in each, and where each label begins."""
    starts = np.zeros(n_labels + 1, np.int64)
    for label in labels:
        if label >= 0:
            starts[label + 1] += 1
    for label in range(n_labels):
        starts[label + 1] += starts[label]
    order = np.empty(starts[n_labels], np.int64)
    at = starts[:-1].copy()
    for i in range(labels.size):
        if labels[i] >= 0:
            order[at[labels[i]]] = i
            at[labels[i]] += 1
    return order, starts
