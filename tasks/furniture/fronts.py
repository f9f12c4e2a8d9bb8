"""Tall pieces before walls, known by their fronts: nobody sees their tops (Sec. 6's *other*)."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import PositiveFloat

from tasks.furniture.boxes import Box
from tasks.furniture.candidates import FRONT, Candidate
from tasks.furniture.dimensions import widths_m
from tasks.furniture.scene import Scene
from tasks.furniture.splitting import RunParams, pieces, split_run
from tasks.params import Params

TOP_SHARE = 0.7
"""Quantile of its columns' tops that is a front's: higher ones are noise, lower ones half seen."""
BEHIND_M = 0.02
"""Gap between a wall and what stands before it, metres. Assumption."""
GAP_M = 0.14
"""Greatest gap in a front, and between its end and the corner of the room it is moved to."""


BELOW, HELD = 10, 3
"""Slices down from an upper edge, and how many of them must hold points: else it is a stray."""


class FrontParams(Params):
    """What may be the front of a tall piece. Assumptions; the paper has none."""

    near_m: PositiveFloat = 0.16
    """Least distance of a front from the wall, metres: noise and drift of the wall's own points."""
    far_m: PositiveFloat = 0.72
    """Greatest, metres: the deepest cabinets and cupboards (0.6) and drift."""
    low_m: PositiveFloat = 0.2
    """Height from which points count, metres: what is lower is hidden, or the floor's."""
    least_top_m: PositiveFloat = 0.95
    """Least height of the upper edge, metres: the tops of lower pieces are seen."""
    ceiling_m: PositiveFloat = 2.2
    """Height over which whatever goes on is a wall or a column of the building, metres."""
    filled: PositiveFloat = 0.2
    """Least share of slices up to the edge that hold points: open shelves show little else."""
    step_m: PositiveFloat = 0.09
    """Greatest step of one front from column to column, outwards, metres."""
    rise_m: PositiveFloat = 0.14
    """Greatest difference of its columns' tops, metres: farther apart, they are two pieces."""
    width_m: PositiveFloat = 0.28
    """Least width, metres."""


class _Columns(NamedTuple):
    """Columns that may belong to fronts."""

    xy: NDArray[np.float64]
    held: NDArray[np.int64]
    """slices that hold points"""
    top: NDArray[np.float64]
    """height of the highest that is no stray, metres"""


def find_fronts(scene: Scene, params: FrontParams, runs: RunParams) -> Iterator[Candidate]:
    """Yield the tall pieces that stand with their backs to a wall of the room."""
    columns = _tall(scene, params)
    if not len(columns.xy):
        return
    polygon = shapely.orient_polygons(scene.polygon)
    for ring in (polygon.exterior, *polygon.interiors):
        corners = shapely.get_coordinates(ring)
        for i in range(len(corners) - 1):
            yield from _along(scene, corners[i], corners[i + 1], columns, params, runs)


def _tall(scene: Scene, params: FrontParams) -> _Columns:
    """Return the columns well before a wall that hold points high up, and none at the ceiling."""
    cell = scene.columns.cell_m
    places = np.flatnonzero((scene.from_wall > 2 * cell) & (scene.from_wall < params.far_m))
    if not len(places):
        return _Columns(np.empty((0, 2)), np.empty(0, np.int64), np.empty(0))
    counts = scene.slices(places, params.low_m, params.ceiling_m) > 0
    over = scene.slices(places, params.ceiling_m, np.inf) > 0
    # a stray point has nothing right below
    close = np.cumsum(counts, axis=1)
    earlier = np.zeros_like(close)
    earlier[:, BELOW:] = close[:, :-BELOW]
    firm = counts & (close - earlier >= HELD)
    top_slice = counts.shape[1] - 1 - np.argmax(firm[:, ::-1], axis=1)
    first = scene.columns.slice_of(params.low_m)
    top = scene.columns.height_of((first + top_slice).astype(float))
    held = counts.sum(axis=1)
    kept = firm.any(axis=1) & (over.sum(axis=1) <= 1) & (top >= params.least_top_m - params.rise_m)
    return _Columns(scene.xy[places[kept]], held[kept], top[kept])


def _along(
    scene: Scene,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    columns: _Columns,
    params: FrontParams,
    runs: RunParams,
) -> Iterator[Candidate]:
    """Yield the pieces before one edge of the room, its inside to the left."""
    cell = scene.columns.cell_m
    length = float(np.linalg.norm(end - start))
    if length < params.width_m:
        return
    axis = (end - start) / length
    into = np.array((-axis[1], axis[0]))
    along, out = (columns.xy - start) @ axis, (columns.xy - start) @ into
    near = (along > 0) & (along < length) & (out > params.near_m) & (out < params.far_m)
    if not near.any():
        return
    u = (along[near] / cell).astype(np.int64)
    v = (out[near] / cell).astype(np.int64)
    shape = int(u.max()) + 1, int(params.far_m / cell) + 2
    held, tops = np.zeros(shape), np.zeros(shape)
    np.add.at(held, (u, v), columns.held[near])
    np.maximum.at(tops, (u, v), columns.top[near])
    # noise spreads a front over two rows of columns
    two = held + np.pad(held, ((0, 0), (0, 1)))[:, 1:]
    best = np.argmax(two, axis=1)
    at = np.arange(len(two))
    top = np.maximum(tops[at, best], tops[at, np.minimum(best + 1, shape[1] - 1)])
    slices = (top - params.low_m) / scene.columns.slice_m
    is_front = (two.max(axis=1) >= params.filled * np.maximum(slices, 1)) & (top > 0)
    for run in _runs(np.flatnonzero(is_front), best * cell, top, cell, params):
        height = float(np.quantile(top[run], TOP_SHARE))
        width = (run[-1] - run[0] + 1) * cell
        if height < params.least_top_m or width < params.width_m:
            continue
        low, high = run[0] * cell, (run[-1] + 1) * cell
        low, high = (0.0 if low < GAP_M else low), (length if length - high < GAP_M else high)
        depth = float(np.median(best[run])) * cell + cell
        middle = start + (low + high) / 2 * axis + (depth + BEHIND_M) / 2 * into
        box = Box(middle, axis, high - low, depth - BEHIND_M)
        share = float(
            two.max(axis=1)[run].mean() / max((height - params.low_m) / scene.columns.slice_m, 1)
        )
        panel = (width, float(np.ptp(np.quantile(best[run], (0.1, 0.9))) * cell), min(share, 1.0))
        n = split_run(box.length, widths_m(depth), runs)
        for piece in pieces(box, (n, 1)):
            seen = scene.surfaces_in(piece, height - 0.08, height + 0.08)
            yield Candidate(piece, seen, height, height, FRONT, n, None, panel)


def _runs(
    at: NDArray[np.int64],
    out: NDArray[np.float64],
    top: NDArray[np.float64],
    cell: float,
    params: FrontParams,
) -> Iterator[NDArray[np.int64]]:
    """Yield the parts of an edge along which a front goes on: as far out, and as high."""
    run: list[int] = []
    for i in at:
        if run:
            last = run[-4:]
            goes_on = i - run[-1] <= GAP_M / cell
            goes_on &= abs(out[i] - np.median(out[last])) <= params.step_m
            goes_on &= abs(top[i] - np.median(top[last])) <= params.rise_m
            if not goes_on:
                # one column that differs is no end
                if i - run[-1] <= 2 and i + 1 in at:
                    continue
                yield np.array(run)
                run = []
        run.append(int(i))
    if run:
        yield np.array(run)
