"""Cells of a lattice: which one a point lies in, their order, and the means of their points.

Compiled loops over points. A cell is three whole numbers or, within a cube of 2^21 of them a side,
one key: its Morton code, the bits of x, y and z in turn.
"""

import numba as nb
import numpy as np

DIGIT_BITS = 11
"""Bits the radix sort takes at once: its counters stay in the nearest cache."""


@nb.njit(inline="always")
def ones(value):
    """Return how many bits are set."""
    v = np.uint64(value)
    v -= (v >> np.uint64(1)) & np.uint64(0x5555555555555555)
    v = (v & np.uint64(0x3333333333333333)) + ((v >> np.uint64(2)) & np.uint64(0x3333333333333333))
    v = (v + (v >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((v * np.uint64(0x0101010101010101)) >> np.uint64(56))


@nb.njit(cache=True, nogil=True)
def bounds(xyz):
    """Return the least and greatest coordinates of (n, 3) points, n > 0, or NaN."""
    low, high = xyz[0].copy(), xyz[0].copy()
    doubt = np.float32(0)
    for i in range(xyz.shape[0]):
        for axis in range(3):
            value = xyz[i, axis]
            doubt += value - value  # NaN for infinity and NaN
            low[axis] = min(low[axis], value)
            high[axis] = max(high[axis], value)
    return low + doubt, high + doubt


@nb.njit(inline="always")
def _cell(value, shift, edge, low):
    return np.int64(np.floor((value + shift) / edge)) - low


@nb.njit(inline="always")
def _spread(v):
    """Return the lowest 21 bits of a number, two zeros before each."""
    v = np.uint64(v)
    v = (v | (v << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
    v = (v | (v << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
    v = (v | (v << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    v = (v | (v << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (v | (v << np.uint64(2))) & np.uint64(0x1249249249249249)


@nb.njit(inline="always")
def _gather(v):
    """Return every third bit of a number, from the lowest on."""
    v &= np.uint64(0x1249249249249249)
    v = (v | (v >> np.uint64(2))) & np.uint64(0x10C30C30C30C30C3)
    v = (v | (v >> np.uint64(4))) & np.uint64(0x100F00F00F00F00F)
    v = (v | (v >> np.uint64(8))) & np.uint64(0x1F0000FF0000FF)
    v = (v | (v >> np.uint64(16))) & np.uint64(0x1F00000000FFFF)
    return np.int64((v | (v >> np.uint64(32))) & np.uint64(0x1FFFFF))


@nb.njit(cache=True, nogil=True)
def morton_keys(xyz, shift, edge, low):
    """Return the Morton codes, (n,) uint64, of the points' cells, counted from cell `low`."""
    keys = np.empty(xyz.shape[0], np.uint64)
    for i in range(xyz.shape[0]):
        x = _spread(_cell(xyz[i, 0], shift[0], edge, low[0]))
        y = _spread(_cell(xyz[i, 1], shift[1], edge, low[1]))
        z = _spread(_cell(xyz[i, 2], shift[2], edge, low[2]))
        keys[i] = (x << np.uint64(2)) | (y << np.uint64(1)) | z
    return keys


@nb.njit(cache=True, nogil=True)
def morton_cells(keys):
    """Return the cells, (n, 3) int64, of Morton codes."""
    cells = np.empty((keys.size, 3), np.int64)
    for i in range(keys.size):
        cells[i, 0] = _gather(keys[i] >> np.uint64(2))
        cells[i, 1] = _gather(keys[i] >> np.uint64(1))
        cells[i, 2] = _gather(keys[i])
    return cells


@nb.njit(inline="always")
def _starts(keys, shift, starts):
    """Write where the keys with each value of a digit will begin."""
    starts[:] = 0
    for i in range(keys.size):
        starts[np.int64((keys[i] >> shift) & np.uint64(starts.size - 1))] += 1
    total = 0
    for digit in range(starts.size):
        count = starts[digit]
        starts[digit] = total
        total += count


@nb.njit(cache=True, nogil=True)
def sorted_unique(keys, bits):
    """Return the different keys in ascending order; `keys` of so many bits is used up."""
    other, starts = np.empty_like(keys), np.empty(1 << DIGIT_BITS, np.int64)
    for shift in range(0, bits, DIGIT_BITS):
        _starts(keys, np.uint64(shift), starts)
        for i in range(keys.size):
            digit = np.int64((keys[i] >> np.uint64(shift)) & np.uint64(starts.size - 1))
            other[starts[digit]] = keys[i]
            starts[digit] += 1
        keys, other = other, keys
    count = min(1, keys.size)
    for i in range(1, keys.size):
        if keys[i] != keys[count - 1]:
            keys[count] = keys[i]
            count += 1
    return keys[:count].copy()


@nb.njit(cache=True, nogil=True)
def sorted_order(keys, bits):
    """Return the keys in ascending order and their indices, (n,) int32, equal keys in turn.

    `keys` is used up.
    """
    order = np.arange(keys.size).astype(np.int32)
    other, other_order = np.empty_like(keys), np.empty_like(order)
    starts = np.empty(1 << DIGIT_BITS, np.int64)
    for shift in range(0, bits, DIGIT_BITS):
        _starts(keys, np.uint64(shift), starts)
        for i in range(keys.size):
            digit = np.int64((keys[i] >> np.uint64(shift)) & np.uint64(starts.size - 1))
            other[starts[digit]], other_order[starts[digit]] = keys[i], order[i]
            starts[digit] += 1
        keys, other = other, keys
        order, other_order = other_order, order
    return keys, order


@nb.njit(cache=True, nogil=True)
def occupancy(keys):
    """Return the parents' keys, in order, and their occupancy bytes; `keys` ascend."""
    count = 0
    for i in range(keys.size):
        if i == 0 or keys[i] >> np.uint64(3) != keys[i - 1] >> np.uint64(3):
            count += 1
    parents, bytes_ = np.empty(count, np.uint64), np.zeros(count, np.uint8)
    at = -1
    for i in range(keys.size):
        parent = keys[i] >> np.uint64(3)
        if at < 0 or parent != parents[at]:
            at += 1
            parents[at] = parent
        bytes_[at] |= np.uint8(1 << np.int64(keys[i] & np.uint64(7)))
    return parents, bytes_


@nb.njit(cache=True, nogil=True)
def children(keys, bytes_, count):
    """Return the keys of the occupied children, which are `count`: what `occupancy` undoes."""
    found = np.empty(count, np.uint64)
    at = 0
    for i in range(keys.size):
        for child in range(8):
            if (bytes_[i] >> child) & 1:
                found[at] = (keys[i] << np.uint64(3)) | np.uint64(child)
                at += 1
    return found


@nb.njit(cache=True, nogil=True)
def sorted_means(xyz, keys, order):
    """Return the means, (k, 3), of the points of each key; `keys` ascend."""
    count = 0
    for i in range(keys.size):
        if i == 0 or keys[i] != keys[i - 1]:
            count += 1
    means = np.empty((count, 3), np.float32)
    start = 0
    for at in range(count):
        x = y = z = 0.0
        end = start
        while end < keys.size and keys[end] == keys[start]:
            x += xyz[order[end], 0]
            y += xyz[order[end], 1]
            z += xyz[order[end], 2]
            end += 1
        n = end - start
        means[at, 0], means[at, 1], means[at, 2] = x / n, y / n, z / n
        start = end
    return means


@nb.njit(cache=True, nogil=True)
def centres(cells, low, edge, shift):
    """Return the centres, (n, 3) float32, of cells counted from cell `low`, less `shift`."""
    xyz = np.empty(cells.shape, np.float32)
    for i in range(cells.shape[0]):
        for axis in range(3):
            xyz[i, axis] = (cells[i, axis] + low[axis] + 0.5) * edge - shift[axis]
    return xyz
