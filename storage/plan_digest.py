"""What a plan is known by, whatever its rooms are called: so that none is scored that taught."""

from hashlib import sha256

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from storage.plan import Plan

Ring = NDArray[np.int64]  # (n, 2), whole millimetres, not closed

TIE = 0.55
"""Added before a coordinate in millimetres is rounded down. Plans are written with four decimals
of metres: half a millimetre is a common value, and noise would round it up or down by chance."""
STRAIGHT_MM = 1.5
"""How far a corner may be off the line between its neighbours and be none: rounding moves each of
the three by up to half a diagonal of a millimetre."""


def plan_digest(plan: Plan) -> str:
    """Return a hash of the shapes and places of a plan's rooms, to the millimetre.

    Names, ids, classes, heights, walls and furniture do not count, nor does the order of rooms and
    of their corners, where a ring starts and which way it runs, corners on straight sides, or a
    shift of the whole plan by whole millimetres. Noise does not count below 0.05 mm on plans
    as they are written, to a tenth of a millimetre. Anything else gives another digest: a plan
    that was rotated, or shifted by a fraction of a millimetre, is not known again, for no rounding
    keeps what hundreds of coordinates round to.

    Returns
    -------
    str
        64 hexadecimal digits; those of all plans without rooms are the same.
    """
    outlines = [_rings(room.polygon) for room in plan.rooms]
    if not outlines:
        return sha256(b"").hexdigest()
    corner = np.min([ring.min(axis=0) for rings in outlines for ring in rings], axis=0)
    rooms = sorted(sorted(_canonical(ring - corner) for ring in rings) for rings in outlines)
    return sha256(repr(rooms).encode()).hexdigest()


def _rings(polygon: Polygon) -> list[Ring]:
    """Return the outline of a room and those of its holes, all anticlockwise."""
    rings = [polygon.exterior, *polygon.interiors]
    return [_rounded(shapely.get_coordinates(_anticlockwise(ring))[:-1]) for ring in rings]


def _anticlockwise(ring: shapely.LinearRing) -> shapely.LinearRing:
    return ring if ring.is_ccw else ring.reverse()


def _rounded(xy: NDArray[np.float64]) -> Ring:
    return np.floor(1000 * xy + TIE).astype(np.int64)


def _canonical(ring: Ring) -> list[tuple[int, int]]:
    """Return the corners of a ring from its least one on."""
    apart = ring[(ring != np.roll(ring, 1, axis=0)).any(axis=1)]
    corners = apart[_is_corner(apart)]
    if len(corners) < 3:  # so small or so round that no corner stands out
        corners = ring
    points = [(int(x), int(y)) for x, y in corners]
    start = points.index(min(points))
    return points[start:] + points[:start]


def _is_corner(ring: Ring) -> NDArray[np.bool_]:
    """Tell for each point of a ring whether the ring turns there."""
    before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
    chord, arm = after - before, ring - before
    off = np.abs(chord[:, 0] * arm[:, 1] - chord[:, 1] * arm[:, 0])
    return off > STRAIGHT_MM * np.maximum(np.hypot(*chord.T), 1e-9)
