"""The cubic cells of a lattice that a cloud lies in."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from storage.errors import MapSenseError
from storage.points import PointCloud
from tasks.device import cells

EXACT = 2**53
"""Whole numbers up to here are exact in double precision."""
MAX_DEPTH = 21
"""Halvings of a cube down to its cells: three times as many bits fit a key of 63."""


class OutOfReach(MapSenseError):
    """The points lie too far apart, or too far away, for cells of this size."""


@dataclass(frozen=True, eq=False)
class Box:
    """The box of cells around a cloud. Cell c covers [corner + c edge, corner + (c + 1) edge)."""

    edge: float
    """metres"""
    shift: NDArray[np.float64]
    """(3,), metres, from the lattice's corner to the cloud's origin"""
    low: NDArray[np.int64]
    """(3,), the box's first cell on each axis"""
    shape: NDArray[np.int64]
    """(3,), its cells along each axis, >= 1"""

    @property
    def depth(self) -> int:
        """Halvings of the smallest cube of 2^depth cells a side over the box."""
        return int(self.shape.max() - 1).bit_length()


def box_around(
    points: PointCloud, edge: float, corner: NDArray[np.float64], aligned: int = 1
) -> Box:
    """Return the box of cells around a cloud of at least one point.

    Parameters
    ----------
    points : PointCloud
    edge : float
        Edge of a cell, metres.
    corner : (3,) float
        Where a corner of a cell lies, building frame, metres.
    aligned : int
        The box begins at a multiple of so many cells.

    Raises
    ------
    OutOfReach
        If a coordinate is not finite, or so far out that its cell has no number, or the box is
        longer than 2^`MAX_DEPTH` cells.
    """
    shift = points.origin - corner
    ends = np.stack(cells.bounds(points.xyz)).astype(np.float64)
    at = np.floor((ends + shift) / edge)
    if not np.isfinite(at).all():
        raise OutOfReach("points: a coordinate is not a number; read the scan again")
    if np.abs(at).max() >= EXACT:
        raise OutOfReach(
            f"points: a coordinate of {np.abs(ends + shift).max():.3g} m is out of reach of cells "
            f"of {edge:g} m; remove stray points, or choose larger cells"
        )
    low, high = at.astype(np.int64)
    low -= low % aligned
    box = Box(edge, shift, low, high - low + 1)
    if box.depth > MAX_DEPTH:
        long, reach = box.shape.max() * edge, edge * 2**MAX_DEPTH
        raise OutOfReach(
            f"points: {long:.0f} m from one end to the other, cells of {edge:g} m reach "
            f"{reach:.0f} m; remove stray points, or choose larger cells"
        )
    return box
