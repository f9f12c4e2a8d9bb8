"""An initial model laid out as arrays that reference lines can be asked against."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.faces import Faces
from storage.rooms import Rooms
from storage.segments import Segments
from tasks.layout.placement.outline import edges_of


@dataclass(frozen=True, eq=False)
class LineFrame:
    """Coordinates (along, left) of a line: metres from its start, metres to the left of it."""

    start: NDArray[np.float64]
    """(2,), building frame"""
    along: NDArray[np.float64]
    """(2,), unit"""
    length: float

    @classmethod
    def between(cls, start: NDArray[np.float64], end: NDArray[np.float64]) -> "LineFrame":
        """Return the frame of the line from one point to another."""
        length = float(np.linalg.norm(end - start))
        return cls(start, (end - start) / length, length)

    @property
    def left(self) -> NDArray[np.float64]:
        """(2,), unit."""
        return np.array([-self.along[1], self.along[0]])

    def local(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (along, left) of (..., 2) points."""
        off = points - self.start
        return np.stack([off @ self.along, off @ self.left], axis=-1)

    def building(self, local: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the building coordinates of (..., 2) local ones."""
        return self.start + local[..., :1] * self.along + local[..., 1:] * self.left


@dataclass(frozen=True, eq=False)
class Strips:
    """k upright strips of wall, of one scan each, in plan."""

    lines: NDArray[np.float64]
    """(k, 2, 2)"""
    normals: NDArray[np.float64]
    """(k, 2), towards where the sensor was"""
    areas: NDArray[np.float64]
    """(k,), square metres"""
    scans: NDArray[np.int64]
    """(k,), scan by its place in the storey's list"""


@dataclass(frozen=True, eq=False)
class Model:
    """The initial model of a storey; edges are those of the rooms' outlines, inside left."""

    rooms: Rooms
    edges: NDArray[np.float64]
    """(e, 2, 2)"""
    owners: NDArray[np.int64]
    """(e,), room of each edge"""
    faces: Faces
    strips: Strips
    height_m: float
    """usual height of a room"""
    tree: shapely.STRtree
    """of the rooms' polygons"""

    def room_at(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the room each of (..., 2) points lies in, -1 for none."""
        flat = points.reshape(-1, 2)
        found = np.full(len(flat), -1, np.int64)
        which, room = self.tree.query(shapely.points(flat), "intersects")
        found[which] = room
        return found.reshape(points.shape[:-1])


TALL_M, LONG_M = 1.0, 0.7
"""A segment lower or shorter than this does not tell where a wall stands, metres. Assumption."""
HEIGHT_M = 2.6
"""Height of rooms where neither floor nor ceiling was seen, metres. Assumption."""


def lay_out(rooms: Rooms, faces: Faces, segments: Sequence[Segments]) -> Model:
    """Return the model of the stored tables; segments one table per scan, or none at all."""
    outline = edges_of(list(rooms.polygons))
    heights = rooms.ceiling_m - rooms.floor_m
    known = heights[np.isfinite(heights)]
    return Model(
        rooms=rooms,
        edges=outline.ends,
        owners=outline.shape,
        faces=faces,
        strips=strips_of(segments),
        height_m=float(np.median(known)) if len(known) else HEIGHT_M,
        tree=shapely.STRtree(rooms.polygons),
    )


def strips_of(segments: Sequence[Segments]) -> Strips:
    """Return the strips of wall that tell where it stands, scan by scan."""
    lines, normals = [np.empty((0, 2, 2))], [np.empty((0, 2))]
    areas, scans = [np.empty(0)], [np.empty(0, np.int64)]
    for number, scan in enumerate(segments):
        lengths = np.linalg.norm(scan.lines[:, 1] - scan.lines[:, 0], axis=1)
        tall = scan.heights[:, 1] - scan.heights[:, 0] >= TALL_M
        upright = np.isin(np.arange(len(scan)), scan.of_kind("vertical"))
        keep = np.flatnonzero(upright & scan.side_known & tall & (lengths >= LONG_M))
        lines.append(scan.lines[keep])
        normals.append(scan.normals[keep, :2])
        areas.append(scan.areas[keep])
        scans.append(np.full(len(keep), number, np.int64))
    return Strips(
        np.concatenate(lines), np.concatenate(normals), np.concatenate(areas), np.concatenate(scans)
    )
