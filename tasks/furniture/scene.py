"""One room as the search for furniture sees it: its columns, surfaces, panels and outline."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.rooms import Rooms
from tasks.furniture.backs import BackParams, panel_tops
from tasks.furniture.boxes import Box, room_directions
from tasks.furniture.columns import Columns, floors_of
from tasks.furniture.patches import PatchParams, find_patches, upper_surfaces
from tasks.furniture.windows import closed_side, filled_share, from_edges, rows_in

FLOOR_M = 0.06
"""How far from the floor's height its points may lie, metres: noise and drift."""
OUT_M, IN_M = 0.04, 0.1
"""How far out of a box and how far in its closed front may stand, metres: noise, and how far a top
reaches over what carries it. Assumption."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What one room holds. Heights are metres over its floor."""

    room: int
    polygon: shapely.Polygon
    floor_m: float
    directions: NDArray[np.float64]
    """(k,), radians: of the room's edges"""
    columns: Columns
    """of the whole storey"""
    rows: NDArray[np.int64]
    """(n,), the room's columns"""
    xy: NDArray[np.float64]
    """(n, 2), their middles, metres"""
    from_wall: NDArray[np.float64]
    """(n,), distance of each from the outline, metres"""
    floor_seen: NDArray[np.bool_]
    """(n,), whether points lie at the floor"""
    panels: NDArray[np.float64]
    """(n,), upper edge of the panel in each column; NaN if none"""
    standing: NDArray[np.float64]
    """(n,), upper edge of the panel in each column that may stand on a table; NaN if none"""
    where: NDArray[np.int64]
    """(m,), place in `rows` of each upper surface"""
    heights: NDArray[np.float64]
    """(m,), of each upper surface"""
    patches: tuple[NDArray[np.int64], ...]
    """of each patch, the places of its surfaces in `where`"""

    def within(self, box: Box, margin: float = 0.0) -> NDArray[np.int64]:
        """Return the places of the columns in a box."""
        reach = np.hypot(box.length, box.depth) / 2 + 2 * margin
        middle = (box.centre - self.columns.origin) / self.columns.cell_m
        shape = np.array(self.columns.index.shape)
        low = np.clip(np.floor(middle - reach / self.columns.cell_m), 0, shape).astype(np.int64)
        high = np.clip(np.ceil(middle + reach / self.columns.cell_m), 0, shape).astype(np.int64)
        # the raster's window, not the room: halls are large
        return rows_in(
            self.columns.index,
            (int(low[0]), int(high[0]), int(low[1]), int(high[1])),
            int(self.rows[0]),
            int(self.rows[-1]),
            self.xy,
            box.centre,
            box.axis,
            (box.length / 2 + margin, box.depth / 2 + margin),
        )

    def surfaces_in(
        self, box: Box, low: float, high: float, margin: float = 0.0
    ) -> NDArray[np.int64]:
        """Return the upper surfaces in a box between two heights."""
        places = self.within(box, margin)
        first = np.searchsorted(self.where, places)
        counts = np.searchsorted(self.where, places, "right") - first
        starts = np.repeat(first - np.concatenate(([0], np.cumsum(counts)[:-1])), counts)
        found = starts + np.arange(len(starts))
        return found[(self.heights[found] >= low) & (self.heights[found] <= high)]

    def slices(self, places: NDArray[np.int64], low: float, high: float) -> NDArray[np.uint8]:
        """Return the (m, k) point counts of columns between two heights."""
        first = max(self.columns.slice_of(low), 0)
        highest = self.columns.counts.shape[1]
        last = highest if np.isinf(high) else max(self.columns.slice_of(high), first + 1)
        counts: NDArray[np.uint8] = self.columns.counts[self.rows[places], first:last]
        return counts

    def filled(self, places: NDArray[np.int64], low: float, high: float) -> float:
        """Return the share of the slices of columns between two heights that hold points.

        NaN without any slice.
        """
        first, last = self._slices(low, high)
        if not len(places) or high <= low or last <= first:
            return np.nan
        return float(filled_share(self.columns.counts, self.rows[places], first, last))

    def closed(self, box: Box, low: float, high: float) -> float:
        """Return how much of the side of a box that is filled best holds points.

        Between two heights, by cells of columns and slices; NaN without any. The front of a
        cupboard is closed; of a table legs are seen, and at most a panel at its ends.
        """
        places = self.within(box, OUT_M)
        first, last = self._slices(low, high)
        if not len(places) or high <= low or last <= first:
            return np.nan
        half = box.length / 2 + OUT_M, box.depth / 2 + OUT_M
        local, rows = box.local(self.xy[places]), self.rows[places]
        cell = self.columns.cell_m
        return float(
            closed_side(self.columns.counts, rows, local, half, OUT_M + IN_M, cell, first, last)
        )

    def _slices(self, low: float, high: float) -> tuple[int, int]:
        first = max(self.columns.slice_of(low), 0)
        last = max(self.columns.slice_of(high), first + 1)
        return first, min(last, self.columns.counts.shape[1])


def scenes(
    rooms: Rooms,
    columns: Columns,
    patch_params: PatchParams,
    back_params: BackParams,
    standing_params: BackParams,
) -> Iterator[Scene]:
    """Yield the rooms that have columns."""
    where, heights = upper_surfaces(columns, patch_params)
    patches = find_patches(columns, where, heights, patch_params)
    panels = panel_tops(columns, back_params)
    standing = panel_tops(columns, standing_params)
    first = columns.slice_of(-FLOOR_M)
    floor_seen = columns.counts[:, first : columns.slice_of(FLOOR_M)].max(axis=1) > 0
    floors = floors_of(rooms)
    surface_room = columns.rooms[where]
    patch_room = surface_room[[part[0] for part in patches]] if patches else np.empty(0, int)
    for room in np.unique(columns.rooms):
        rows = np.flatnonzero(columns.rooms == room)
        mine = np.flatnonzero(surface_room == room)
        xy = columns.centres(rows)
        yield Scene(
            int(room),
            rooms.polygons[room],
            float(floors[room]),
            room_directions(rooms.polygons[room]),
            columns,
            rows,
            xy,
            from_edges(xy, _edges(rooms.polygons[room])),
            floor_seen[rows],
            panels[rows],
            standing[rows],
            where[mine] - rows[0],
            heights[mine],
            tuple(np.searchsorted(mine, patches[i]) for i in np.flatnonzero(patch_room == room)),
        )


def _edges(polygon: shapely.Polygon) -> NDArray[np.float64]:
    """Return the (e, 2, 2) edges of a room, those of its holes included."""
    rings = (polygon.exterior, *polygon.interiors)
    corners = [shapely.get_coordinates(ring) for ring in rings]
    return np.concatenate([np.stack((ring[:-1], ring[1:]), axis=1) for ring in corners])
