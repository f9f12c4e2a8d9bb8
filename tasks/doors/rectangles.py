"""Rectangles of two upright and two level lines, of a door's or a window's size (Sec. 5).

The paper makes a rectangle of every two upright and two level lines. Here an upright line meets
only those within a door's or a window's width of it, and a pair of them the few level lines that
run across it: as many rectangles as lines, times a number the sizes bound.
"""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, PositiveInt

from tasks.doors.lines import Lines
from tasks.params import Params

Rectangles = NDArray[np.float64]
"""(n, 4), metres: begin and end along the face, lower and upper side over its foot"""
Range = tuple[Annotated[float, Field(ge=0)], PositiveFloat]
NO_LINES = np.empty((0, 4))


class SizeParams(Params):
    """Standard sizes. Heights are over the wall's foot."""

    door_widths_m: tuple[PositiveFloat, ...] = (0.811, 0.936, 1.061)
    """Clear widths of doors in steel frames, metres: DIN 18101 and DIN 18111. Where one side of a
    door shows no line, one of these says where it is."""
    door_width_m: Range = (0.55, 1.4)
    """Least and greatest distance of the lines of a door's two sides, metres: a leaf ajar hides
    one side. Assumption."""
    door_heads_m: tuple[PositiveFloat, ...] = (1.97,)
    """Clear heights of doors, metres: DIN 18101's wall opening of 2000 mm less 32 mm of frame."""
    door_head_m: Range = (1.8, 2.4)
    """Heights a line over a door may have, metres. Assumption."""
    door_foot_m: PositiveFloat = 1.0
    """A door's sides begin lower than this, metres: furniture may stand before their foot.
    Assumption."""
    door_top_m: PositiveFloat = 1.4
    """A door's sides end higher than this, metres. Assumption."""
    window_width_m: Range = (0.5, 3.2)
    """Least and greatest width of a window, metres. Assumption."""
    window_sill_m: Range = (0.3, 1.6)
    """Heights of a window's sill, metres. Assumption."""
    window_head_m: Range = (1.5, 3.0)
    """Heights of a window's head, metres. Assumption."""
    window_height_m: PositiveFloat = 0.5
    """Least height of a window, metres; smaller boxes are left out (Sec. 5). Assumption."""
    across: float = Field(default=0.4, gt=0, le=1)
    """Share of a width that a level line has to run across to bound it. Assumption."""
    most_level: PositiveInt = 2
    """Level lines taken as one side of a pair of uprights, the longest first. Assumption."""


def door_rectangles(
    uprights: Lines, levels: Lines, width_m: float, params: SizeParams
) -> Rectangles:
    """Return rectangles that stand on a face's foot and may be doors.

    Parameters
    ----------
    width_m : float
        Of the face.
    """
    is_side = (uprights.begins <= params.door_foot_m) & (uprights.ends >= params.door_top_m)
    places = uprights.places[is_side]
    left, right = _pairs(places, *params.door_width_m)
    standard = np.array(params.door_widths_m)
    sides = np.concatenate(
        [
            np.column_stack([places[left], places[right]]),
            _spans(places, standard),
            _spans(places, -standard)[:, ::-1],
        ]
    )
    sides = sides[(sides[:, 0] >= 0) & (sides[:, 1] <= width_m)]
    known = _across(sides, levels, params.door_head_m, params)
    rows = np.repeat(np.arange(len(sides)), len(params.door_heads_m))
    heads = np.tile(np.array(params.door_heads_m), len(sides))
    rows, heads = np.concatenate([rows, known[0]]), np.concatenate([heads, known[1]])
    return np.column_stack([sides[rows], np.zeros(len(rows)), heads])


def window_rectangles(
    uprights: Lines, levels: Lines, height_m: float, params: SizeParams
) -> Rectangles:
    """Return rectangles between a sill and a head that may be windows.

    Parameters
    ----------
    height_m : float
        Of the face.
    """
    left, right = _pairs(uprights.places, *params.window_width_m)
    low = np.maximum(uprights.begins[left], uprights.begins[right])
    high = np.minimum(uprights.ends[left], uprights.ends[right])
    side_by_side = low < high
    left, right = left[side_by_side], right[side_by_side]
    low, high = low[side_by_side], high[side_by_side]
    sides = np.column_stack([uprights.places[left], uprights.places[right]])
    sills = _across(sides, levels, params.window_sill_m, params)
    heads = _across(sides, levels, params.window_head_m, params)
    # where no level line bounds them, the uprights' own common extent does
    every = np.arange(len(sides))
    sill_of = [np.concatenate(some) for some in zip(sills, (every, low), strict=True)]
    head_of = [np.concatenate(some) for some in zip(heads, (every, high), strict=True)]
    rows, sill, head = _combined(sill_of, head_of, len(sides))
    fits = (
        (head - sill >= params.window_height_m)
        & _within(sill, params.window_sill_m)
        & _within(head, params.window_head_m)
        & (head <= height_m)
    )
    return np.column_stack([sides[rows], sill, head])[fits]


def _pairs(
    places: NDArray[np.float64], least: float, most: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the pairs of ascending places at a distance within bounds."""
    begin = np.searchsorted(places, places + least)
    counts = np.searchsorted(places, places + most, side="right") - begin
    left = np.repeat(np.arange(len(places)), counts)
    step = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return left, begin[left] + step


def _spans(places: NDArray[np.float64], widths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return every place with every place a width further on."""
    begin = np.repeat(places, len(widths))
    return np.column_stack([begin, begin + np.tile(widths, len(places))])


def _across(
    sides: NDArray[np.float64], levels: Lines, heights_m: Range, params: SizeParams
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return rows of `sides` and heights of the longest level lines that run across them."""
    at = np.flatnonzero(_within(levels.places, heights_m))
    begin = np.maximum(sides[:, :1], levels.begins[at])
    end = np.minimum(sides[:, 1:], levels.ends[at])
    shared = np.maximum(end - begin, 0)
    runs = shared >= params.across * (sides[:, 1:] - sides[:, :1])
    order = np.argsort(-np.where(runs, shared, 0), axis=1, kind="stable")[:, : params.most_level]
    taken = np.take_along_axis(runs, order, axis=1)
    rows = np.nonzero(taken)[0]
    return rows, levels.places[at][order[taken]]


def _combined(
    sills: list[NDArray[np.float64]], heads: list[NDArray[np.float64]], n: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return every sill with every head of the same row."""
    s, h = np.argsort(sills[0], kind="stable"), np.argsort(heads[0], kind="stable")
    per_row = np.bincount(heads[0].astype(np.int64), minlength=n)
    first = np.cumsum(per_row) - per_row
    rows = sills[0][s].astype(np.int64)
    counts = per_row[rows]
    step = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return (
        np.repeat(rows, counts),
        np.repeat(sills[1][s], counts),
        heads[1][h][np.repeat(first[rows], counts) + step],
    )


def _within(values: NDArray[np.float64], bounds: Range) -> NDArray[np.bool_]:
    return (values >= bounds[0]) & (values <= bounds[1])
