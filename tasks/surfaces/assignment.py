"""All points labelled by the patches found among a few, and each plane fitted to its inliers."""

from dataclasses import dataclass
from itertools import pairwise

import numba as nb
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from storage.planes import PlaneLabels, Planes
from storage.points import PointCloud
from tasks.surfaces import patches
from tasks.surfaces.candidates import find_candidates, make_atlas

MIN_POINTS = 20
"""Points below which a patch is an accident."""
REFIT_POINTS = 100_000
"""Points that settle the planes well enough before all points are labelled."""


def label_all(
    points: PointCloud,
    few: NDArray[np.float32],
    labels: NDArray[np.int32],
    tolerance: float,
    cell: float,
) -> tuple[Planes, PlaneLabels]:
    """Label all points by the patches of the thinned ones, and fit each plane to its inliers."""
    members = patches.members(labels)
    fits = [patches.fit_plane(few, i) for i in members]
    normals, offsets = np.array([f.normal for f in fits]), np.array([f.offset for f in fits])
    prints = [patches.footprint(few, i, n, cell) for i, n in zip(members, normals, strict=True)]
    prints = [_dilated(p, 2) for p in prints]
    every = np.empty(len(points), np.int32)
    stride = max(1, len(points) // REFIT_POINTS)
    for xyz in (points.xyz[::stride], points.xyz):
        hit, sums = _assign(xyz, prints, normals, offsets, tolerance, cell, every)
        fitted, at, rms = Moments(sums).planes()
        # a handful of a large cloud's sample says less than the thinned points did
        good = sums[:, 9] >= (3 if len(xyz) == len(points) else MIN_POINTS)
        normals = np.where(good[:, None], fitted, normals)
        offsets = np.where(good, at, offsets)
        prints = [_dilated(_reached(p, h, stride), 1) for p, h in zip(prints, hit, strict=True)]
    return _ordered(points, every, normals, offsets, rms, sums[:, 9].astype(np.int64))


def _reached(print_: patches.Footprint, hit: NDArray[np.bool_], stride: int) -> patches.Footprint:
    """Return the cells that got a point; a sample of the points does not get into every cell."""
    cells = hit if stride == 1 and hit.any() else print_.cells
    return patches.Footprint(print_.u, print_.v, print_.low, cells)


def _dilated(print_: patches.Footprint, cells: int) -> patches.Footprint:
    grown = ndimage.binary_dilation(print_.cells, patches.EIGHT, iterations=cells)
    return patches.Footprint(print_.u, print_.v, print_.low, grown)


def _assign(
    xyz: NDArray[np.float32],
    prints: list[patches.Footprint],
    normals: NDArray[np.float64],
    offsets: NDArray[np.float64],
    tolerance: float,
    cell: float,
    labels: NDArray[np.int32],
) -> tuple[list[NDArray[np.bool_]], NDArray[np.float64]]:
    atlas = make_atlas(prints, normals, offsets)
    near = find_candidates(atlas, tolerance, cell)
    hit = np.zeros(len(atlas.cells), bool)
    sums = np.zeros((len(prints), 10))
    _assign_points(
        xyz, near.low.astype(np.float32), np.float32(1 / near.edge), near.shape, near.starts,
        near.patches, atlas.planes, atlas.axes, atlas.shapes, atlas.firsts, atlas.cells, hit,
        tolerance, cell, labels, sums,
    )  # fmt: skip
    cut = [
        hit[a:b].reshape(p.cells.shape)
        for (a, b), p in zip(pairwise(atlas.firsts), prints, strict=True)
    ]
    return cut, sums


def _ordered(
    points: PointCloud,
    labels: NDArray[np.int32],
    normals: NDArray[np.float64],
    offsets: NDArray[np.float64],
    rms: NDArray[np.float64],
    inliers: NDArray[np.int64],
) -> tuple[Planes, PlaneLabels]:
    """Return the patches that kept inliers, most first."""
    order = np.argsort(-inliers, kind="stable")
    order = order[inliers[order] >= MIN_POINTS]
    rank = np.full(len(inliers) + 1, -1, np.int32)  # the last entry serves label -1
    rank[order] = np.arange(len(order))
    flip = np.where(offsets[order] < 0, -1.0, 1.0)
    planes = Planes(
        normals=normals[order] * flip[:, None],
        offsets=offsets[order] * flip,
        inliers=inliers[order],
        rms=rms[order],
        origin=points.origin,
    )
    _renumber(labels, rank)
    return planes, PlaneLabels(labels)


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums over the inliers of m planes, from which a least-squares plane follows."""

    sums: NDArray[np.float64]
    """(m, 10): x, y, z, xx, yy, zz, xy, xz, yz, count"""

    def planes(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return normals (m, 3), offsets (m,) and rms distances (m,) of the fitted planes."""
        s = self.sums
        count = np.maximum(s[:, 9], 1)
        centre = s[:, :3] / count[:, None]
        scatter = s[:, [3, 6, 7, 6, 4, 8, 7, 8, 5]].reshape(-1, 3, 3) / count[:, None, None]
        scatter = scatter - centre[:, :, None] * centre[:, None, :]
        values, vectors = np.linalg.eigh(scatter)
        normals = vectors[:, :, 0]
        offsets = np.einsum("ij,ij->i", normals, centre)
        return normals, offsets, np.sqrt(np.maximum(values[:, 0], 0))


@nb.njit(cache=True, nogil=True)
def _assign_points(
    xyz, low, per_edge, voxels, starts, candidates, planes, axes, shapes, firsts, cells, hit,
    tolerance, cell, labels, sums,
):  # fmt: skip
    """Label every point with the nearest plane whose footprint holds it, in one pass.

    Fills `labels` (n,), `hit` (the footprint cells that got a point) and `sums` (m, 10).
    """
    low_x, low_y, low_z = low
    voxels_x, voxels_y, voxels_z = voxels
    per_cell = 1 / cell
    for i in range(xyz.shape[0]):
        labels[i] = -1
        fx = (xyz[i, 0] - low_x) * per_edge
        fy = (xyz[i, 1] - low_y) * per_edge
        fz = (xyz[i, 2] - low_z) * per_edge
        if not (0 <= fx < voxels_x and 0 <= fy < voxels_y and 0 <= fz < voxels_z):
            continue
        voxel = (np.int64(fx) * voxels_y + np.int64(fy)) * voxels_z + np.int64(fz)
        x, y, z = np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2])
        best, chosen, where = tolerance, -1, 0
        for q in range(starts[voxel], starts[voxel + 1]):
            p = candidates[q]
            away = abs(x * planes[p, 0] + y * planes[p, 1] + z * planes[p, 2] - planes[p, 3])
            if away >= best:
                continue
            a = (x * axes[p, 0] + y * axes[p, 1] + z * axes[p, 2] - axes[p, 3]) * per_cell
            b = (x * axes[p, 4] + y * axes[p, 5] + z * axes[p, 6] - axes[p, 7]) * per_cell
            if not (0 <= a < shapes[p, 0] and 0 <= b < shapes[p, 1]):
                continue
            at = firsts[p] + np.int64(a) * shapes[p, 1] + np.int64(b)
            if cells[at]:
                best, chosen, where = away, p, at
        if chosen < 0:
            continue
        labels[i] = chosen
        hit[where] = True
        sums[chosen, 0] += x
        sums[chosen, 1] += y
        sums[chosen, 2] += z
        sums[chosen, 3] += x * x
        sums[chosen, 4] += y * y
        sums[chosen, 5] += z * z
        sums[chosen, 6] += x * y
        sums[chosen, 7] += x * z
        sums[chosen, 8] += y * z
        sums[chosen, 9] += 1


@nb.njit(cache=True, nogil=True)
def _renumber(labels, rank):
    for i in range(labels.size):
        labels[i] = rank[labels[i]]
