"""What rays and points say of each pixel of a wall face, and when holes say nothing (Sec. 5)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from storage.wall_images import EMPTY, NOT_SEEN, OCCLUDED, OCCUPIED
from tasks.doors.rays import ASIDE, HIT, PASSED, STOPPED, Votes
from tasks.doors.relief import Depths

Seen = tuple[NDArray[np.uint8], Depths, NDArray[np.uint8]]
"""Labels, depths and shares of rays that went through of a face's pixels, each (a, b)."""


def labelled(votes: Votes, relief: Depths, empty_share: float) -> Seen:
    """Return a face's labels, depths, and shares of the rays that went through."""
    stopped, hit, aside, through = votes.counts
    # what ended within the wall beside its pixel met the surface behind the face that the pixel's
    # points lie on, or else came in by an opening
    closed = ~np.isnan(relief)
    passed = through + np.where(closed, 0, aside)
    reached = hit + aside + through
    wall = np.where(passed >= empty_share * reached, EMPTY, OCCUPIED)
    hidden = np.where(stopped > 0, OCCLUDED, NOT_SEEN)
    label = np.where(reached > 0, wall, hidden).astype(np.uint8)
    depth = np.where((label == OCCUPIED) & closed, relief, np.nan).astype(np.float32)
    of_ends = (
        (OCCUPIED, HIT), (OCCUPIED, ASIDE), (EMPTY, PASSED), (EMPTY, ASIDE), (OCCLUDED, STOPPED)
    )  # fmt: skip
    for value, end in of_ends:
        of_rays = (label == value) & np.isnan(depth) & (votes.counts[end] > 0)
        depth[of_rays] = votes.depth_m[end][of_rays] / votes.counts[end][of_rays]
    empty = np.rint(255 * passed / np.maximum(reached, 1)).astype(np.uint8)
    return label, depth, empty


def scanned(
    seen: Sequence[Seen], opposite: NDArray[np.int32], first_row: int, least: float
) -> NDArray[np.bool_]:
    """Return of which faces the wall was scanned, from either side, (f,).

    Over its doors a wall is closed: where rays go through there as well, it was not scanned.

    Parameters
    ----------
    opposite : (f,) int
        Face on the wall's other side, -1 for none.
    first_row : int
        Of the pixels over all doors.
    least : float
        Share of those reached up there that must have been hit.
    """
    hit, reached = (
        np.array([np.isin(label[:, first_row:], ends).sum() for label, _, _ in seen])
        for ends in ((OCCUPIED,), (OCCUPIED, EMPTY))
    )
    own = hit >= least * reached
    return own | ((opposite >= 0) & own[opposite])


def without_holes(seen: Seen) -> Seen:
    """Return what is seen of a face, its EMPTY pixels NOT_SEEN."""
    label, depth, empty = seen
    hole = label == EMPTY
    return (
        np.where(hole, np.uint8(NOT_SEEN), label),
        np.where(hole, np.float32(np.nan), depth),
        np.where(hole, np.uint8(0), empty),
    )
