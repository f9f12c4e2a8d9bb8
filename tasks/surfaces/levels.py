"""Floor and ceiling of a storey (Sec. 4.1, Eq. 6 and 7)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from storage.segments import Segments
from tasks.surfaces.label_params import LabelParams

LEVEL_STEP = 0.1
"""Horizontal segments closer than this are of one level, metres."""
MIXED = 1.0
"""How far below the highest ceiling a storey's other ceilings may lie, metres."""


@dataclass(frozen=True)
class Levels:
    """Heights of a storey's floor and ceiling, metres; None where not seen."""

    floor: float | None
    ceiling: float | None
    low_ceiling: float | None
    """the height nine tenths of the ceiling lie above"""


def find_levels(scans: list[Segments], params: LabelParams) -> Levels:
    """Find floor and ceiling: the lowest and highest level of room extent (Eq. 6, 7).

    Where no two levels are a room's height apart one of the two was not seen. Which, is told by
    the side of the largest level that the walls lie on.
    """
    heights, areas = _horizontals(scans)
    if not len(heights):
        return Levels(None, None, None)
    large = _large_levels(heights, areas, params)
    floor, ceiling = float(large.min()), float(large.max())
    if ceiling - floor < params.headroom_m:
        largest = float(large[0])
        if _walls_stand_on(scans, largest):
            return Levels(floor, None, None)  # the tops of tables may be larger
        return Levels(None, largest, largest)  # what lies near it are suspended parts of it
    above = heights > floor + params.headroom_m
    order = np.argsort(heights[above])
    share = np.cumsum(areas[above][order]) / areas[above].sum()
    low = float(heights[above][order][np.searchsorted(share, 0.1)])
    return Levels(floor, ceiling, low)


def _horizontals(scans: list[Segments]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    heights, areas = [], []
    for scan in scans:
        flat = scan.of_kind("horizontal")
        heights.append(scan.heights[flat].mean(axis=1))
        areas.append(scan.areas[flat])
    return np.concatenate([*heights, np.empty(0)]), np.concatenate([*areas, np.empty(0)])


def _large_levels(
    heights: NDArray[np.float64], areas: NDArray[np.float64], params: LabelParams
) -> NDArray[np.float64]:
    """Return the mean heights of the levels of room extent, largest first; one at least.

    Levels are taken largest first, each with what lies within a step of it: chains of tops and
    shelves would lead from the floor to the ceiling.
    """
    left, levels, extents = areas.astype(float).copy(), [], []
    while left.max() > 0:
        near = np.abs(heights[:, None] - heights) <= LEVEL_STEP
        best = int((near @ left).argmax())
        members = near[best]
        extents.append(left[members].sum())
        levels.append(float(np.average(heights[members], weights=left[members])))
        left[members] = 0
        if extents[-1] < params.room_extent_m2:
            break
    enough = max(params.room_extent_m2, params.room_extent_share * extents[0])
    large = np.array(extents) >= min(enough, extents[0])
    return np.array(levels)[large]


def _walls_stand_on(scans: list[Segments], level: float) -> bool:
    above = below = 0.0
    for scan in scans:
        walls = scan.of_kind("vertical")
        middle = scan.heights[walls].mean(axis=1)
        above += scan.areas[walls][middle > level].sum()
        below += scan.areas[walls][middle <= level].sum()
    return above >= below


def role_of(height: float, levels: Levels, params: LabelParams) -> str | None:
    """Return whether a horizontal segment is floor, ceiling or stands within; None for neither."""
    step = 3 * LEVEL_STEP
    if levels.ceiling is not None and height > levels.ceiling + step:
        return None
    if levels.floor is None:  # no floor to stand on: what lies within a storey's mixed ceilings
        over = levels.ceiling is not None and height > levels.ceiling - MIXED
        return "ceiling" if over else None
    if height < levels.floor + step:
        return "floor" if height > levels.floor - step else None
    over = levels.ceiling is not None and height >= levels.floor + params.headroom_m
    return "ceiling" if over else "within"
