"""Tops that go round a corner, such as worktops, cut into the rectangles they consist of."""

import numpy as np
from numpy.typing import NDArray

from tasks.furniture.boxes import Box

SAVED = 0.72
"""Share of a box's area that its two parts together may have, for a corner to be cut. Assumption:
of an oblong that hides half behind something else, no cut leaves so little."""
SIDE_M, AREA_M2 = 0.3, 0.2
"""Least side and area of a part, metres and square metres. Assumption."""


def cut_at_corner(xy: NDArray[np.float64], box: Box, cell: float) -> NDArray[np.bool_] | None:
    """Return which columns of a top lie before its best cut; None if none leaves little enough.

    Parameters
    ----------
    xy : (m, 2) float
        Middles of the columns, metres.
    box : Box
        Around them.

    Notes
    -----
    The best cut is the one whose two parts have the smallest boxes together.
    """
    local = box.local(xy)
    size = np.array((box.length, box.depth))
    best, found = SAVED, None
    for axis in range(2):
        bins = np.clip(
            np.floor((local[:, axis] + size[axis] / 2) / cell), 0, round(size[axis] / cell)
        ).astype(np.int64)
        n = int(bins.max()) + 1
        low, high = np.full(n, np.inf), np.full(n, -np.inf)
        np.minimum.at(low, bins, local[:, 1 - axis])
        np.maximum.at(high, bins, local[:, 1 - axis])
        before = np.maximum.accumulate(high) - np.minimum.accumulate(low) + cell
        after = (np.maximum.accumulate(high[::-1]) - np.minimum.accumulate(low[::-1]))[::-1] + cell
        at = np.arange(1, n)
        lengths = np.stack((at, n - at)) * cell
        widths = np.stack((before[:-1], after[1:]))
        fits = (np.minimum(lengths, widths).min(axis=0) >= SIDE_M) & np.isfinite(widths).all(axis=0)
        fits &= (lengths * widths).min(axis=0) >= AREA_M2
        if not fits.any():
            continue
        left = np.where(fits, (lengths * widths).sum(axis=0) / (n * cell * size[1 - axis]), np.inf)
        cut = int(np.argmin(left))
        if left[cut] < best:
            best, found = float(left[cut]), bins < at[cut]
    return found
