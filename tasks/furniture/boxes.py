"""Oriented boxes on the floor: fitted to columns, turned as the room is."""

from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

ROOM_BONUS = 1.1
"""How much larger a box along the room may be than the smallest one: few things stand askew.
Assumption."""

MIDDLES = 0.0
"""How much larger a box is than the one around its columns' middles, in columns: half a column on
each side is about what noise and drift add."""
FULL, THIN = 0.6, 0.35
"""Share of a box that is seen from which its outermost rows must be, and how much of it in them,
compared with the usual row. Assumption."""


@dataclass(frozen=True, eq=False)
class Box:
    """A rectangle on the floor."""

    centre: NDArray[np.float64]
    """(2,), metres"""
    axis: NDArray[np.float64]
    """(2,), unit, along the length"""
    length: float
    """metres along the axis"""
    depth: float
    """metres across it"""

    @property
    def across(self) -> NDArray[np.float64]:
        """Return the axis turned by a quarter to the left."""
        return np.array((-self.axis[1], self.axis[0]))

    @property
    def corners(self) -> NDArray[np.float64]:
        """Return the (4, 2) corners, counter-clockwise."""
        along, across = self.axis * self.length / 2, self.across * self.depth / 2
        return self.centre + np.array(
            (-along - across, along - across, along + across, across - along)
        )

    @property
    def polygon(self) -> shapely.Polygon:
        """Return the rectangle as a polygon."""
        return shapely.Polygon(self.corners)

    @property
    def area(self) -> float:
        """Return the area, square metres."""
        return self.length * self.depth

    def local(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (m, 2) places as distances along and across from the centre."""
        return (xy - self.centre) @ np.stack((self.axis, self.across), axis=1)

    def holds(self, xy: NDArray[np.float64], margin: float = 0.0) -> NDArray[np.bool_]:
        """Return which of (m, 2) places lie within, or no farther out than the margin."""
        half = np.array((self.length, self.depth)) / 2 + margin
        local = np.abs(self.local(xy))
        return (local[:, 0] <= half[0]) & (local[:, 1] <= half[1])

    def part(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> "Box":
        """Return a box by its bounds along and across, relative to this one's centre."""
        middle, size = (low + high) / 2, high - low
        centre = self.centre + middle[0] * self.axis + middle[1] * self.across
        return replace(self, centre=centre, length=float(size[0]), depth=float(size[1]))

    def long(self) -> "Box":
        """Return the same box with its length the longer side."""
        if self.length >= self.depth:
            return self
        return Box(self.centre, self.across, self.depth, self.length)


def room_directions(polygon: shapely.Polygon) -> NDArray[np.float64]:
    """Return the directions of a room's edges within a quarter turn, the longest first, radians."""
    xy = shapely.get_coordinates(polygon.exterior)
    edges = np.diff(xy, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    angles = np.round(np.arctan2(edges[:, 1], edges[:, 0]) % (np.pi / 2), 2) % round(np.pi / 2, 2)
    found, at = np.unique(angles, return_inverse=True)
    totals = np.bincount(at, lengths)
    large = np.argsort(-totals, kind="stable")
    return found[large[totals[large] > 0.15 * lengths.sum()]]


def fit_box(
    xy: NDArray[np.float64], directions: NDArray[np.float64], cell: float, trim: float = 0.0
) -> Box:
    """Return the smallest box around columns, along the room unless one askew is much smaller.

    Parameters
    ----------
    xy : (m, 2) float
        Middles of columns, metres; m > 0.
    directions : (k,) float
        Directions of the room, radians.
    cell : float
        Side of a column, metres: the box reaches half of it beyond the middles.
    trim : float
        Share of the columns that may stick out on each side.
    """
    hull = _hull(xy)
    edges = np.diff(hull, axis=0, append=hull[:1])
    own = np.arctan2(edges[:, 1], edges[:, 0]) % (np.pi / 2)
    tested = np.concatenate([directions, own]) if len(hull) > 2 else directions
    tested = tested if len(tested) else np.zeros(1)
    # the hull's corners reach as far as all columns do
    turned = _turned(hull, tested)
    sides = np.ptp(turned, axis=1) + MIDDLES * cell
    areas = sides.prod(axis=1) * np.where(np.arange(len(tested)) < len(directions), 1, ROOM_BONUS)
    angle = tested[int(np.argmin(areas))]
    local = _turned(xy, np.array([angle]))[0]
    low, high = (
        np.quantile(local, (trim, 1 - trim), axis=0) if trim else (local.min(0), local.max(0))
    )
    axis = np.array((np.cos(angle), np.sin(angle)))
    across = np.array((-axis[1], axis[0]))
    middle, size = (low + high) / 2, high - low + MIDDLES * cell
    centre = middle[0] * axis + middle[1] * across
    return Box(centre, axis, float(size[0]), float(size[1])).long()


def _turned(xy: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (k, m, 2) places along and across each of k directions."""
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    x, y = xy[:, 0], xy[:, 1]
    return np.stack((x * cosine + y * sine, y * cosine - x * sine), axis=2)


def _hull(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners of the convex hull."""
    hull = shapely.convex_hull(shapely.MultiPoint(xy))
    corners = shapely.get_coordinates(hull)
    return corners[:-1] if hull.geom_type == "Polygon" else corners


def without_fringe(xy: NDArray[np.float64], box: Box, cell: float) -> Box:
    """Return a well seen box without outermost rows that hold little: a neighbour's part, noise.

    Parameters
    ----------
    xy : (m, 2) float
        Middles of the columns the box was fitted to, one each, metres.
    """
    local = box.local(xy)
    half = np.array((box.length, box.depth)) / 2
    held = (np.abs(local) <= half + cell / 2).all(axis=1)
    if held.sum() * cell**2 < FULL * box.area:
        return box
    low, high = -half, half.copy()
    for axis in range(2):
        bins = np.floor((local[held, axis] + half[axis]) / cell + 0.5).astype(np.int64)
        rows = np.bincount(np.maximum(bins, 0))
        full = np.flatnonzero(rows >= THIN * np.quantile(rows, 0.75))
        low[axis] = max(low[axis], full[0] * cell - half[axis] - cell / 2)
        high[axis] = min(high[axis], full[-1] * cell - half[axis] + cell / 2)
    return box.part(low, high).long()
