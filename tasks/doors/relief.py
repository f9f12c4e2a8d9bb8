"""How far behind or before a wall face its points lie, pixel by pixel (Sec. 5's depth map).

The points tell it finer than the voxels that rays meet: a shut leaf lies a few centimetres behind
its wall. Points of a pixel that lie apart are those of two surfaces, such as the two faces of a
thin wall: the room sees the nearer one, however much denser the other was scanned.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numba as nb
import numpy as np
from numpy.typing import NDArray

from storage.points import PointCloud
from tasks.doors.rays import Canvas

Depths = NDArray[np.float32]
LAYER_M = 0.02
"""Thickness of a layer, metres: twice a depth camera's noise."""
CELL_M = 0.5
"""Edge of the plan cells that know which faces are near, metres."""
LEAST_SHARE = 0.3
"""Of the points of a pixel's fullest layers, that a surface before it has too; fewer are noise."""
LEAST_FACE = 0.5
"""Of the pixels of a face's fullest layers, that a face before it has too; fewer are of what stands
before it."""


@dataclass(frozen=True, eq=False)
class Layers:
    """How many points lie in each layer of each pixel of f faces."""

    counts: tuple[NDArray[np.uint8], ...]
    """per face (a, b, l); 255 is the last"""
    reach_m: float
    """layer 0 begins this far before the face"""

    def depths(self) -> NDArray[np.float64]:
        """Return the middles of the layers, (l,) metres behind the face."""
        n = _layers(self.reach_m)
        return np.linspace(0.5, n - 0.5, n) * LAYER_M - self.reach_m


def _layers(reach: float) -> int:
    return int(np.ceil(2 * reach / LAYER_M))


def layered(clouds: Sequence[PointCloud], canvases: Sequence[Canvas], reach: float) -> Layers:
    """Sort the points near the faces into pixels and layers.

    Parameters
    ----------
    clouds : sequence of PointCloud
    canvases : sequence of Canvas
        f faces with pixels of one size.
    reach : float
        How far before and behind a face points are looked at, metres.
    """
    if not canvases:
        return Layers((), reach)
    low, shape, starts, near = _faces_near(canvases, reach)
    sizes = np.array([canvas.shape for canvas in canvases], np.int64)
    n = _layers(reach)
    first = np.concatenate([[0], np.cumsum(sizes.prod(axis=1) * n)])
    counts = np.zeros(first[-1], np.uint8)
    origins = np.array([canvas.origin for canvas in canvases])
    axes = np.array([canvas.axis for canvas in canvases])
    pixel = canvases[0].pixel_m
    for cloud in clouds:
        _collect(
            cloud.xyz, cloud.origin, low, shape, starts, near,
            origins, axes, sizes, n, first, pixel, reach, counts,
        )  # fmt: skip
    parts = (counts[a:b] for a, b in pairwise(first))
    return Layers(tuple(p.reshape(*size, n) for p, size in zip(parts, sizes, strict=True)), reach)


def standing(layers: Layers, face: int, before: float, behind: float) -> float:
    """Return how far behind its place in the plan a face stands: where the first surface is that
    many of its pixels have points of. A plan's wall may be centimetres off: straightened, or met by
    scans that drifted.

    Parameters
    ----------
    before, behind : float
        Greatest distance looked at to either side, metres. Without points there it is 0.
    """
    depths = layers.depths()
    pixels = np.count_nonzero(layers.counts[face], axis=(0, 1)).astype(float)
    pixels[(depths < -before) | (depths > behind)] = 0
    depth = _first_peak(pixels, 0, len(pixels), depths, LEAST_FACE)
    return 0.0 if np.isnan(depth) else float(depth)


def relief(layers: Layers, face: int, stands: float, before: float, behind: float) -> Depths:
    """Return how far behind (+) or before (-) a face the surface of each pixel lies, (a, b) metres.

    It is the mean of two layers that follow each other, a peak, and the one nearest to the room;
    NaN where there is no point.

    Parameters
    ----------
    stands : float
        How far behind its place in the plan the face stands, metres.
    before, behind : float
        Greatest distance from there, metres.
    """
    depths = layers.depths() - stands
    within = np.flatnonzero((depths >= -before) & (depths <= behind))
    image = np.empty(layers.counts[face].shape[:2], np.float32)
    _nearest(layers.counts[face], within[0], within[-1] + 1, depths, image)
    return image


