"""What a storey holds between floor and ceiling, as upright columns of the rooms' floors.

Every room is cut into square columns, every column into slices by height over the room's floor; how
many points a slice holds is all that the search for furniture needs of the clouds.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import PositiveFloat

from storage.points import PointCloud
from storage.rooms import Rooms
from tasks.params import Params


class ColumnParams(Params):
    """How finely a storey is cut. Not in the paper."""

    cell_m: PositiveFloat = 0.04
    """Side of a column, metres: two voxels of the device's grid, so that a surface has no gaps."""
    slice_m: PositiveFloat = 0.02
    """Height of a slice, metres: about the spread of a horizontal surface's points. Assumption."""
    top_m: PositiveFloat = 2.3
    """Height over the floor up to which columns reach, metres: over the tallest furniture.
    Assumption."""
    beyond_m: PositiveFloat = 0.06
    """How far a room's columns reach beyond its outline, metres: the error of a wall.
    Assumption."""


BELOW_M = 0.1
"""How far columns reach below the floor, metres: what noise and drift add. Assumption."""


@dataclass(frozen=True, eq=False)
class Columns:
    """n columns; a room's form its part of one raster."""

    cell_m: float
    slice_m: float
    origin: NDArray[np.float64]
    """(2,), metres, building frame: corner of the raster's first cell"""
    index: NDArray[np.int32]
    """(a, b), column of each cell of the raster, along x and y; -1 outside all rooms"""
    cells: NDArray[np.int32]
    """(n, 2), cell of each column"""
    rooms: NDArray[np.int32]
    """(n,), room of each column; a room's are neighbours in this order"""
    counts: NDArray[np.uint8]
    """(n, k), points in each slice, lowest first, 255 for more"""

    def slice_of(self, height_m: float) -> int:
        """Return the slice that begins at or before a height over the floor."""
        return int((height_m + BELOW_M) / self.slice_m + 1e-6)

    def height_of(self, slices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the heights of slices' middles over the floor, metres."""
        return (slices + 0.5) * self.slice_m - BELOW_M

    def centres(self, columns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the (m, 2) middles of columns, metres, building frame."""
        return self.origin + (self.cells[columns] + 0.5) * self.cell_m

    def at(self, xy: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return the column at each of (m, 2) places, -1 where there is none."""
        cells = np.floor((xy - self.origin) / self.cell_m).astype(np.int64)
        inside = ((cells >= 0) & (cells < self.index.shape)).all(axis=1)
        cells[~inside] = 0
        return np.where(inside, self.index[cells[:, 0], cells[:, 1]], np.int32(-1))


def floors_of(rooms: Rooms) -> NDArray[np.float64]:
    """Return the height of each room's floor; where it was not seen, the median of the others."""
    known = rooms.floor_m[~np.isnan(rooms.floor_m)]
    return np.where(
        np.isnan(rooms.floor_m), np.median(known) if len(known) else np.nan, rooms.floor_m
    )


def cut_columns(rooms: Rooms, points: Sequence[PointCloud], params: ColumnParams) -> Columns:
    """Return the columns of all rooms whose floor's height is known.

    A cell in reach of two rooms is the one's that holds its middle, else the first one's.
    """
    floors = floors_of(rooms)
    kept = np.flatnonzero(~np.isnan(floors))
    origin, index, cells, owners = _raster(rooms.polygons, kept, params)
    slices = int(np.ceil((params.top_m + BELOW_M) / params.slice_m))
    counts = np.zeros((len(cells), slices), np.uint8)
    lowest = floors[owners] - BELOW_M
    for cloud in points:
        shift = cloud.origin - np.array([origin[0], origin[1], 0.0])
        _count(cloud.xyz, shift, params.cell_m, params.slice_m, index, lowest, counts)
    return Columns(params.cell_m, params.slice_m, origin, index, cells, owners, counts)


def _raster(
    polygons: NDArray[np.object_], kept: NDArray[np.int64], params: ColumnParams
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Return the raster's corner, the columns of its cells, and the columns' cells and rooms."""
    cell = params.cell_m
    around = shapely.buffer(polygons[kept], params.beyond_m, join_style="mitre")
    if not len(kept):
        none = np.empty((0, 2), np.int32)
        return np.zeros(2), np.full((1, 1), -1, np.int32), none, np.empty(0, np.int32)
    bounds = shapely.bounds(around)
    origin = np.floor(bounds[:, :2].min(axis=0) / cell) * cell
    shape = np.ceil((bounds[:, 2:].max(axis=0) - origin) / cell).astype(int)
    owner = np.full(shape, -1, np.int32)
    for shapes in (polygons[kept], around):
        for room, shape_ in zip(kept, shapes, strict=True):
            low, high = np.reshape(shapely.bounds(shape_), (2, 2))
            first = np.floor((low - origin) / cell).astype(int)
            last = np.ceil((high - origin) / cell).astype(int)
            part = owner[first[0] : last[0], first[1] : last[1]]
            x = origin[0] + (np.arange(first[0], first[0] + part.shape[0]) + 0.5) * cell
            y = origin[1] + (np.arange(first[1], first[1] + part.shape[1]) + 0.5) * cell
            shapely.prepare(shape_)
            inside = shapely.contains_xy(shape_, *np.meshgrid(x, y, indexing="ij"))
            part[inside & (part < 0)] = room
    cells = np.argwhere(owner >= 0).astype(np.int32)
    owners = owner[cells[:, 0], cells[:, 1]]
    order = np.argsort(owners, kind="stable")
    cells, owners = cells[order], owners[order]
    index = np.full(shape, -1, np.int32)
    index[cells[:, 0], cells[:, 1]] = np.arange(len(cells), dtype=np.int32)
    return origin, index, cells, owners


@numba.njit(cache=True, nogil=True)
def _count(
    xyz: NDArray[np.float32],
    shift: NDArray[np.float64],
    cell: float,
    height: float,
    index: NDArray[np.int32],
    lowest: NDArray[np.float64],
    counts: NDArray[np.uint8],
) -> None:  # pragma: no cover - compiled
    for i in range(len(xyz)):
        a = int(np.floor((xyz[i, 0] + shift[0]) / cell))
        b = int(np.floor((xyz[i, 1] + shift[1]) / cell))
        if a < 0 or b < 0 or a >= index.shape[0] or b >= index.shape[1]:
            continue
        column = index[a, b]
        if column < 0:
            continue
        k = int(np.floor((xyz[i, 2] + shift[2] - lowest[column]) / height))
        if 0 <= k < counts.shape[1] and counts[column, k] < 255:
            counts[column, k] += 1
