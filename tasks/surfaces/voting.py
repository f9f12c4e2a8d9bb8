"""Draws and votes of the randomized Hough transform (Sec. 4.1).

Three points whose pairwise distances lie in a range span a plane; the plane votes for one cell of
an accumulator over direction and offset; a cell that collects enough votes is a plane. Directions
are kept in a ball of nearly equal-area cells (Borrmann et al., 3D Research 2011): a plain grid
over angles has tiny cells at the poles, and floors and ceilings would need more votes than walls.
"""

from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

LOG = 1 << 18
"""Votes remembered until the accumulator is cleared: clearing touches only these cells."""
ANYWHERE = np.inf
"""Edge of a bin that holds a whole cloud, metres."""
BATCH = 256
"""Triplets drawn before they vote: one tight loop for each is twice as fast as one for both."""


@dataclass(frozen=True, eq=False)
class Ball:
    """Cells of the unit sphere: rows of equal polar angle, each cut into cells of equal area."""

    cells_of_row: NDArray[np.int32]
    """(r,)"""
    first_of_row: NDArray[np.int32]
    """(r + 1,), number of the first cell of each row; the last is the number of cells"""

    def areas(self) -> NDArray[np.float64]:
        """Return the solid angle of one cell of each row, steradian, (r,)."""
        edges = np.cos(np.linspace(0, np.pi, len(self.cells_of_row) + 1))
        return 2 * np.pi * -np.diff(edges) / self.cells_of_row


def make_ball(cell_rad: float) -> Ball:
    """Return the ball whose cells are about `cell_rad` wide."""
    rows = max(2, round(np.pi / cell_rad))
    edges = np.cos(np.linspace(0, np.pi, rows + 1))
    strips = 2 * np.pi * -np.diff(edges)
    cells = np.maximum(1, np.rint(strips / (np.pi / rows) ** 2)).astype(np.int32)
    return Ball(cells, np.concatenate(([0], np.cumsum(cells))).astype(np.int32))


@nb.njit(cache=True, nogil=True)
def seed_state(seed):
    """Return the state of the draws' generator for a seed (splitmix64, never zero)."""
    z = np.uint64(seed) + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    state = np.empty(1, np.uint64)
    state[0] = (z ^ (z >> np.uint64(31))) | np.uint64(1)
    return state


@nb.njit(inline="always")
def _below(state, n):
    """Draw an integer in [0, n) (xorshift64)."""
    x = state[0]
    x ^= x << np.uint64(13)
    x ^= x >> np.uint64(7)
    x ^= x << np.uint64(17)
    state[0] = x
    return np.int64(((x >> np.uint64(32)) * np.uint64(n)) >> np.uint64(32))


@nb.njit(inline="always")
def _in_range(xyz, i, j, low2, high2):
    dx = xyz[i, 0] - xyz[j, 0]
    dy = xyz[i, 1] - xyz[j, 1]
    dz = xyz[i, 2] - xyz[j, 2]
    d2 = dx * dx + dy * dy + dz * dz
    return low2 <= d2 <= high2


