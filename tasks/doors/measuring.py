"""What a face shows within a rectangle and around it, measured in one compiled pass."""

import numba
import numpy as np
from numpy.typing import NDArray

from storage.candidates import OF_A_FACE, SHARES
from storage.wall_images import EMPTY, OCCLUDED, OCCUPIED

OF_THE_WHOLE_FACE = ("wall_back_share", "noise_m")
MEASURED = (*SHARES, *(name for name in OF_A_FACE if name not in OF_THE_WHOLE_FACE))
"""What is measured of a rectangle, in the order of the columns of `measure`."""
FLUSH_M = 0.1
"""Depths beyond this, metres, count as this in a mean: wall, frame and leaf lie within."""
FOOT_M = 1.0
"""Height of what counts as the foot of a door, metres: below a window there is wall."""
LEAST_HITS = 8
"""Pixels below which a spread or a slope says nothing."""


@numba.njit(cache=True, nogil=True)
def measure(
    labels: NDArray[np.uint8],
    depth: NDArray[np.float32],
    upright: NDArray[np.uint8],
    level: NDArray[np.uint8],
    boxes: NDArray[np.int64],
    strip: int,
    frame: int,
    reach: int,
    back: float,
    pixel: float,
) -> NDArray[np.float64]:
    """Return what a face shows in each box, (n, len(MEASURED)), NaN where it shows nothing.

    Parameters
    ----------
    labels, depth, upright, level : (a, b)
        Of one face: labels, metres behind the wall around (NaN not seen), edges.
    boxes : (n, 4) int
        First and past-the-last column, first and past-the-last row; may reach past the image.
    strip, frame, reach : pixels of the strips around a box, of a frame, to look for an edge
    back : metres from which a surface lies behind the wall
    pixel : metres of a pixel
    """
    a, b = labels.shape
    found = np.full((len(boxes), len(MEASURED)), np.nan)
    foot = round(FOOT_M / pixel)
    hits = np.empty(a * b)
    for n in range(len(boxes)):
        i0, i1 = max(boxes[n, 0], 0), min(boxes[n, 1], a)
        j0, j1 = max(boxes[n, 2], 0), min(boxes[n, 3], b)
        if i1 <= i0 or j1 <= j0:
            continue
        occupied = empty = occluded = seen = behind = through = count = 0
        sum_x = sum_d = sum_xx = sum_xd = inside = 0.0
        for i in range(i0, i1):
            for j in range(j0, j1):
                label, d = labels[i, j], depth[i, j]
                occupied += label == OCCUPIED
                empty += label == EMPTY
                occluded += label == OCCLUDED
                if np.isnan(d):
                    continue
                seen += 1
                inside += min(max(d, -FLUSH_M), FLUSH_M)
                behind += d > back
                if label == EMPTY:
                    through += 1
                    continue
                hits[count] = d
                count += 1
                x = (i - i0) * pixel
                sum_x += x
                sum_d += d
                sum_xx += x * x
                sum_xd += x * d
        area = (i1 - i0) * (j1 - j0)
        found[n, 0], found[n, 1], found[n, 2] = occupied / area, empty / area, occluded / area
        if seen:
            found[n, 3] = behind / seen
        found[n, 4] = through / area
        if count >= LEAST_HITS:
            some = np.sort(hits[:count])
            found[n, 5] = some[count // 2]
            found[n, 6] = (some[(9 * count) // 10] - some[count // 10]) / 2
            across = sum_xx - sum_x * sum_x / count
            if across > 0:
                found[n, 7] = abs((sum_xd - sum_x * sum_d / count) / across)
        found[n, 8] = _edge(upright, boxes[n, 0], j0, j1, reach, True)
        found[n, 9] = _edge(upright, boxes[n, 1], j0, j1, reach, True)
        found[n, 10] = _edge(level, boxes[n, 3], i0, i1, reach, False)
        found[n, 11] = _back(depth, i0 - strip, i0, j0, j1, back)
        found[n, 12] = _back(depth, i1, i1 + strip, j0, j1, back)
        found[n, 13] = _back(depth, i0, i1, j1, j1 + strip, back)
        found[n, 14] = _back(depth, i0, i1, j0 - strip, j0, back)
        found[n, 15] = _proud(depth, i0, i1, j0, j1, frame, strip)
        if seen:
            inside /= seen
            found[n, 16] = inside - _mean(depth, i0 - strip, i0, j0, j1)
            found[n, 17] = inside - _mean(depth, i1, i1 + strip, j0, j1)
            found[n, 18] = inside - _mean(depth, i0, i1, j1, j1 + strip)
        up = min(j1, foot)
        left, right = _mean(depth, i0 - strip, i0, 0, up), _mean(depth, i1, i1 + strip, 0, up)
        if np.isnan(left) or np.isnan(right):
            beside = right if np.isnan(left) else left
        else:
            beside = (left + right) / 2
        found[n, 19] = _mean(depth, i0, i1, 0, up) - beside
        rim, out = 2 * frame, 3 * frame
        found[n, 20] = _mean(depth, i0, i0 + rim, j0, j1) - _mean(
            depth, i0 - out, i0 - frame, j0, j1
        )
        found[n, 21] = _mean(depth, i1 - rim, i1, j0, j1) - _mean(
            depth, i1 + frame, i1 + out, j0, j1
        )
        found[n, 22] = _mean(depth, i0, i1, j1 - rim, j1) - _mean(
            depth, i0, i1, j1 + frame, j1 + out
        )
    return found


@numba.njit(cache=True, nogil=True)
def _edge(
    edges: NDArray[np.uint8], at: int, begin: int, end: int, reach: int, upright: bool
) -> float:
    """Return the share of a side along which an edge lies within reach."""
    across = edges.shape[0] if upright else edges.shape[1]
    low, high = max(at - reach, 0), min(at + reach, across)
    met = 0
    for k in range(begin, end):
        for m in range(low, high):
            if (edges[m, k] if upright else edges[k, m]) > 0:
                met += 1
                break
    return met / (end - begin)


@numba.njit(cache=True, nogil=True)
def _back(depth: NDArray[np.float32], i0: int, i1: int, j0: int, j1: int, back: float) -> float:
    """Return the share of what was seen in a box that lies behind the wall."""
    a, b = depth.shape
    seen = behind = 0
    for i in range(max(i0, 0), min(i1, a)):
        for j in range(max(j0, 0), min(j1, b)):
            if not np.isnan(depth[i, j]):
                seen += 1
                behind += depth[i, j] > back
    return behind / seen if seen else np.nan


@numba.njit(cache=True, nogil=True)
def _mean(depth: NDArray[np.float32], i0: int, i1: int, j0: int, j1: int) -> float:
    """Return the mean depth of what was seen in a box, no pixel beyond FLUSH_M."""
    a, b = depth.shape
    total, seen = 0.0, 0
    for i in range(max(i0, 0), min(i1, a)):
        for j in range(max(j0, 0), min(j1, b)):
            d = depth[i, j]
            if not np.isnan(d):
                seen += 1
                total += min(max(d, -FLUSH_M), FLUSH_M)
    return total / seen if seen else np.nan


@numba.njit(cache=True, nogil=True)
def _proud(
    depth: NDArray[np.float32], i0: int, i1: int, j0: int, j1: int, frame: int, strip: int
) -> float:
    """Return how far the strips beside and over a box stand out of those beyond them, metres."""
    a, b = depth.shape
    sums, counts = np.zeros(2), np.zeros(2)
    for i in range(max(i0 - strip, 0), min(i1 + strip, a)):
        for j in range(j0, min(j1 + strip, b)):
            out = max(max(i0 - i, i - i1 + 1), j - j1 + 1)
            if out <= 0 or np.isnan(depth[i, j]) or abs(depth[i, j]) > FLUSH_M:
                continue
            zone = 0 if out <= frame else 1
            sums[zone] += depth[i, j]
            counts[zone] += 1
    if counts.min() == 0:
        return np.nan
    return sums[1] / counts[1] - sums[0] / counts[0]
