"""Which patches pass through which part of space: a point need be held against these only.

Space is cut into voxels a few footprint cells wide. Hardly one of them is met by more than two
patches, however many a storey has, so that labelling a cloud costs the same in a room as in a hall.
"""

from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

from tasks.surfaces.patches import Footprint

CELLS_WIDE = 2
"""Edge of a voxel, footprint cells: smaller ones are met by as many patches."""
MAX_VOXELS = 1 << 21
"""Voxels beyond which they are made larger."""
ROUNDING = 1e-3
"""What single precision may move a point by, metres."""
LEAST_COS = 0.5
"""A plane that has been fitted anew is hardly tilted against its footprint; if it is, by more than
sixty degrees, its points are not looked for far away."""


@dataclass(frozen=True, eq=False)
class Atlas:
    """The planes and footprints of m patches."""

    planes: NDArray[np.float64]
    """(m, 4), unit normal and offset in metres"""
    axes: NDArray[np.float64]
    """(m, 8): the footprint's first axis, its low corner along it, the second, its corner"""
    shapes: NDArray[np.int64]
    """(m, 2), cells along each axis"""
    firsts: NDArray[np.int64]
    """(m + 1,), where in `cells` each footprint begins"""
    cells: NDArray[np.bool_]
    """all footprints, one after the other"""


@dataclass(frozen=True, eq=False)
class Candidates:
    """The patches that may hold the points of each voxel."""

    low: NDArray[np.float64]
    """(3,), metres, corner of voxel (0, 0, 0)"""
    edge: float
    """metres"""
    shape: NDArray[np.int64]
    """(3,)"""
    starts: NDArray[np.int32]
    """where in `patches` each voxel begins; one more for the end"""
    patches: NDArray[np.int32]


def make_atlas(
    prints: list[Footprint], normals: NDArray[np.float64], offsets: NDArray[np.float64]
) -> Atlas:
    """Return the footprints in flat arrays."""
    shapes = np.array([p.cells.shape for p in prints], np.int64)
    return Atlas(
        planes=np.column_stack([normals, offsets]),
        axes=np.array([(*p.u, p.low[0], *p.v, p.low[1]) for p in prints]),
        shapes=shapes,
        firsts=np.concatenate(([0], np.cumsum(shapes.prod(axis=1)))),
        cells=np.concatenate([p.cells.ravel() for p in prints]),
    )


def find_candidates(atlas: Atlas, tolerance: float, cell: float) -> Candidates:
    """Return the voxels that points within tolerance of a patch can lie in.

    Parameters
    ----------
    atlas : Atlas
    tolerance : float
        Greatest distance of a point from its plane, metres.
    cell : float
        Edge of a footprint cell, metres.

    Returns
    -------
    Candidates
    """
    low, high = _extent(atlas.planes, atlas.axes, atlas.shapes, tolerance + ROUNDING, cell)
    edge = CELLS_WIDE * cell
    while np.prod(np.floor((high - low) / edge) + 1) > MAX_VOXELS:
        edge *= 1.26  # doubles the volume of a voxel
    shape = np.floor((high - low) / edge).astype(np.int64) + 1
    starts, patches = _list_patches(
        atlas.planes, atlas.axes, atlas.shapes, atlas.firsts, atlas.cells, tolerance + ROUNDING,
        cell, low, edge, shape,
    )  # fmt: skip
    return Candidates(low, edge, shape, starts, patches)


@nb.njit(cache=True, nogil=True)
def _box(
    planes: NDArray[np.float64],
    axes: NDArray[np.float64],
    p: int,
    corner: tuple[float, float],
    size: tuple[float, float],
    tolerance: float,
    box: NDArray[np.float64],
) -> None:
    """Fill in the box (least x, y, z, greatest x, y, z) around a rectangle of a patch.

    The footprint's axes u and v are those of an earlier fit. The plane n . x = d meets the line
    with coordinates a and b along those at a u + b v + c w, w = u x v, c = (d - (a u + b v) . n) /
    (w . n).
    """
    u, v = axes[p, :3], axes[p, 4:7]
    wx, wy, wz = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    nx, ny, nz, offset = planes[p]
    cos = wx * nx + wy * ny + wz * nz
    cos = max(cos, LEAST_COS) if cos > 0 else min(cos, -LEAST_COS)
    box[:3], box[3:] = np.inf, -np.inf
    for a in (corner[0], corner[0] + size[0]):
        for b in (corner[1], corner[1] + size[1]):
            x, y, z = a * u[0] + b * v[0], a * u[1] + b * v[1], a * u[2] + b * v[2]
            rest = offset - x * nx - y * ny - z * nz
            for c in ((rest - tolerance) / cos, (rest + tolerance) / cos):
                box[0], box[3] = min(box[0], x + c * wx), max(box[3], x + c * wx)
                box[1], box[4] = min(box[1], y + c * wy), max(box[4], y + c * wy)
                box[2], box[5] = min(box[2], z + c * wz), max(box[5], z + c * wz)


@nb.njit(cache=True, nogil=True)
def _extent(
    planes: NDArray[np.float64],
    axes: NDArray[np.float64],
    shapes: NDArray[np.int64],
    tolerance: float,
    cell: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high, box = np.full(3, np.inf), np.full(3, -np.inf), np.empty(6)
    for p in range(planes.shape[0]):
        size = shapes[p, 0] * cell, shapes[p, 1] * cell
        _box(planes, axes, p, (axes[p, 3], axes[p, 7]), size, tolerance, box)
        low, high = np.minimum(low, box[:3]), np.maximum(high, box[3:])
    return low, high


@nb.njit(cache=True, nogil=True)
def _list_patches(
    planes: NDArray[np.float64],
    axes: NDArray[np.float64],
    shapes: NDArray[np.int64],
    firsts: NDArray[np.int64],
    cells: NDArray[np.bool_],
    tolerance: float,
    cell: float,
    low: NDArray[np.float64],
    edge: float,
    shape: NDArray[np.int64],
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    voxels = shape[0] * shape[1] * shape[2]
    starts = np.zeros(voxels + 1, np.int32)
    at = np.zeros(voxels, np.int32)
    patches = np.empty(0, np.int32)
    last = np.empty(voxels, np.int32)
    box = np.empty(6)
    first, end = np.empty(3, np.int64), np.empty(3, np.int64)
    for filling in range(2):  # count, then fill in
        last[:] = -1
        for p in range(planes.shape[0]):
            for q in range(firsts[p], firsts[p + 1]):
                if not cells[q]:
                    continue
                a, b = divmod(q - firsts[p], shapes[p, 1])
                corner = axes[p, 3] + a * cell, axes[p, 7] + b * cell
                _box(planes, axes, p, corner, (cell, cell), tolerance, box)
                for k in range(3):
                    first[k] = max(0, int((box[k] - low[k]) / edge))
                    end[k] = min(shape[k], int((box[3 + k] - low[k]) / edge) + 1)
                for x in range(first[0], end[0]):
                    for y in range(first[1], end[1]):
                        for z in range(first[2], end[2]):
                            voxel = (x * shape[1] + y) * shape[2] + z
                            if last[voxel] == p:
                                continue
                            last[voxel] = p
                            if filling:
                                patches[at[voxel]] = p
                                at[voxel] += 1
                            else:
                                starts[voxel + 1] += 1
        if not filling:
            for voxel in range(voxels):
                starts[voxel + 1] += starts[voxel]
                at[voxel] = starts[voxel]
            patches = np.empty(starts[voxels], np.int32)
    return starts, patches
