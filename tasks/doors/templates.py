"""Doors of standard size that no edge tells: a shut leaf all but flush with its wall.

On the side it opens to, a leaf lies a centimetre or two behind wall and frame: less than the noise
of a pixel, so there is no edge. Over a door's whole area the mean is known to some millimetres.
Boxes of the standard sizes slide along the wall's floor line; one that lies behind what is left of
it, right of it and over it is a candidate.
"""

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat, PositiveInt

from tasks.params import Params

Array = NDArray[np.float64]


class TemplateParams(Params):
    """What box is a candidate. Not in the paper."""

    step_m: PositiveFloat = 0.006
    """Least mean depth of a box behind each strip around it, metres: half of a frame and recess
    of 1 cm each. Assumption."""
    reach_m: PositiveFloat = 0.06
    """Depths beyond this, metres, count as this, so that no pixel decides. Assumption."""
    strip_m: PositiveFloat = 0.2
    """Width of the strips, metres. Assumption."""
    seen: PositiveFloat = 0.3
    """Share of the pixels of a box or strip that has to be seen. Assumption."""
    most: PositiveInt = 3
    """Boxes of each size kept per face, the deepest first. Assumption."""
    apart_m: PositiveFloat = 0.3
    """Boxes of one size nearer than this are one, metres. Assumption."""


def template_rectangles(
    depth: NDArray[np.float32],
    pixel_m: float,
    widths_m: tuple[float, ...],
    heads_m: tuple[float, ...],
    params: TemplateParams,
) -> Array:
    """Return boxes on a face's foot that lie behind what is around them.

    Parameters
    ----------
    depth : (a, b) float
        Metres behind the wall around, NaN not seen.
    widths_m, heads_m : standard sizes

    Returns
    -------
    (n, 4) float
        Begin and end along the face, lower and upper side over its foot, metres.
    """
    near = np.clip(depth.astype(np.float64), -params.reach_m, params.reach_m)
    sums, counts = _integral(np.nan_to_num(near)), _integral(~np.isnan(depth))
    strip, found = max(round(params.strip_m / pixel_m), 1), [np.empty((0, 4))]
    for width in widths_m:
        for head in heads_m:
            wide, high = round(width / pixel_m), round(head / pixel_m)
            if wide >= len(depth) or high >= depth.shape[1]:
                continue
            steps = _steps(sums, counts, wide, high, strip, params.seen)
            starts = _deepest(steps, params, round(params.apart_m / pixel_m)) * pixel_m
            ones = np.ones(len(starts))
            found.append(np.column_stack([starts, starts + width, 0 * ones, head * ones]))
    return np.concatenate(found)


def _steps(sums: Array, counts: Array, wide: int, high: int, strip: int, seen: float) -> Array:
    """Return by how much a box at each column lies behind the least deep strip around, (m,)."""
    a, b = sums.shape[0] - 1, sums.shape[1] - 1
    start = np.arange(a - wide + 1)
    stop = start + wide
    low = 1  # floor points blur the lowest row

    def mean(i0: NDArray[np.int64], i1: NDArray[np.int64], j0: int, j1: int) -> Array:
        i0, i1, j1 = np.clip(i0, 0, a), np.clip(i1, 0, a), min(j1, b)
        n = _box(counts, i0, i1, j0, j1)
        enough = n >= np.maximum(seen * (i1 - i0) * (j1 - j0), 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(enough, _box(sums, i0, i1, j0, j1) / n, np.nan)

    around = np.stack(
        [
            mean(start - strip, start, low, high),
            mean(stop, stop + strip, low, high),
            mean(start, stop, high, high + strip),
        ]
    )
    step = mean(start, stop, low, high) - around
    known = (~np.isnan(step)).sum(axis=0)
    least = np.where(np.isnan(step), np.inf, step).min(axis=0)
    return np.where(known >= 2, least, -np.inf)


def _deepest(steps: Array, params: TemplateParams, apart: int) -> NDArray[np.int64]:
    kept: list[int] = []
    for i in np.argsort(-steps, kind="stable"):
        if steps[i] < params.step_m or len(kept) == params.most:
            break
        if all(abs(i - j) >= apart for j in kept):
            kept.append(int(i))
    return np.array(kept, np.int64)


def _integral(image: NDArray[np.float64] | NDArray[np.bool_]) -> Array:
    sums = np.zeros((image.shape[0] + 1, image.shape[1] + 1))
    np.cumsum(np.cumsum(image, axis=0, dtype=float), axis=1, out=sums[1:, 1:])
    return sums


def _box(sums: Array, i0: NDArray[np.int64], i1: NDArray[np.int64], j0: int, j1: int) -> Array:
    return sums[i1, j1] - sums[i0, j1] - sums[i1, j0] + sums[i0, j0]
