"""A cloud of even density: what the Hough transform draws from.

A scanner sees near surfaces a thousand times denser than far ones. One point per voxel gives
every square metre of surface the same say, and makes the work depend on area, not on points.
"""

from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

COLUMN = 1.0
"""Edge of the columns in which a building is told from what is seen through its windows, metres."""
SPARSE = 0.05
"""Share of the usual points per column below which a column is not of the building."""
MAX_CELLS = 1 << 26
"""Voxels of a scan's bounding box that one byte each may be kept for (64 MB)."""
FULL = 255
"""Points of a voxel that are counted."""
DENSE = 2
"""Points per occupied voxel from which surfaces fill their voxels, and a voxel alone is clutter."""
COMPANY = 2
"""Occupied neighbours, of 26, a voxel of a surface has at least."""
TAIL = 4
"""A voxel with fewer than a fourth of a neighbour's points holds the tail of its noise."""
NEIGHBOURS = 8
"""Points a local plane is fitted to: few, so that coarse clouds have flat neighbourhoods too."""
FLAT = 20
"""Percentile of the neighbourhoods' roughness that is taken for the sensor's noise: the rougher
ones are edges and clutter."""
FLAT_READS = 0.77
"""What that percentile reads of Gaussian noise of standard deviation 1 on a plane."""
SAMPLE = 1000
"""Neighbourhoods looked at: their median is then known to a few per cent."""
WHOLE = 60_000
"""Points of a room: up to here all of them are looked at."""
PLACES = 24
"""Columns of one square metre looked at in a larger cloud."""


