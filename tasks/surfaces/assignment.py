"""All points labelled by the patches found among a few, and each plane fitted to its inliers."""

from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from storage.planes import PlaneLabels, Planes
from storage.points import PointCloud
from tasks.surfaces import patches

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
    tile: float,
) -> tuple[Planes, PlaneLabels]:
    """Label all points by the patches of the thinned ones, and fit each plane to its inliers."""
    members = [few[i] for i in patches.members(labels)]
    fits = [patches.fit_plane(xyz) for xyz in members]
    normals, offsets = np.array([f[0] for f in fits]), np.array([f[1] for f in fits])
    prints = [patches.footprint(xyz, n, cell) for xyz, n in zip(members, normals, strict=True)]
    prints = [_dilated(p, 2) for p in prints]
    every = np.empty(len(points), np.int32)
    stride = max(1, len(points) // REFIT_POINTS)
    for xyz in (points.xyz[::stride], points.xyz):
        hit, sums = _assign(xyz, prints, normals, offsets, tolerance, cell, tile, every)
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
    tile: float,
    labels: NDArray[np.int32],
) -> tuple[list[NDArray[np.bool_]], NDArray[np.float64]]:
    low, tiles_y, tile_starts, tile_patches = _patches_of_tiles(
        prints, normals, offsets, cell, tile
    )
    shapes = np.array([p.cells.shape for p in prints], np.int64)
    starts = np.concatenate(([0], np.cumsum(shapes.prod(axis=1))))
    flat = np.concatenate([p.cells.ravel() for p in prints]).view(np.uint8)
    hit = np.zeros(len(flat), np.uint8)
    sums = np.zeros((len(prints), 10))
    axes = np.array([(p.u, p.v) for p in prints])
    lows = np.array([p.low for p in prints])
    _assign_points(
        xyz, low, tile, tiles_y, tile_starts, tile_patches, normals, offsets, axes, lows, shapes,
        starts[:-1], flat, hit, tolerance, cell, labels, sums,
    )  # fmt: skip
    cut = [
        hit[a:b].astype(bool).reshape(s)
        for a, b, s in zip(starts, starts[1:], shapes, strict=False)
    ]
    return cut, sums


def _patches_of_tiles(
    prints: list[patches.Footprint],
    normals: NDArray[np.float64],
    offsets: NDArray[np.float64],
    cell: float,
    tile: float,
) -> tuple[NDArray[np.float64], int, NDArray[np.int64], NDArray[np.int64]]:
    """Return the tiles' corner, their number along y, and the patches whose box meets each."""
    boxes = []
    for p, normal, offset in zip(prints, normals, offsets, strict=True):
        a, b = np.nonzero(p.cells)
        ab = [p.low + cell * np.array(corner) for corner in
              ((a.min(), b.min()), (a.max() + 1, b.min()), (a.min(), b.max() + 1),
               (a.max() + 1, b.max() + 1))]  # fmt: skip
        corners = np.array([c[0] * p.u + c[1] * p.v + offset * normal for c in ab])[:, :2]
        boxes.append((corners.min(axis=0) - cell, corners.max(axis=0) + cell))
    lows, highs = np.array([b[0] for b in boxes]), np.array([b[1] for b in boxes])
    low = lows.min(axis=0)
    first = ((lows - low) / tile).astype(int)
    last = ((highs - low) / tile).astype(int)
    tiles = last.max(axis=0) + 1
    lists: list[list[int]] = [[] for _ in range(int(tiles.prod()))]
    for patch in range(len(prints)):
        for x in range(first[patch, 0], last[patch, 0] + 1):
            for y in range(first[patch, 1], last[patch, 1] + 1):
                lists[x * tiles[1] + y].append(patch)
    starts = np.concatenate(([0], np.cumsum([len(one) for one in lists]))).astype(np.int64)
    return low, int(tiles[1]), starts, np.array([patch for one in lists for patch in one], np.int64)


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
    return planes, PlaneLabels(rank[labels])


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
    xyz, low, tile, tiles_y, tile_starts, tile_patches, normals, offsets, axes, lows, shapes,
    starts, cells, hit, tolerance, cell, labels, sums,
):  # fmt: skip
    """Label every point with the nearest plane whose footprint holds it, in one pass.

    Fills `labels` (n,), `hit` (the footprint cells that got a point) and `sums` (m, 10).
    """
    tiles_x = (tile_starts.size - 1) // tiles_y
    for i in range(xyz.shape[0]):
        x, y, z = np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2])
        tx, ty = int((x - low[0]) / tile), int((y - low[1]) / tile)
        labels[i] = -1
        if tx < 0 or ty < 0 or tx >= tiles_x or ty >= tiles_y:
            continue
        t = tx * tiles_y + ty
        best, chosen, where = tolerance, -1, 0
        for q in range(tile_starts[t], tile_starts[t + 1]):
            p = tile_patches[q]
            away = abs(x * normals[p, 0] + y * normals[p, 1] + z * normals[p, 2] - offsets[p])
            if away >= best:
                continue
            u = x * axes[p, 0, 0] + y * axes[p, 0, 1] + z * axes[p, 0, 2] - lows[p, 0]
            v = x * axes[p, 1, 0] + y * axes[p, 1, 1] + z * axes[p, 1, 2] - lows[p, 1]
            a, b = int(u / cell), int(v / cell)
            if u < 0 or v < 0 or a >= shapes[p, 0] or b >= shapes[p, 1]:
                continue
            at = starts[p] + a * shapes[p, 1] + b
            if cells[at]:
                best, chosen, where = away, p, at
        if chosen < 0:
            continue
        labels[i] = chosen
        hit[where] = 1
        s = sums[chosen]
        s[0] += x
        s[1] += y
        s[2] += z
        s[3] += x * x
        s[4] += y * y
        s[5] += z * z
        s[6] += x * y
        s[7] += x * z
        s[8] += y * z
        s[9] += 1