@nb.njit(inline="always")
def _plane_through(xyz, i, j, k):
    """Return (nx, ny, nz, rho) with rho >= 0; the normal is zero if the points are on a line."""
    ux, uy, uz = xyz[j, 0] - xyz[i, 0], xyz[j, 1] - xyz[i, 1], xyz[j, 2] - xyz[i, 2]
    vx, vy, vz = xyz[k, 0] - xyz[i, 0], xyz[k, 1] - xyz[i, 1], xyz[k, 2] - xyz[i, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length < np.float32(1e-6):
        return np.float32(0), np.float32(0), np.float32(0), np.float32(0)
    scale = np.float32(1) / length
    nx, ny, nz = nx * scale, ny * scale, nz * scale
    rho = nx * xyz[i, 0] + ny * xyz[i, 1] + nz * xyz[i, 2]
    if rho < 0:
        return -nx, -ny, -nz, -rho
    return nx, ny, nz, rho


@nb.njit(inline="always")
def _polar(z):
    """Return arccos(z), within 0.0001 rad (Abramowitz & Stegun 4.4.45)."""
    x = min(np.float32(1), abs(z))
    angle = np.sqrt(np.float32(1) - x) * (
        np.float32(1.5707288)
        + x * (np.float32(-0.2121144) + x * (np.float32(0.0742610) + x * np.float32(-0.0187293)))
    )
    return angle if z >= 0 else np.float32(np.pi) - angle


@nb.njit(inline="always")
def _azimuth(y, x):
    """Return arctan2(y, x), within 0.0001 rad (Abramowitz & Stegun 4.4.47)."""
    short, long = min(abs(x), abs(y)), max(abs(x), abs(y))
    t = short / max(long, np.float32(1e-30))
    s = t * t
    angle = t * (
        np.float32(0.9998660)
        + s
        * (
            np.float32(-0.3302995)
            + s * (np.float32(0.1801410) + s * (np.float32(-0.0851330) + s * np.float32(0.0208351)))
        )
    )
    if abs(y) > abs(x):
        angle = np.float32(np.pi / 2) - angle
    if x < 0:
        angle = np.float32(np.pi) - angle
    return angle if y >= 0 else -angle


@nb.njit(inline="always")
def _cell_of(nx, ny, nz, rho, cells_of_row, first_of_row, rho_cells, per_metre):
    """Return the accumulator cell of a plane.

    A direction's angles are known well enough: a cell is hundreds of times wider than their error.
    """
    rows = cells_of_row.size
    row = min(np.int64(_polar(nz) * np.float32(rows / np.pi)), rows - 1)
    turn = (_azimuth(ny, nx) + np.float32(np.pi)) * np.float32(0.5 / np.pi)
    column = min(max(np.int64(turn * cells_of_row[row]), 0), cells_of_row[row] - 1)
    return (first_of_row[row] + column) * rho_cells + min(np.int64(rho * per_metre), rho_cells - 1)


@nb.njit(cache=True, nogil=True)
def vote(
    xyz, bins, members, shape, low, edge, beta_min, beta_max, accumulator, cells_of_row,
    first_of_row, rho_cells, per_metre, gamma_cell, tries, state, touched, votes,
):  # fmt: skip
    """Draw triplets until one cell is full: anywhere if there is but one bin, or from bins nearby.

    A patch with a thousandth of the points is met by a billionth of the triplets drawn anywhere,
    but by a ten-thousandth of those whose second and third point come from bins around the first.

    Returns (found, nx, ny, nz, rho): the mean of the full cell's votes.
    """
    low2, high2 = np.float32(beta_min**2), np.float32(beta_max**2)
    reach = int(np.ceil(beta_max / edge))
    triplets = np.empty((BATCH, 3), np.int64)
    logged = 0
    for done in range(0, tries, BATCH):
        batch = min(BATCH, tries - done)
        if bins.size == 2:
            drawn = _draw_anywhere(xyz, batch, low2, high2, state, triplets)
        else:
            drawn = _draw_nearby(
                xyz, batch, bins, members, shape, low, edge, reach, low2, high2, state, triplets
            )
        if logged + drawn > touched.size:
            _clear(logged, accumulator, touched)
            logged = 0
        full, logged = _cast(
            xyz, triplets, drawn, accumulator, cells_of_row, first_of_row, rho_cells, per_metre,
            gamma_cell, logged, touched, votes,
        )  # fmt: skip
        if full >= 0:
            return _mean_vote(full, logged, accumulator, touched, votes)
    _clear(logged, accumulator, touched)
    return False, 0.0, 0.0, 0.0, 0.0


@nb.njit(cache=True, nogil=True)
def _draw_anywhere(xyz, tries, low2, high2, state, triplets):
    """Fill in triplets of the whole cloud whose distances are in range; return how many."""
    n, drawn = xyz.shape[0], 0
    for _ in range(tries):
        i, j, k = _below(state, n), _below(state, n), _below(state, n)
        if (
            _in_range(xyz, i, j, low2, high2)
            and _in_range(xyz, i, k, low2, high2)
            and _in_range(xyz, j, k, low2, high2)
        ):
            triplets[drawn, 0], triplets[drawn, 1], triplets[drawn, 2] = i, j, k
            drawn += 1
    return drawn


@nb.njit(cache=True, nogil=True)
def _draw_nearby(
    xyz, tries, bins, members, shape, low, edge, reach, low2, high2, state, triplets
):  # fmt: skip
    """Fill in triplets of a point and two of the bins around it; return how many."""
    n, drawn = xyz.shape[0], 0
    for _ in range(tries):
        i = _below(state, n)
        j = _neighbour(xyz, i, bins, members, shape, low, edge, reach, low2, high2, state)
        if j < 0:
            continue
        k = _neighbour(xyz, i, bins, members, shape, low, edge, reach, low2, high2, state)
        if k >= 0 and _in_range(xyz, j, k, low2, high2):
            triplets[drawn, 0], triplets[drawn, 1], triplets[drawn, 2] = i, j, k
            drawn += 1
    return drawn


@nb.njit(inline="always")
def _neighbour(xyz, i, bins, members, shape, low, edge, reach, low2, high2, state):
    """Draw a point of a bin around point i at a distance in range; -1 if eight draws miss."""
    bx = np.int64((xyz[i, 0] - low[0]) / edge)
    by = np.int64((xyz[i, 1] - low[1]) / edge)
    bz = np.int64((xyz[i, 2] - low[2]) / edge)
    for _ in range(8):
        x = bx + _below(state, 2 * reach + 1) - reach
        y = by + _below(state, 2 * reach + 1) - reach
        z = bz + _below(state, 2 * reach + 1) - reach
        if x < 0 or y < 0 or z < 0 or x >= shape[0] or y >= shape[1] or z >= shape[2]:
            continue
        b = (x * shape[1] + y) * shape[2] + z
        count = bins[b + 1] - bins[b]
        if count == 0:
            continue
        j = members[bins[b] + _below(state, count)]
        if _in_range(xyz, i, j, low2, high2):
            return j
    return -1


@nb.njit(cache=True, nogil=True)
def _cast(
    xyz, triplets, drawn, accumulator, cells_of_row, first_of_row, rho_cells, per_metre,
    gamma_cell, logged, touched, votes,
):  # fmt: skip
    """Cast and log the votes of triplets; return the cell that is full (-1 if none) and the log's
    length."""
    for t in range(drawn):
        nx, ny, nz, rho = _plane_through(xyz, triplets[t, 0], triplets[t, 1], triplets[t, 2])
        if nx == 0 and ny == 0 and nz == 0:
            continue
        cell = _cell_of(nx, ny, nz, rho, cells_of_row, first_of_row, rho_cells, per_metre)
        accumulator[cell] += 1
        touched[logged] = cell
        votes[logged, 0], votes[logged, 1], votes[logged, 2], votes[logged, 3] = nx, ny, nz, rho
        logged += 1
        if accumulator[cell] >= gamma_cell:
            return cell, logged
    return -1, logged


@nb.njit(cache=True, nogil=True)
def fill_bins(xyz, low, edge, shape):
    """Return (bins, members): points of bin b are `members[bins[b]:bins[b + 1]]`."""
    n = xyz.shape[0]
    where = np.empty(n, np.int64)
    bins = np.zeros(shape[0] * shape[1] * shape[2] + 1, np.int64)
    for i in range(n):
        x = np.int64((xyz[i, 0] - low[0]) / edge)
        y = np.int64((xyz[i, 1] - low[1]) / edge)
        z = np.int64((xyz[i, 2] - low[2]) / edge)
        where[i] = (x * shape[1] + y) * shape[2] + z
        bins[where[i] + 1] += 1
    for b in range(bins.size - 1):
        bins[b + 1] += bins[b]
    at = bins[:-1].copy()
    members = np.empty(n, np.int64)
    for i in range(n):
        members[at[where[i]]] = i
        at[where[i]] += 1
    return bins, members


@nb.njit(inline="always")
def _mean_vote(cell, logged, accumulator, touched, votes):
    sx = sy = sz = sr = 0.0
    count = 0
    for q in range(logged):
        if touched[q] == cell:
            sx += votes[q, 0]
            sy += votes[q, 1]
            sz += votes[q, 2]
            sr += votes[q, 3]
            count += 1
    _clear(logged, accumulator, touched)
    length = np.sqrt(sx * sx + sy * sy + sz * sz)
    return True, sx / length, sy / length, sz / length, sr / count


@nb.njit(inline="always")
def _clear(logged, accumulator, touched):
    for q in range(logged):
        accumulator[touched[q]] = 0
