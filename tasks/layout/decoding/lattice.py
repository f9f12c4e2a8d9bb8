"""The compiled passes over the lattice of walls and states that a line's decodings run through.

All three stand in one module: what numba has compiled, it compiles again when this file changes,
not when another does that code was taken from.
"""

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

from tasks.layout.decoding.runs import Runs
from tasks.layout.decoding.segmental import Broad, Walls

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NOTHING = 40.0
"""By how much, in logarithms, a term is smaller than the sum that it does not change."""


@nb.njit(cache=True, nogil=True)
def _last_wall(runs: Runs, walls: Walls, a: int) -> int:
    """Return the last wall that rooms which begin at wall a may end at."""
    b = a + 1
    while (
        b + 1 < walls.at.size
        and walls.passed[b] > -np.inf
        and walls.at[b + 1] - walls.at[a] <= runs.reach
    ):
        b += 1
    return b


@nb.njit(cache=True, nogil=True)
def _score(
    runs: Runs, walls: Walls, broad: Broad, a: int, b: int, near: Ints, scores: Floats
) -> int:
    """Find the runs that fit between two walls; return how many.

    Fills `near` with their rows and `scores` with the log probability of each given its first
    room: what the walls themselves say, and those passed over, is not in it.
    """
    length = walls.at[b] - walls.at[a]
    jitter = walls.variances[a] + walls.variances[b]
    margin = runs.far * np.sqrt(runs.most_variance + jitter)
    widths = runs.widths[: runs.explained]
    count = 0
    for r in range(
        np.searchsorted(widths, length - margin), np.searchsorted(widths, length + margin)
    ):
        variance = runs.variances[r] + jitter
        away = (length - widths[r]) ** 2 / variance
        if away <= runs.far**2:
            near[count] = r
            scores[count] = runs.log_prior[r] - 0.5 * (np.log(2 * np.pi * variance) + away)
            count += 1
    if runs.explained < runs.widths.size:
        # the walls' errors are nothing beside this breadth
        away = ((np.log(length) - broad.log_median) / broad.spread) ** 2
        near[count] = runs.explained
        scores[count] = -0.5 * (np.log(2 * np.pi) + away) - np.log(broad.spread * length)
        count += 1
    for t in range(a, b):
        if walls.has_depth[t]:
            for x in range(count):
                scores[x] += walls.log_depths[t, near[x]]
    return count


@nb.njit(cache=True, nogil=True)
def search(
    walls: Walls, runs: Runs, broad: Broad, initial: Floats, onward: Floats,
    may_end: NDArray[np.bool_], count: int,
) -> tuple[int, Floats, Ints]:  # fmt: skip
    """Return how many decodings there are, their log p, and their (wall, run) from the end on."""
    ends, states = walls.at.size, initial.size
    # the best ways to have a room of state s end at a wall, and where they come from: (wall where
    # its run begins, run, entry of `begin` there)
    end = np.full((ends, states, count), -np.inf)
    end_from = np.full((ends, states, count, 3), -1, np.int64)
    # the best ways to begin one: (state before, entry of `end` there)
    begin = np.full((ends, states, count), -np.inf)
    begin_from = np.full((ends, states, count, 2), -1, np.int64)
    begin[0, :, 0] = initial
    near, scores = np.empty(runs.counts.size, np.int64), np.empty(runs.counts.size)
    for a in range(ends - 1):
        if a > 0:
            for s in range(states):
                for f in range(states):
                    for k in range(count):
                        log_p = end[a, s, k] + onward[s, f]
                        at = _insert(begin[a, f], begin_from[a, f], log_p)
                        if at < 0:
                            break
                        begin_from[a, f, at, 0] = s
                        begin_from[a, f, at, 1] = k
        between = 0.0
        for b in range(a + 1, _last_wall(runs, walls, a) + 1):
            if b > a + 1:
                between += walls.passed[b - 1]
            for x in range(_score(runs, walls, broad, a, b, near, scores)):
                r = near[x]
                f, s = runs.first[r], runs.last[r]
                more = between + walls.divides[b] + scores[x]
                for k in range(count):
                    at = _insert(end[b, s], end_from[b, s], begin[a, f, k] + more)
                    if at < 0:
                        break
                    end_from[b, s, at, 0] = a
                    end_from[b, s, at, 1] = r
                    end_from[b, s, at, 2] = k
    best = np.full(count, -np.inf)
    best_from = np.full((count, 2), -1, np.int64)
    for s in range(states):
        for k in range(count):
            if may_end[s]:
                at = _insert(best, best_from, end[ends - 1, s, k])
                if at < 0:
                    break
                best_from[at, 0] = s
                best_from[at, 1] = k
    steps = np.full((count, ends, 2), -1, np.int64)
    found = np.flatnonzero(best > -np.inf).size
    for i in range(found):
        b, s, k = ends - 1, best_from[i, 0], best_from[i, 1]
        step = 0
        while b > 0:
            a, r, entry = end_from[b, s, k]
            steps[i, step, 0], steps[i, step, 1] = a, r
            s, k = begin_from[a, runs.first[r], entry]
            b = a
            step += 1
    return found, best, steps


@nb.njit(cache=True, nogil=True)
def _insert(best: Floats, best_from: Ints, log_p: float) -> int:
    """Make room for one more in a falling list; return its place, -1 if it is none of the best."""
    at = best.size - 1
    if not log_p > best[at]:
        return -1
    while at > 0 and log_p > best[at - 1]:
        best[at] = best[at - 1]
        best_from[at] = best_from[at - 1]
        at -= 1
    best[at] = log_p
    return at


