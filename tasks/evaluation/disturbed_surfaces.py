"""Faces and walls of an initial model from which walls were taken, or to which some were added."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.faces import SEEN_WALL, Faces
from storage.rooms import Rooms
from storage.walls import Walls
from tasks.evaluation.neighbours import Strip
from tasks.evaluation.partitions import Partition

BESIDE_M = 0.05
"""What lies this near to a strip of wall is one of its faces, metres."""
ALONG_COS = float(np.cos(np.radians(20)))
"""Faces turned against a strip by more are of other walls."""
HEIGHT_M = 2.5
"""Height of a false partition where no room's and no face's is known, metres."""


def without_faces(faces: Faces, strips: Sequence[Strip]) -> Faces:
    """Return the faces but for where they bound some strips; one may fall into several."""
    whole, parts = [], []
    for i in range(len(faces)):
        on = _on_strips(faces, i, strips)
        if on.any():
            parts += [_part(faces, i, a, b) for a, b in _stretches(~on)]
        else:
            whole.append(i)
    # of what is left of some, nothing may have been seen
    parts = [part for part in parts if part.profiles[0].any()]
    return _joined([faces.take(whole), *parts])


def _on_strips(faces: Faces, i: int, strips: Sequence[Strip]) -> NDArray[np.bool_]:
    """Return which bins of a face bound a strip."""
    at, along = _bins(faces, i)
    middles = faces.lines[i, 0] + ((at[:-1] + at[1:]) / 2)[:, None] * along
    return _beside(middles, faces.normals[i, :2], strips)


def _bins(faces: Faces, i: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the bins of a face begin and end along it, metres, and its direction."""
    start, end = faces.lines[i]
    length = float(np.linalg.norm(end - start))
    at = np.minimum(np.arange(len(faces.profiles[i]) + 1) * faces.bin_m, length)
    return at, (end - start) / max(length, 1e-9)


