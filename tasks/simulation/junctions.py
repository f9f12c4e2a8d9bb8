"""Where walls meet: how far each runs past the end of its centre line so that corners close.

Let a wall of thickness t end where another of thickness T starts, turned by the angle d. Its face
on the outside of the turn meets the other's outer face (T - t cos d) / (2 sin d) past the end: T/2
at a right angle, t/2 tan(d/2) between equals, nothing straight on.
"""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

TOUCH_M = 0.01
"""Ends nearer than this meet: the plan's file form keeps tenths of a millimetre, people a
centimetre."""
STRAIGHT = 1e-3
"""Sine of the turn under which two walls run straight on."""

Lines = NDArray[np.float64]
"""(w, 2, 2), ends of centre lines, metres"""
Lengths = NDArray[np.float64]
"""(w,), metres"""


def end_extensions(lines: Lines, thickness_m: Lengths) -> NDArray[np.float64]:
    """Return how far each wall's body runs past its two ends.

    Parameters
    ----------
    lines : (w, 2, 2) float
        Ends of the centre lines, metres.
    thickness_m : (w,) float
        Metres.

    Returns
    -------
    (w, 2) float
        Metres past the first and the last end. A wall that ends inside another runs no farther; one
        that ends at nothing runs half its thickness on, for lines drawn to the faces of others.
    """
    extensions = np.zeros((len(lines), 2))
    if not len(lines):
        return extensions
    segments = shapely.linestrings(lines)
    for k in range(2):
        at, along = lines[:, k], _unit(lines[:, k] - lines[:, 1 - k])
        near = shapely.distance(shapely.points(at)[:, None], segments[None])
        for i in range(len(lines)):
            extensions[i, k] = _extension(i, at[i], along[i], lines, thickness_m, near[i])
    return extensions


def _extension(
    i: int,
    at: NDArray[np.float64],
    along: NDArray[np.float64],
    lines: Lines,
    t: Lengths,
    near: Lengths,
) -> float:
    meets = np.linalg.norm(lines - at, axis=2) < TOUCH_M
    meets[i] = False
    others, ends = np.nonzero(meets)
    inside = near <= t / 2 + TOUCH_M
    inside[i] = inside[others] = False
    if not len(others):
        return 0.0 if inside.any() else float(t[i]) / 2
    away = _unit(lines[others, 1 - ends] - lines[others, ends])
    cosine = away @ along
    sine = np.abs(along[0] * away[:, 1] - along[1] * away[:, 0])
    turns = sine > STRAIGHT
    # at a sharp corner the far edge of a square end reaches the other's face last; where a third
    # wall fills the corner, the near edge stays behind that face instead
    near_edge = np.abs(cosine) if len(others) > 1 else cosine
    reach = (t[others] - t[i] * near_edge)[turns] / (2 * sine[turns])
    # sharp corners are cut: a mitre of 10 degrees would be metres long
    return float(np.clip(reach, 0.0, np.maximum(t[others][turns], t[i])).max(initial=0.0))


def wall_footprints(lines: Lines, thickness_m: Lengths) -> NDArray[np.object_]:
    """Return the (w,) footprints of walls that close their corners."""
    extensions = end_extensions(lines, thickness_m)
    along = _unit(lines[:, 1] - lines[:, 0])
    across = np.column_stack((-along[:, 1], along[:, 0])) * thickness_m[:, None] / 2
    a = lines[:, 0] - along * extensions[:, :1]
    b = lines[:, 1] + along * extensions[:, 1:]
    return shapely.polygons(np.stack((a - across, b - across, b + across, a + across), axis=1))


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def solid_area(lines: Lines, thickness_m: Lengths) -> Polygon:
    """Return the union of the footprints."""
    return shapely.union_all(wall_footprints(lines, thickness_m))