@nb.njit(cache=True, nogil=True)
def sum_all(
    walls: Walls, runs: Runs, broad: Broad, initial: Floats, onward: Floats,
    may_end: NDArray[np.bool_],
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Return log sums (walls, states) over all decodings: what begins, what ends, what is left."""
    ends, states = walls.at.size, initial.size
    begin = np.full((ends, states), -np.inf)
    end = np.full((ends, states), -np.inf)
    rest = np.full((ends, states), -np.inf)
    # a sum is mass * exp(top)
    mass = np.zeros((ends, states))
    begin[0] = initial
    near, scores = np.empty(runs.counts.size, np.int64), np.empty(runs.counts.size)
    for a in range(ends - 1):
        if a > 0:
            _logarithm(end[a], mass[a])
            for f in range(states):
                begin[a, f] = _log_sum(end[a] + onward[:, f])
        between = 0.0
        for b in range(a + 1, _last_wall(runs, walls, a) + 1):
            if b > a + 1:
                between += walls.passed[b - 1]
            more = between + walls.divides[b]
            for x in range(_score(runs, walls, broad, a, b, near, scores)):
                log_p = begin[a, runs.first[near[x]]] + more + scores[x]
                _add(end[b], mass[b], runs.last[near[x]], log_p)
    _logarithm(end[ends - 1], mass[ends - 1])
    for s in range(states):
        if may_end[s]:
            rest[ends - 1, s] = 0.0
    for a in range(ends - 2, -1, -1):
        onto, onto_mass = np.full(states, -np.inf), np.zeros(states)
        between = 0.0
        for b in range(a + 1, _last_wall(runs, walls, a) + 1):
            if b > a + 1:
                between += walls.passed[b - 1]
            more = between + walls.divides[b]
            for x in range(_score(runs, walls, broad, a, b, near, scores)):
                log_p = more + scores[x] + rest[b, runs.last[near[x]]]
                _add(onto, onto_mass, runs.first[near[x]], log_p)
        _logarithm(onto, onto_mass)
        for s in range(states):
            rest[a, s] = _log_sum(onward[s] + onto)
    return begin, end, rest


@nb.njit(cache=True, nogil=True)
def sum_of_run(
    walls: Walls, runs: Runs, broad: Broad, classes: Ints, begin: Floats, rest: Floats,
    log_total: float, a: int, b: int, run: int,
) -> Floats:  # fmt: skip
    """Return the posterior of each room of a run between two walls."""
    more = walls.divides[b] - log_total
    for c in range(a + 1, b):
        more += walls.passed[c]
    near, scores = np.empty(runs.counts.size, np.int64), np.empty(runs.counts.size)
    summed = np.zeros(runs.counts[run])
    for x in range(_score(runs, walls, broad, a, b, near, scores)):
        r = near[x]
        if runs.counts[r] != summed.size:
            continue
        p = np.exp(begin[a, runs.first[r]] + more + scores[x] + rest[b, runs.last[r]])
        for k in range(summed.size):
            if classes[runs.states[r, k]] == classes[runs.states[run, k]]:
                summed[k] += p
    return summed


@nb.njit(cache=True, nogil=True)
def sum_of_hidden(
    walls: Walls, runs: Runs, broad: Broad, widths: Floats, variances: Floats, begin: Floats,
    rest: Floats, log_total: float, at: float, near_m: float,
) -> float:  # fmt: skip
    """Return how many hidden walls are to be expected within `near_m` of a place.

    Given the two seen walls about its run, where a hidden one stands is a normal distribution.
    """
    near, scores = np.empty(runs.counts.size, np.int64), np.empty(runs.counts.size)
    expected = 0.0
    for a in range(walls.at.size - 1):
        if walls.at[a] >= at + near_m:
            break
        between = -log_total
        for b in range(a + 1, _last_wall(runs, walls, a) + 1):
            if b > a + 1:
                between += walls.passed[b - 1]
            if walls.at[b] <= at - near_m:
                continue
            more = between + walls.divides[b]
            for x in range(_score(runs, walls, broad, a, b, near, scores)):
                r = near[x]
                if runs.counts[r] == 1:
                    continue
                log_p = begin[a, runs.first[r]] + more + scores[x] + rest[b, runs.last[r]]
                if log_p < -NOTHING:
                    continue
                p = np.exp(log_p)
                total = runs.variances[r] + walls.variances[a] + walls.variances[b]
                over = walls.at[b] - walls.at[a] - runs.widths[r]
                mean, behind = walls.at[a], walls.variances[a]
                for k in range(runs.counts[r] - 1):
                    mean += widths[runs.states[r, k]]
                    behind += variances[runs.states[r, k]]
                    off = at - mean - over * behind / total
                    spread = np.sqrt(2 * behind * (total - behind) / total)
                    expected += (
                        p
                        * 0.5
                        * (math.erf((off + near_m) / spread) - math.erf((off - near_m) / spread))
                    )
    return expected


@nb.njit(cache=True, nogil=True)
def _add(top: Floats, mass: Floats, i: int, log_p: float) -> None:
    """Add exp(log_p) to the sum mass[i] * exp(top[i])."""
    if log_p <= top[i]:
        if log_p > top[i] - NOTHING:
            mass[i] += np.exp(log_p - top[i])
    else:
        mass[i] = mass[i] * np.exp(top[i] - log_p) + 1.0
        top[i] = log_p


@nb.njit(cache=True, nogil=True)
def _logarithm(top: Floats, mass: Floats) -> None:
    """Turn sums mass * exp(top) into their logarithms, in `top`."""
    for i in range(top.size):
        if mass[i] > 0:
            top[i] += np.log(mass[i])


@nb.njit(cache=True, nogil=True)
def _log_sum(logs: Floats) -> float:
    top = logs.max()
    return top + np.log(np.exp(logs - top).sum()) if top > -np.inf else top