def _stretches(kept: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return from which to before which bin some lie side by side."""
    steps = np.diff(np.concatenate([[False], kept, [False]]).astype(np.int8))
    return [(int(a), int(b)) for a, b in np.flatnonzero(steps).reshape(-1, 2)]


def _part(faces: Faces, i: int, first: int, end: int) -> Faces:
    """Return some bins of a face as a face."""
    at, along = _bins(faces, i)
    profile = faces.profiles[i]
    share = float((profile[first:end] > 0).sum()) / max(int((profile > 0).sum()), 1)
    line = faces.lines[i, 0] + at[[first, end]][:, None] * along
    return replace(
        faces.take([i]),
        lines=line[None],
        weights=faces.weights[[i]] * share,
        profiles=(profile[first:end],),
    )


def _joined(tables: Sequence[Faces]) -> Faces:
    """Return the faces of several tables; there is one at least."""
    return Faces(
        normals=np.concatenate([t.normals for t in tables]),
        offsets=np.concatenate([t.offsets for t in tables]),
        sides=np.concatenate([t.sides for t in tables]),
        lines=np.concatenate([t.lines for t in tables]),
        heights=np.concatenate([t.heights for t in tables]),
        weights=np.concatenate([t.weights for t in tables]),
        scans=np.concatenate([t.scans for t in tables]),
        profiles=tuple(p for t in tables for p in t.profiles),
        bin_m=tables[0].bin_m,
    )


def with_faces(faces: Faces, rooms: Rooms, cut: Mapping[int, Partition]) -> Faces:
    """Return the faces with the two of each false partition."""
    usual = np.median(faces.heights, axis=0) if len(faces) else np.array([0.0, HEIGHT_M])
    added = []
    for i, partition in cut.items():
        height = np.array([rooms.floor_m[i], rooms.ceiling_m[i]])
        height = np.where(np.isnan(height).any(), usual, height)
        scans = max(len(rooms.scans[i]), 1)
        before, behind = partition.faces
        added.append(_seen_all_over(before, -partition.along, height, scans, faces.bin_m))
        added.append(_seen_all_over(behind, partition.along, height, scans, faces.bin_m))
    return _joined([faces, *added])


def _seen_all_over(
    line: NDArray[np.float64],
    normal: NDArray[np.float64],
    height_m: NDArray[np.float64],
    scans: int,
    bin_m: float,
) -> Faces:
    """Return the face of a wall that scans saw as a whole from one side."""
    length = float(np.linalg.norm(line[1] - line[0]))
    return Faces(
        normals=np.append(normal, 0.0)[None],
        offsets=np.array([normal @ line[0]]),
        sides=np.ones(1, np.int8),
        lines=line[None],
        heights=height_m[None],
        weights=np.array([length * (height_m[1] - height_m[0])]),
        scans=np.array([scans], np.int64),
        profiles=(np.full(int(np.ceil(length / bin_m)), SEEN_WALL, np.uint8),),
        bin_m=bin_m,
    )


def without_walls(walls: Walls, strips: Sequence[Strip]) -> Walls:
    """Return the walls but for those within some strips."""
    steps = walls.lines[:, 1] - walls.lines[:, 0]
    normals = np.column_stack([steps[:, 1], -steps[:, 0]])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-9)[:, None]
    middles = walls.lines.mean(axis=1)
    on = [
        bool(_beside(point[None], normal, strips)[0])
        for point, normal in zip(middles, normals, strict=True)
    ]
    return _take(walls, np.flatnonzero(~np.array(on, bool)))


def with_walls(
    walls: Walls,
    rooms: Rooms,
    cut: Mapping[int, Partition],
    numbers: NDArray[np.int64],
    thickness_m: float,
) -> Walls:
    """Return the walls between the new rooms: of cut rooms each half has its own."""
    halves = np.zeros(walls.rooms.shape, np.int32)
    for i, partition in cut.items():
        walls, halves = _split(walls, halves, i, partition)
    known = walls.rooms >= 0
    walls = replace(
        walls, rooms=np.where(known, numbers[walls.rooms] + halves, -1).astype(np.int32)
    )
    for i, partition in cut.items():
        pair = np.array([numbers[i], numbers[i] + 1], np.int32)
        walls = Walls(
            lines=np.concatenate([walls.lines, np.mean(partition.faces, axis=0)[None]]),
            thickness_m=np.append(walls.thickness_m, thickness_m),
            base_m=np.append(walls.base_m, rooms.floor_m[i]),
            top_m=np.append(walls.top_m, rooms.ceiling_m[i]),
            rooms=np.vstack([walls.rooms, pair]),
            seen=np.append(walls.seen, 1.0),
        )
    return walls


def _split(
    walls: Walls, halves: NDArray[np.int32], room: int, partition: Partition
) -> tuple[Walls, NDArray[np.int32]]:
    """Return the walls, those of a room that run past its partition in two pieces."""
    at = walls.lines @ partition.along - partition.at
    own = (walls.rooms == room).any(axis=1)
    across = own & (at[:, 0] * at[:, 1] < 0)
    pieces = 1 + across
    twice = np.repeat(np.arange(len(walls)), pieces)
    second = np.ones(len(twice), bool)
    second[np.cumsum(pieces) - pieces] = False
    share = (at[:, 0] / np.where(across, at[:, 0] - at[:, 1], 1.0))[:, None]
    met = walls.lines[:, 0] + share * (walls.lines[:, 1] - walls.lines[:, 0])
    split, halves = _take(walls, twice), halves[twice].copy()
    lines = split.lines.copy()
    lines[across[twice] & ~second, 1] = met[across]
    lines[second, 0] = met[across]
    behind = (lines @ partition.along).mean(axis=1) > partition.at
    halves[(split.rooms == room) & behind[:, None]] = 1
    return replace(split, lines=lines), halves


def _take(walls: Walls, rows: NDArray[np.int64]) -> Walls:
    return Walls(
        walls.lines[rows],
        walls.thickness_m[rows],
        walls.base_m[rows],
        walls.top_m[rows],
        walls.rooms[rows],
        walls.seen[rows],
    )


def _beside(
    points: NDArray[np.float64], normal: NDArray[np.float64], strips: Sequence[Strip]
) -> NDArray[np.bool_]:
    """Return which points (n, 2) of something that looks along `normal` lie on some strips."""
    on = np.zeros(len(points), bool)
    for strip in strips:
        if abs(normal @ strip.normal) >= ALONG_COS:
            near = shapely.distance(strip.polygon, shapely.points(points)) <= BESIDE_M
            on |= near
    return on
