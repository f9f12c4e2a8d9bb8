"""Thinning a cloud on the device by a voxel grid (Sec. 3.3)."""

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat

from storage.points import PointCloud
from tasks.device import cells
from tasks.device.lattice import box_around
from tasks.params import Params


class VoxelParams(Params):
    """How coarse the cloud that leaves the device is."""

    edge_m: PositiveFloat = 0.02
    """Edge of a voxel, metres. Assumption: the paper gives none. A voxel no larger than the
    codec's leaf would change nothing."""


def voxel_grid(points: PointCloud, params: VoxelParams) -> PointCloud:
    """Replace the points of each occupied voxel by their centroid.

    The grid's lines are the multiples of the edge in the building frame: two scans of a place have
    the same voxels there, whatever else they saw.

    Parameters
    ----------
    points : PointCloud
        n points.

    Returns
    -------
    PointCloud
        One point per occupied voxel, in Morton order, with the same origin; without snapshots,
        since a centroid may be of several.

    Raises
    ------
    OutOfReach
        If the points lie too far apart for voxels of this size.
    """
    xyz = centroids(points, params.edge_m, np.zeros(3))
    return PointCloud(xyz, points.origin.copy(), snapshot=None)


def centroids(points: PointCloud, edge: float, corner: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the (k, 3) centroids, relative to the origin, of a grid with a given corner.

    As `voxel_grid`; `corner` is (3,), metres, building frame.
    """
    if not len(points):
        return np.empty((0, 3), np.float32)
    box = box_around(points, edge, corner)
    # sorting takes memory for the points only, however far apart they are; counting on a grid of
    # the whole box was no faster, as the sums of voxels then lie in random order
    keys = cells.morton_keys(points.xyz, box.shift, edge, box.low)
    means: NDArray[np.float32] = cells.sorted_means(
        points.xyz, *cells.sorted_order(keys, 3 * box.depth)
    )
    return means
