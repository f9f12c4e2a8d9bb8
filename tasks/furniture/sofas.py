"""Sofas: seats for several with a back and arms, one piece however many they seat."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat

from tasks.furniture.boxes import Box
from tasks.furniture.candidates import SOFA, Candidate
from tasks.furniture.scene import Scene
from tasks.furniture.tops import Top
from tasks.furniture.windows import quantile
from tasks.params import Params


class SofaParams(Params):
    """What may be a sofa. The paper has none. Assumptions unless a source is given."""

    seat_low_m: PositiveFloat = 0.33
    """Least height of the seat, metres: usual seats are 0.38 to 0.48 m high, sat down on less."""
    seat_high_m: PositiveFloat = 0.55
    """Greatest height of the seat, metres."""
    length_m: PositiveFloat = 1.0
    """Least length of the seat, metres: two people between the arms of a small sofa."""
    depth_m: PositiveFloat = 0.35
    """Least depth of the seat that is seen, metres."""
    deepest_m: PositiveFloat = 1.1
    """Greatest depth of the seat, metres."""
    rise_m: tuple[float, float] = (0.1, 0.65)
    """How far over the seat the edges of back and arms lie, metres."""
    out_m: PositiveFloat = 0.36
    """How far out from the seat back and arms reach at most, metres."""
    filled: PositiveFloat = 0.35
    """Least share of a row along a side that shows them. Assumption: far scans leave many empty."""


def find_sofas(scene: Scene, tops: list[Top], params: SofaParams) -> Iterator[Candidate]:
    """Yield the level patches at the height of seats that have a back or arms, with those."""
    for top in tops:
        level = params.seat_low_m <= top.height <= params.seat_high_m
        deep = params.depth_m <= top.box.depth <= params.deepest_m
        if not level or not deep or top.box.length < params.length_m:
            continue
        box, edges = _with_sides(scene, top, params)
        if len(edges):
            height = max(quantile(edges, 0.8), top.height + params.rise_m[0])
            yield Candidate(box, top.surfaces, top.height, height, SOFA, 1, top.box)


def _with_sides(scene: Scene, top: Top, params: SofaParams) -> tuple[Box, NDArray[np.float64]]:
    """Return the box of a seat with its back and arms, and the heights of their upper edges."""
    cell, box = scene.columns.cell_m, top.box
    around = scene.surfaces_in(
        box, top.height + params.rise_m[0], top.height + params.rise_m[1], params.out_m
    )
    local = box.local(scene.xy[scene.where[around]])
    half = np.array((box.length, box.depth)) / 2
    low, high = -half, half.copy()
    used = np.zeros(len(around), bool)
    # the back first: arms reach as far as it does
    for axis in (1, 0):
        for side in (-1, 1):
            out = side * local[:, axis] - half[axis]
            beside = (local[:, 1 - axis] >= low[1 - axis]) & (local[:, 1 - axis] <= high[1 - axis])
            beside &= out > -2 * cell
            row = np.floor(out[beside] / cell).astype(np.int64) + 2
            place = np.floor(local[beside, 1 - axis] / cell).astype(np.int64)
            rows = np.bincount(np.unique(np.column_stack((row, place)), axis=0)[:, 0])
            full = rows * cell >= params.filled * (high - low)[1 - axis]
            reach = _last(full)
            if reach < 0:
                continue
            grown = max((reach - 1) * cell, 0.0)
            (high if side > 0 else low)[axis] += side * grown
            used[np.flatnonzero(beside)[row <= reach]] = True
    return box.part(low, high).long(), scene.heights[around[used]]


def _last(full: NDArray[np.bool_]) -> int:
    """Return the last row of the first that are full, gaps of two allowed; -1 if none is."""
    last = -1
    for i in np.flatnonzero(full):
        if i - last > 3 + (last < 0):
            break
        last = int(i)
    return last
