"""Registration (Sec. 3.1): every snapshot rotated and translated by its pose into one frame."""

import numba as nb
import numpy as np
from numpy.typing import NDArray

from tasks.scans.raw import FLOAT32_LIMIT, Poses


def register(
    points: NDArray[np.floating], snapshot: NDArray[np.int32] | int, poses: Poses
) -> NDArray[np.floating]:
    """Return points in the frame of the poses.

    Parameters
    ----------
    points : (n, 3) float
        In the frame of the sensor that saw them, the unit of the poses.
    snapshot : (n,) int or int
        Which pose saw a point, or all of them.
    poses : Poses

    Returns
    -------
    (n, 3) float
        32 bits where all coordinates are small enough for them, else 64.

    Raises
    ------
    IndexError
        If a snapshot has no pose.
    """
    of = np.full(len(points), snapshot, np.int32) if isinstance(snapshot, int) else snapshot
    if len(of) and not 0 <= of.min() <= of.max() < len(poses):
        raise IndexError(f"snapshots {of.min()} to {of.max()}, expected 0 to {len(poses) - 1}")
    reach = np.abs(poses.positions).max(initial=0) + np.sqrt(3) * np.abs(points).max(initial=0)
    registered: NDArray[np.floating] = np.empty(
        points.shape, np.float32 if reach < FLOAT32_LIMIT else np.float64
    )
    _register(points, of, np.ascontiguousarray(poses.rotations), poses.positions, registered)
    return registered


@nb.njit(cache=True, nogil=True)
def _register(
    points: NDArray[np.floating],
    of: NDArray[np.int32],
    rotations: NDArray[np.float64],
    positions: NDArray[np.float64],
    out: NDArray[np.floating],
) -> None:
    for i in range(points.shape[0]):
        s = of[i]
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for axis in range(3):
            R = rotations[s, axis]
            out[i, axis] = R[0] * x + R[1] * y + R[2] * z + positions[s, axis]