def _faces_near(
    canvases: Sequence[Canvas], reach: float
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return a plan lattice (corner, shape) and the faces near each of its cells: those of cell c
    are near[starts[c] : starts[c + 1]]."""
    cells, faces = [], []
    ends = np.array(
        [(c.origin[:2], c.origin[:2] + c.shape[0] * c.pixel_m * c.axis) for c in canvases]
    )
    low = ends.min(axis=(0, 1)) - reach - 2 * CELL_M
    shape = np.ceil((ends.max(axis=(0, 1)) + reach + 2 * CELL_M - low) / CELL_M).astype(np.int64)
    for face, (start, end) in enumerate(ends):
        # all cells that a disc of this radius, rolled along the face, may touch
        reached = reach + CELL_M
        box = np.array([np.minimum(start, end) - reached, np.maximum(start, end) + reached])
        a, b = np.clip(((box - low) / CELL_M).astype(np.int64), 0, shape - 1)
        i, j = (values.ravel() for values in np.mgrid[a[0] : b[0] + 1, a[1] : b[1] + 1])
        middles = low + (np.column_stack([i, j]) + 0.5) * CELL_M
        away = np.abs((middles - start) @ canvases[face].normal) <= reached
        cells.append((i * shape[1] + j)[away])
        faces.append(np.full(away.sum(), face))
    cell, face_of = np.concatenate(cells), np.concatenate(faces)
    order = np.argsort(cell, kind="stable")
    starts = np.searchsorted(cell[order], np.arange(shape.prod() + 1))
    return low, shape, starts, face_of[order]


@nb.njit(cache=True, nogil=True)
def _collect(
    xyz, shift, low, shape, starts, near,
    origins, axes, sizes, layers, first, pixel, reach, counts,
):  # fmt: skip
    """Add the points to the layers of the pixels they lie in."""
    for p in range(xyz.shape[0]):
        x, y, z = xyz[p, 0] + shift[0], xyz[p, 1] + shift[1], xyz[p, 2] + shift[2]
        c_x, c_y = (x - low[0]) / CELL_M, (y - low[1]) / CELL_M
        if not (0 <= c_x < shape[0] and 0 <= c_y < shape[1]):
            continue
        cell = int(c_x) * shape[1] + int(c_y)
        for k in range(starts[cell], starts[cell + 1]):
            f = near[k]
            d_x, d_y = x - origins[f, 0], y - origins[f, 1]
            depth = d_x * axes[f, 1] - d_y * axes[f, 0]  # the room's side is negative
            layer = np.floor((depth + reach) / LAYER_M)
            i = np.floor((d_x * axes[f, 0] + d_y * axes[f, 1]) / pixel)
            j = np.floor((z - origins[f, 2]) / pixel)
            if 0 <= layer < layers and 0 <= i < sizes[f, 0] and 0 <= j < sizes[f, 1]:
                at = first[f] + (int(i) * sizes[f, 1] + int(j)) * layers + int(layer)
                if counts[at] < 255:
                    counts[at] += 1


@nb.njit(cache=True, nogil=True)
def _nearest(counts, first, end, depths, image):
    """Set each pixel to the depth of the first surface among the layers [first, end)."""
    for i in range(image.shape[0]):
        for j in range(image.shape[1]):
            image[i, j] = _first_peak(counts[i, j], first, end, depths, LEAST_SHARE)


@nb.njit(cache=True, nogil=True)
def _first_peak(counts, first, end, depths, share):
    """Return the mean depth of the first two layers in a row, of [first, end), that have at least
    this share of the most that two have, and no fewer than the next two; NaN if all are empty."""
    most = 0.0
    for layer in range(first, end - 1):
        most = max(most, float(counts[layer]) + float(counts[layer + 1]))
    if most == 0:
        return np.nan
    layer, last = first, end - 2
    while layer < last:
        here = float(counts[layer]) + float(counts[layer + 1])
        if here >= share * most and here >= float(counts[layer + 1]) + float(counts[layer + 2]):
            break
        layer += 1
    here, there = float(counts[layer]), float(counts[layer + 1])
    return (here * depths[layer] + there * depths[layer + 1]) / (here + there)
