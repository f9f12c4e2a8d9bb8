"""Windows of a storey are alike: where furniture hides a side of one, the others tell its place."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.doors.lines import Lines
from tasks.doors.rectangles import NO_LINES, Range, Rectangles, SizeParams, window_rectangles

BIN_M = 0.05
"""Sizes this near are the same: a pixel to either side."""


@dataclass(frozen=True)
class Usual:
    """The window a storey has most of, metres."""

    width_m: float
    sill_m: float
    """over the wall's foot"""
    head_m: float
    """over the wall's foot"""


def usual_window(faces: Sequence[tuple[Lines, Lines]], params: SizeParams) -> Usual | None:
    """Return the window most outer faces have; None if no rectangle of theirs may be one.

    Parameters
    ----------
    faces : upright and level lines of each face that no room lies behind
    """
    levels = [level for _, level in faces]
    sill = _usual(levels, params.window_sill_m)
    head = _usual(levels, params.window_head_m)
    if sill is None or head is None or head - sill < params.window_height_m:
        return None
    widths = [NO_LINES]
    for uprights, level in faces:
        some = window_rectangles(uprights, level, np.inf, params)
        near = (np.abs(some[:, 2] - sill) <= BIN_M) & (np.abs(some[:, 3] - head) <= BIN_M)
        widths.append(some[near])
    found = np.concatenate(widths)
    width = _peak(found[:, 1] - found[:, 0], np.ones(len(found)))
    return None if width is None else Usual(width, sill, head)


def like_usual(
    usual: Usual | None, uprights: Lines, width_m: float, height_m: float, params: SizeParams
) -> Rectangles:
    """Return rectangles between the usual sill and head: of two uprights, or one and a width.

    Parameters
    ----------
    width_m, height_m : of the face
    """
    if usual is None or usual.head_m > height_m:
        return NO_LINES
    beside = (uprights.begins < usual.head_m) & (uprights.ends > usual.sill_m)
    places = uprights.places[beside]
    begins = np.concatenate([places, places - usual.width_m])
    sides = np.column_stack([begins, begins + usual.width_m])
    sides = np.clip(sides[(sides[:, 0] >= -BIN_M) & (sides[:, 1] <= width_m + BIN_M)], 0, width_m)
    n = np.ones(len(sides))
    return np.column_stack([sides, n * usual.sill_m, n * usual.head_m])


def _usual(levels: Sequence[Lines], heights_m: Range) -> float | None:
    """Return the height within bounds at which most metres of level lines lie."""
    places = np.concatenate([np.empty(0), *(some.places for some in levels)])
    lengths = np.concatenate([np.empty(0), *(some.lengths for some in levels)])
    within = (places >= heights_m[0]) & (places <= heights_m[1])
    return _peak(places[within], lengths[within])


def _peak(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float | None:
    """Return the mean of the values about the most weight of any that lie within BIN_M."""
    if not len(values):
        return None
    near = np.abs(values[:, None] - values) <= BIN_M
    about = near[int(np.argmax(near @ weights))]
    return float(np.average(values[about], weights=weights[about]))
