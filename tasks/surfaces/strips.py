"""Wall segments of one scan: which vertical segments are walls, and where their rooms lie."""

from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.faces import NOT_SEEN, SEEN_LOW, SEEN_OVER, SEEN_WALL
from storage.segments import Segments
from tasks.surfaces.label_params import LabelParams
from tasks.surfaces.levels import Levels
from tasks.surfaces.seen import CellSet, Seen, steps, through

THINNEST, THICKEST = 0.04, 0.35
"""Thickness of a wall between two rooms, metres."""
CEILING_RUNS_ON = 0.3
"""Share of a segment on both sides of which the ceiling is seen, from which it is no wall."""
BESIDE = 0.6
"""Depth of the strip before a face in which floor or ceiling tell of a room, metres."""


@dataclass(frozen=True, eq=False)
class Strip:
    """One wall segment, ready to be merged."""

    scan: int
    normal: NDArray[np.float64]
    offset: float
    side: int
    line: NDArray[np.float64]
    heights: NDArray[np.float64]
    area: float
    profile: NDArray[np.uint8]


def candidates(
    scan: Segments, levels: Levels, seen: Seen, number: int, params: LabelParams
) -> list[Strip]:
    """Return the vertical segments of one scan that are walls by their height."""
    strips = []
    for i in scan.of_kind("vertical"):
        hidden = not _reaches_ceiling(scan.heights[i, 1], levels, params)
        if hidden and not _may_go_on(scan, int(i), levels, seen, params):
            continue
        normal, offset, line = scan.normals[i], scan.offsets[i], scan.lines[i]
        side = 1 if scan.side_known[i] else side_of(line, normal[:2], seen.either)
        if side < 0:
            normal, offset, side = -normal, -offset, 1
        strips.append(
            Strip(
                scan=number,
                normal=normal,
                offset=float(offset),
                side=side,
                line=line,
                heights=scan.heights[i],
                area=float(scan.areas[i]),
                profile=_profile(scan, int(i), hidden, levels, seen, params),
            )
        )
    return strips


def _reaches_ceiling(top: float, levels: Levels, params: LabelParams) -> bool:
    if levels.low_ceiling is not None:
        return bool(top >= levels.low_ceiling - params.below_ceiling_m)
    return levels.floor is None or bool(top >= levels.floor + params.wall_height_m)


def _may_go_on(scan: Segments, i: int, levels: Levels, seen: Seen, params: LabelParams) -> bool:
    """Whether a segment that ends below the ceiling may be a wall whose top was not seen.

    Seen through a door, a room's walls end at the lintel's shadow. Over a partition or a cupboard
    the ceiling runs on; a wall interrupts it.
    """
    if levels.floor is not None and scan.heights[i, 1] < levels.floor + params.wall_height_m:
        return False
    return _share_through(scan.lines[i], scan.normals[i, :2], seen.ceiling) < CEILING_RUNS_ON


def _profile(
    scan: Segments, i: int, hidden: bool, levels: Levels, seen: Seen, params: LabelParams
) -> NDArray[np.uint8]:
    """Return per bin along the segment what was seen there."""
    raster = scan.rasters[i]
    tops = raster.start[1] + scan.cell_m * (np.arange(raster.cells.shape[1]) + 1)
    lintel = _lintel(levels, params)
    low = np.any(raster.cells[:, tops <= lintel], axis=1)
    high = np.any(raster.cells[:, tops > lintel], axis=1)
    if hidden:  # no top to tell by
        return np.where(low | high, SEEN_WALL, NOT_SEEN).astype(np.uint8)
    length = length_of(scan.lines[i])
    shares = np.clip((np.arange(len(low)) + 0.5) * scan.cell_m / max(length, 1e-9), 0, 1)
    beneath = through(scan.lines[i], scan.normals[i, :2], shares, seen.floor)
    profile = np.full(len(low), NOT_SEEN, np.uint8)
    profile[low] = SEEN_LOW
    profile[high] = SEEN_WALL
    profile[high & ~low & beneath] = SEEN_OVER
    return profile


def _lintel(levels: Levels, params: LabelParams) -> float:
    """Return the height above which a wall closes its doors too."""
    if levels.low_ceiling is None:
        return -np.inf if levels.floor is None else levels.floor + params.wall_height_m
    below = levels.low_ceiling - params.below_ceiling_m
    return below if levels.floor is None else min(below, levels.floor + params.lintel_m)


def _share_through(line: NDArray[np.float64], normal: NDArray[np.float64], seen: CellSet) -> float:
    """Return the share of a line on both sides of which the cells were seen."""
    return float(through(line, normal, steps(line, seen.cell), seen).mean())


def side_of(line: NDArray[np.float64], normal: NDArray[np.float64], seen: CellSet) -> int:
    """Return 1 if a room lies before the face, -1 if behind it, 0 if on both sides or neither."""
    length = np.linalg.norm(line[1] - line[0])
    t = np.linspace(0.02, 0.98, max(3, int(length / seen.cell)))
    along = line[0] + t[:, None] * (line[1] - line[0])
    depth = np.arange(1.5 * seen.cell, BESIDE, seen.cell)
    flat = normal / np.linalg.norm(normal)
    before = seen.holds(along[:, None] + depth[:, None] * flat).mean()
    behind = seen.holds(along[:, None] - depth[:, None] * flat).mean()
    if max(before, behind) < 0.1 or min(before, behind) > 0.5 * max(before, behind):
        return 0
    return 1 if before > behind else -1


def turn_two_faced(strips: list[Strip]) -> list[Strip]:
    """Turn the two faces of a thin wall apart.

    Floor and ceiling are seen on either side of both; but a wall has no room between its faces.
    """
    if not strips:
        return strips
    lines = np.array([s.line for s in strips])
    tree = shapely.STRtree(shapely.linestrings(lines))
    turned = []
    for strip in strips:
        if strip.side:
            turned.append(strip)
            continue
        near = tree.query(shapely.linestrings(strip.line), "dwithin", THICKEST)
        votes = sum(_twin(strip, strips[j]) for j in near)
        if votes == 0:
            turned.append(strip)
        elif votes > 0:  # the other face lies before this one: the room is behind
            turned.append(replace(strip, normal=-strip.normal, offset=-strip.offset, side=1))
        else:
            turned.append(replace(strip, side=1))
    return turned


def _twin(strip: Strip, other: Strip) -> float:
    """Return by how many metres `other` accompanies the strip: positive before it, else behind."""
    if np.linalg.norm(np.cross(strip.normal, other.normal)) > 0.09:  # five degrees
        return 0.0
    away = away_from(other.line, strip).mean()
    if not THINNEST <= abs(away) <= THICKEST:
        return 0.0
    length = length_of(strip.line)
    along = (strip.line[1] - strip.line[0]) / max(length, 1e-9)
    a, b = np.sort((other.line - strip.line[0]) @ along)
    return float(np.sign(away) * max(0.0, min(b, length) - max(a, 0.0)))


def length_of(line: NDArray[np.float64]) -> float:
    """Return the length of a plan line, metres."""
    return float(np.linalg.norm(line[1] - line[0]))


def away_from(points: NDArray[np.float64], strip: Strip) -> NDArray[np.float64]:
    """Return the signed distances of plan points from a strip's line."""
    flat = strip.normal[:2] / np.linalg.norm(strip.normal[:2])
    return (points - strip.line[0]) @ flat