def bounds(xyz: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the least and greatest coordinates of (n, 3) points, n > 0."""
    return _bounds(xyz)


def body(xyz: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return which points belong to the building, and not to what is seen through its windows.

    The largest connected group of dense columns, with one column around it.
    """
    low, high = np.percentile(xyz[:: max(1, len(xyz) // 100_000), :2], [0.5, 99.5], axis=0)
    low, high = low - 20 * COLUMN, high + 20 * COLUMN  # beyond that is nobody's room
    at = np.floor((xyz[:, :2] - low.astype(np.float32)) / np.float32(COLUMN)).astype(np.int32)
    shape = np.floor((high - low) / COLUMN).astype(int) + 1
    inside = ((at >= 0) & (at < shape)).all(axis=1)
    column = np.where(inside, at[:, 0] * shape[1] + at[:, 1], 0)
    counts = np.bincount(column[inside], minlength=shape.prod())
    dense = (counts >= SPARSE * np.median(counts[column[inside]])).reshape(shape)
    groups, _ = ndimage.label(dense & (counts.reshape(shape) > 0), np.ones((3, 3)))
    points = np.bincount(groups.ravel(), weights=counts)
    points[0] = 0
    main = ndimage.binary_dilation(groups == points.argmax(), np.ones((3, 3)))
    return inside & main.ravel()[column]


def thin(xyz: NDArray[np.float32], voxel: float) -> NDArray[np.int64]:
    """Return the indices of one point per occupied voxel, the first in file order.

    Voxels with far fewer points than a neighbour are left out: in a dense cloud they hold the
    tails of the noise, and counting them like the surface itself would make every wall thick. In
    a dense cloud a voxel without neighbours is left out as well: clutter keeps its voxels however
    many points there are, while a surface's are filled.

    Parameters
    ----------
    xyz : (n, 3) float
        Points, metres.
    voxel : float
        Edge of a voxel, metres; grown where the bounding box has too many of them.

    Returns
    -------
    (k,) int
        Ascending.
    """
    if not len(xyz):
        return np.empty(0, np.int64)
    low, high = bounds(xyz)
    extent = (high - low).astype(np.float64)
    while np.prod(np.floor(extent / voxel) + 1) > MAX_CELLS:
        voxel *= 1.26  # doubles the volume of a voxel
    shape = (np.floor(extent / voxel) + 1).astype(np.int64)
    # one empty layer around, so that every voxel has its six neighbours
    counts = np.zeros(shape + 2, np.uint8)
    return _one_of_each(xyz, low, np.float32(1 / voxel), shape, counts)


@nb.njit(cache=True, nogil=True)
def _bounds(xyz):
    lx, ly, lz = xyz[0, 0], xyz[0, 1], xyz[0, 2]
    hx, hy, hz = lx, ly, lz
    for i in range(1, xyz.shape[0]):
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        # no branches: what is extreme in a shuffled cloud cannot be foretold
        lx = x if x < lx else lx
        ly = y if y < ly else ly
        lz = z if z < lz else lz
        hx = x if x > hx else hx
        hy = y if y > hy else hy
        hz = z if z > hz else hz
    return np.array([lx, ly, lz]), np.array([hx, hy, hz])


@nb.njit(inline="always")
def _voxel_of(xyz, i, low, inverse, shape):
    x = min(np.int64((xyz[i, 0] - low[0]) * inverse), shape[0] - 1) + 1
    y = min(np.int64((xyz[i, 1] - low[1]) * inverse), shape[1] - 1) + 1
    z = min(np.int64((xyz[i, 2] - low[2]) * inverse), shape[2] - 1) + 1
    return x, y, z


@nb.njit(inline="always")
def _company(counts, x, y, z):
    """Return how many of the 26 voxels around one are occupied."""
    company = -1
    for dx in range(-1, 2):
        for dy in range(-1, 2):
            for dz in range(-1, 2):
                company += counts[x + dx, y + dy, z + dz] > 0
    return company


@nb.njit(cache=True, nogil=True)
def _one_of_each(xyz, low, inverse, shape, counts):
    first = np.empty(min(xyz.shape[0], counts.size), np.int64)  # touched as far as it is filled
    occupied = 0
    for i in range(xyz.shape[0]):
        x, y, z = _voxel_of(xyz, i, low, inverse, shape)
        count = counts[x, y, z]
        first[occupied] = i
        occupied += count == 0
        counts[x, y, z] = count + (count < FULL)
    dense = xyz.shape[0] > DENSE * occupied
    kept = 0
    for q in range(occupied):
        i = first[q]
        x, y, z = _voxel_of(xyz, i, low, inverse, shape)
        most = max(
            counts[x - 1, y, z], counts[x + 1, y, z], counts[x, y - 1, z],
            counts[x, y + 1, z], counts[x, y, z - 1], counts[x, y, z + 1],
        )  # fmt: skip
        if TAIL * counts[x, y, z] < most or (dense and _company(counts, x, y, z) < COMPANY):
            continue
        first[kept] = i
        kept += 1
    return first[:kept].copy()


@dataclass(frozen=True)
class Grain:
    """How fine and how rough a cloud is."""

    spacing: float
    """median distance from a point to its nearest neighbour, metres"""
    noise: float
    """standard deviation across the cloud's flat places, metres"""


def grain(xyz: NDArray[np.float32], rng: np.random.Generator) -> Grain:
    """Measure spacing and noise at a sample of a cloud's places.

    The noise is the smallest principal component of small neighbourhoods, of the flattest fifth.
    """
    near_some = _around(xyz, rng)
    here = xyz[near_some]
    tree = cKDTree(here, balanced_tree=False, compact_nodes=False)
    chosen = rng.choice(len(here), min(SAMPLE, len(here)), replace=False)
    away, near = tree.query(here[chosen], k=min(NEIGHBOURS, len(here)))
    local = here[near].astype(np.float64)
    local -= local.mean(axis=1, keepdims=True)
    scatter = np.einsum("nki,nkj->nij", local, local) / max(local.shape[1] - 3, 1)
    smallest = np.sqrt(np.maximum(np.linalg.eigvalsh(scatter)[:, 0], 0))
    return Grain(float(np.median(away[:, 1])), float(np.percentile(smallest, FLAT)) / FLAT_READS)


def _around(xyz: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.int64]:
    """Return the points near some places: a tree over all would cost more than it says."""
    if len(xyz) <= WHOLE:
        return np.arange(len(xyz))
    near = np.zeros(len(xyz), bool)
    for x, y in xyz[rng.choice(len(xyz), PLACES, replace=False), :2]:
        near |= (np.abs(xyz[:, 0] - x) < 0.5) & (np.abs(xyz[:, 1] - y) < 0.5)
    return np.flatnonzero(near)
