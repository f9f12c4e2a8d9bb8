"""The rectangles of a furnished box room; a wall with doors is cut into whole rectangles."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

DOOR_HEAD_M = 2.05
"""Height of a door opening."""
TABLE_M, TABLE_TOP_M, LEG_M = (1.4, 0.7), 0.74, 0.05
"""Length and depth of a table, its height, the side of a leg."""
CHAIR_M, SEAT_M, BACK_M = 0.42, 0.45, 0.45
"""Side of a chair, height of its seat, height of its back over the seat."""
X, Y, Z = np.eye(3)

Vector = NDArray[np.float64]
"""(3,), metres"""
Doors = dict[str, tuple[tuple[float, float], ...]]
"""Spans of openings along the wall by its side: S, N (along x), W, E (along y), metres"""


@dataclass(frozen=True)
class Box:
    """The inside of a room: its low corner, its size, its door openings."""

    x: float
    y: float
    width: float
    depth: float
    height: float
    doors: Doors = field(default_factory=dict)


class Face(NamedTuple):
    """One rectangle: a corner, two edges, the normal to the scanned side."""

    corner: Vector
    u: Vector
    v: Vector
    normal: Vector
    role: str
    doors: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Patches:
    """p rectangles without holes; several may be parts of one surface."""

    corners: NDArray[np.float64]
    """(p, 3), metres"""
    u: NDArray[np.float64]
    """(p, 3), one edge, metres"""
    v: NDArray[np.float64]
    """(p, 3), the other edge, metres"""
    normals: NDArray[np.float64]
    """(p, 3), unit length, to the scanned side"""
    centres: NDArray[np.float64]
    """(p, 3), middle of the patch's whole surface, metres"""
    surface: NDArray[np.int64]
    """(p,), index of the surface, ascending from 0"""
    rooms: NDArray[np.int64]
    """(p,), the room the patch is in"""
    roles: NDArray[np.str_]
    """(p,), what the surface is"""

    def bounds(self) -> tuple[Vector, Vector]:
        """Return the low and the high corner of all patches, metres."""
        ends = [self.corners + a * self.u + b * self.v for a in (0, 1) for b in (0, 1)]
        return np.min(ends, axis=(0, 1)), np.max(ends, axis=(0, 1))

    def moved(self, rotation: NDArray[np.float64], shift: Vector) -> "Patches":
        """Return the patches turned about the origin, then shifted."""
        return replace(
            self,
            corners=self.corners @ rotation.T + shift,
            u=self.u @ rotation.T,
            v=self.v @ rotation.T,
            normals=self.normals @ rotation.T,
            centres=self.centres @ rotation.T + shift,
        )

    @staticmethod
    def joined(parts: list["Patches"]) -> "Patches":
        """Return all patches as one, surfaces numbered on."""
        starts = np.cumsum([0] + [part.surface[-1] + 1 for part in parts[:-1]])
        columns = {
            f.name: np.concatenate([getattr(part, f.name) for part in parts])
            for f in fields(Patches)
        }
        columns["surface"] += np.repeat(starts, [len(part.surface) for part in parts])
        return Patches(**columns)


def furnished_patches(
    room: Box, number: int, tables: int, chairs: int, rng: np.random.Generator
) -> Patches:
    """Return the patches of a room's surfaces and furniture, which stands on six fixed spots."""
    spots = np.array([(fx, fy) for fx in (0.22, 0.5, 0.78) for fy in (0.28, 0.72)])
    spots = rng.permutation(spots) * (room.width, room.depth) + (room.x, room.y)
    faces = [*_shell(room)]
    length = min(TABLE_M[0], 0.4 * room.width)
    for x, y in spots[:tables]:
        faces += _table(np.array((x - length / 2, y - TABLE_M[1] / 2, 0.0)), length)
    for i in range(chairs):
        # a fifth chair stands beside the first
        spot = spots[2 + i % 4] + rng.uniform((-0.35, -0.2), (0.35, 0.2)) + (0.5 * (i // 4), 0)
        low, high = (room.x, room.y), (room.x + room.width, room.y + room.depth)
        corner = np.clip(spot - CHAIR_M / 2, low, np.array(high) - CHAIR_M)
        faces += _chair(np.array((*corner, 0.0)))
    return _patches(faces, number)


def _shell(room: Box) -> Iterator[Face]:
    """Yield floor, ceiling and the four walls."""
    low = np.array((room.x, room.y, 0.0))
    u, v, w = room.width * X, room.depth * Y, room.height * Z
    yield Face(low, u, v, Z, "floor")
    yield Face(low + w, u, v, -Z, "ceiling")
    yield Face(low, u, w, Y, "wall", room.doors.get("S", ()))
    yield Face(low + v, u, w, -Y, "wall", room.doors.get("N", ()))
    yield Face(low, v, w, X, "wall", room.doors.get("W", ()))
    yield Face(low + u, v, w, -X, "wall", room.doors.get("E", ()))


def _table(low: Vector, length: float) -> Iterator[Face]:
    yield Face(low + TABLE_TOP_M * Z, length * X, TABLE_M[1] * Y, Z, "table")
    yield from _legs(low, (length, TABLE_M[1]), TABLE_TOP_M, LEG_M)


def _chair(low: Vector) -> Iterator[Face]:
    seat = low + SEAT_M * Z
    yield Face(seat, CHAIR_M * X, CHAIR_M * Y, Z, "seat")
    yield Face(seat, CHAIR_M * X, BACK_M * Z, Y, "back")
    yield from _legs(low, (CHAIR_M, CHAIR_M), SEAT_M, LEG_M)


def _legs(low: Vector, size: tuple[float, float], height: float, side: float) -> Iterator[Face]:
    """Yield two sides of each of four legs."""
    for x in (0.0, size[0] - side):
        for y in (0.0, size[1] - side):
            foot = low + x * X + y * Y
            yield Face(foot, side * X, height * Z, -Y, "leg")
            yield Face(foot, side * Y, height * Z, -X, "leg")


def _patches(faces: list[Face], room: int) -> Patches:
    parts = [(i, *part) for i, face in enumerate(faces) for part in _parts(face)]
    surface = np.array([part[0] for part in parts], np.int64)
    return Patches(
        corners=np.array([part[1] for part in parts]),
        u=np.array([part[2] for part in parts]),
        v=np.array([part[3] for part in parts]),
        normals=np.array([faces[i].normal for i in surface]),
        centres=np.array([f.corner + (f.u + f.v) / 2 for f in (faces[i] for i in surface)]),
        surface=surface,
        rooms=np.full(len(parts), room, np.int64),
        roles=np.array([faces[i].role for i in surface]),
    )


def _parts(face: Face) -> Iterator[tuple[Vector, Vector, Vector]]:
    """Yield corner and edges of the rectangles a face is cut into by its doors."""
    length = float(np.linalg.norm(face.u))
    along, up = face.u / length, face.v / np.linalg.norm(face.v)
    position = 0.0
    for start, stop in sorted(face.doors):
        yield face.corner + position * along, (start - position) * along, face.v
        lintel = face.corner + start * along + DOOR_HEAD_M * up
        yield lintel, (stop - start) * along, face.v - DOOR_HEAD_M * up
        position = stop
    yield face.corner + position * along, (length - position) * along, face.v
