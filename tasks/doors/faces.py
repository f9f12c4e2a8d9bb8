"""The faces of walls: which side of which wall piece looks at which room."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.rooms import Rooms
from storage.walls import Walls

BEFORE_M = 0.05
"""Distance from a face at which the room before it is told from the one behind, metres."""


@dataclass(frozen=True, eq=False)
class WallFaces:
    """f faces; the faces of one wall piece follow each other. Building frame, metres."""

    walls: NDArray[np.int32]
    """(f,), row of the wall piece"""
    rooms: NDArray[np.int32]
    """(f,), room that looks at it"""
    opposite: NDArray[np.int32]
    """(f,), face on the other side of the wall piece; -1 for none"""
    origins: NDArray[np.float64]
    """(f, 2), where it begins in plan"""
    axes: NDArray[np.float64]
    """(f, 2), unit, from there along it; the room lies to the left"""
    lengths: NDArray[np.float64]
    """(f,)"""
    thickness_m: NDArray[np.float64]
    """(f,), of the wall; NaN where only one face was seen"""

    def __len__(self) -> int:
        return len(self.walls)


def wall_faces(rooms: Rooms, walls: Walls) -> WallFaces:
    """Return each wall piece's face towards each of its rooms.

    A wall with a thickness has its faces half of it beside its centre line; the line of any other
    is the face itself.
    """
    spans = walls.lines[:, 1] - walls.lines[:, 0]
    lengths = np.linalg.norm(spans, axis=1)
    along = spans / np.maximum(lengths, 1e-9)[:, None]
    left = np.column_stack([-along[:, 1], along[:, 0]])
    half = np.nan_to_num(walls.thickness_m) / 2
    wall, slot = np.nonzero((walls.rooms >= 0) & (lengths > 0)[:, None])
    room = walls.rooms[wall, slot]
    on_left = _lies_left(rooms, walls, room, wall, left * (half + BEFORE_M)[:, None])
    turned = ~on_left
    away = np.where(on_left, half[wall], -half[wall])
    origins = walls.lines[wall, turned.astype(int)] + left[wall] * away[:, None]
    first = np.searchsorted(wall, wall)
    both = np.bincount(wall, minlength=len(walls))[wall] == 2
    other = 2 * first + 1 - np.arange(len(wall))
    return WallFaces(
        walls=wall.astype(np.int32),
        rooms=room.astype(np.int32),
        opposite=np.where(both, other, -1).astype(np.int32),
        origins=origins,
        axes=along[wall] * np.where(turned, -1.0, 1.0)[:, None],
        lengths=lengths[wall],
        thickness_m=walls.thickness_m[wall],
    )


def _lies_left(
    rooms: Rooms,
    walls: Walls,
    room: NDArray[np.int32],
    wall: NDArray[np.int64],
    beside: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Return whether each face's room is nearer to the left side of its wall than to the right."""
    middles = walls.lines.mean(axis=1)
    to_left, to_right = (
        shapely.distance(rooms.polygons[room], shapely.points((middles + side)[wall]))
        for side in (beside, -beside)
    )
    return to_left <= to_right
