"""Closed boxes of one material: what the mesh of a storey is put together from."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tasks.simulation.materials import MATT

Quad = NDArray[np.float64]
"""(4, 2), corners of a convex quadrangle in order, metres"""

BOX = np.array(
    [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]  # bottom, top
    + [[i, (i + 1) % 4, 4 + (i + 1) % 4] for i in range(4)]
    + [[i, 4 + (i + 1) % 4, 4 + i] for i in range(4)]
)


class Solid(NamedTuple):
    """A part of a mesh."""

    vertices: NDArray[np.float64]
    """(v, 3), metres"""
    triangles: NDArray[np.int64]
    """(t, 3), indices of vertices, anticlockwise from outside"""
    material: int
    """index of `MATERIALS`"""


def prism(footprint: Quad, low_m: float, high_m: float, material: int = MATT) -> Solid:
    """Return the closed box over a footprint between two heights."""
    x, y = (footprint - footprint[0]).T
    if x[1] * y[2] - x[2] * y[1] + x[2] * y[3] - x[3] * y[2] < 0:
        footprint = footprint[::-1]
    heights = np.repeat((low_m, high_m), 4)
    vertices = np.column_stack((np.vstack((footprint, footprint)), heights))
    return Solid(vertices, BOX, material)


def sheet(
    a: NDArray[np.float64], b: NDArray[np.float64], low_m: float, high_m: float, material: int
) -> Solid:
    """Return an upright rectangle without thickness over the line from a to b."""
    vertices = np.array([(*a, low_m), (*b, low_m), (*b, high_m), (*a, high_m)])
    return Solid(vertices, np.array([(0, 1, 2), (0, 2, 3)]), material)


def part_of(quad: Quad, along: Sequence[float], across: Sequence[float]) -> Quad:
    """Return a rectangle within one, by metres from its first corner along two sides.

    Parameters
    ----------
    along : start and stop along the side from the first to the second corner; negative values count
        from its end
    across : the same along the side from the first to the last corner
    """
    u, v = quad[1] - quad[0], quad[3] - quad[0]
    length, depth = float(np.linalg.norm(u)), float(np.linalg.norm(v))
    low, high = (value if value >= 0 else length + value for value in along)
    near, far = (value if value >= 0 else depth + value for value in across)
    shares = np.array([(low, near), (high, near), (high, far), (low, far)]) / (length, depth)
    corners: Quad = quad[0] + shares @ np.array((u, v))
    return corners
