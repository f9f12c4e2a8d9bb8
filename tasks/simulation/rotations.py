"""Unit quaternions (a, b, c, d), scalar first, Hamilton's product."""

import numba as nb
import numpy as np
from numpy.typing import ArrayLike, NDArray

Quaternions = NDArray[np.float64]
"""(..., 4)"""


def about(axis: str, angle_rad: ArrayLike) -> Quaternions:
    """Return the rotations by (...) angles about the axis x, y or z."""
    half = np.asarray(angle_rad, float) / 2
    quaternions = np.zeros((*half.shape, 4))
    quaternions[..., 0] = np.cos(half)
    quaternions[..., 1 + "xyz".index(axis)] = np.sin(half)
    return quaternions


def product(left: Quaternions, right: Quaternions) -> Quaternions:
    """Return the rotations that do `right` first, then `left`."""
    a, b, c, d = np.moveaxis(left, -1, 0)
    e, f, g, h = np.moveaxis(right, -1, 0)
    parts = (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )
    return np.stack(parts, axis=-1)


def matrices(quaternions: Quaternions) -> NDArray[np.float64]:
    """Return the (..., 3, 3) rotation matrices of unit quaternions."""
    a, b, c, d = np.moveaxis(quaternions, -1, 0)
    rows = (
        (1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)),
        (2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)),
        (2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


@nb.njit(cache=True, nogil=True)
def turned(
    turns: NDArray[np.float64], of: NDArray[np.int32], vectors: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (n, 3) vectors, each turned by its own one of (k, 3, 3) rotation matrices."""
    out = np.empty_like(vectors)
    for i in range(vectors.shape[0]):
        x, y, z = vectors[i, 0], vectors[i, 1], vectors[i, 2]
        for axis in range(3):
            R = turns[of[i], axis]
            out[i, axis] = R[0] * x + R[1] * y + R[2] * z
    return out
