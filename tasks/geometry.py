"""Planes and frames that more than one component needs."""

import numpy as np
from numpy.typing import NDArray

PARALLEL = 1e-9
"""Triple product below which three unit normals meet in no single point."""


def unit_axes(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit vectors from the first to the second end of plan lines.

    Parameters
    ----------
    lines : (n, 2, 2) float
        Ends, metres.

    Returns
    -------
    (n, 2) float
        Zero for a line of no length.
    """
    across = lines[:, 1] - lines[:, 0]
    return across / np.maximum(np.linalg.norm(across, axis=1), 1e-12)[:, None]


def intersect_planes(
    normals: NDArray[np.float64], offsets: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the point common to three planes by Cramer's rule (Eq. 8).

    Parameters
    ----------
    normals : (..., 3, 3) float
        Unit normals, one per row.
    offsets : (..., 3) float
        Metres, normal . x = offset (Eq. 8 writes normal . x + d = 0, so its d is -offset).

    Returns
    -------
    (..., 3) float
        NaN where two of the planes are parallel: they are simply not neighbours.
    """
    n1, n2, n3 = normals[..., 0, :], normals[..., 1, :], normals[..., 2, :]
    d1, d2, d3 = (offsets[..., i, None] for i in range(3))
    triple = np.einsum("...i,...i->...", n1, np.cross(n2, n3))[..., None]
    top = d1 * np.cross(n2, n3) + d2 * np.cross(n3, n1) + d3 * np.cross(n1, n2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.abs(triple) > PARALLEL, top / triple, np.nan)
