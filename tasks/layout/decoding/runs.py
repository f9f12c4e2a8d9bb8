"""Runs: rooms between two walls that were seen, and none of the walls within.

A run of m rooms of the grammar has m - 1 hidden walls inside, each missed with probability
1 - p_seen. Where exactly they stand need not be decided to know how probable the run is: its length
is a sum of normal variables, N(sum of the widths, sum of the spreads squared). So every run of
the grammar is laid out once, and the decoder takes runs for its steps. A unit's rooms stay in
their order; an unexplained room is a run by itself.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from storage.errors import MapSenseError
from tasks.layout.decoding.states import States

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST = 200_000
"""Runs above which a grammar is refused."""
FAR = 8.0
"""Standard deviations of its length beyond which a run is not tried: a density of 1e-14 of the
peak's. Where no room may stay unexplained, all are tried between neighbours."""


class Runs(NamedTuple):
    """N runs of at most M rooms by their widths, the unexplained room last. Metres.

    Row i is one run everywhere.
    """

    states: Ints
    """(N, M), states of its rooms in their order; -1 beyond"""
    shares: Floats
    """(N, M), share of each room in the run's width; 0 beyond"""
    counts: Ints
    """(N,), rooms"""
    first: Ints
    """(N,), state of its first room"""
    last: Ints
    """(N,), state of its last room"""
    widths: Floats
    """(N,), mean; NaN of the unexplained room"""
    variances: Floats
    """(N,), square metres; NaN of the unexplained room"""
    log_prior: Floats
    """(N,), log probability of the run given its first room"""
    explained: int
    """runs of the grammar's rooms: N, or N - 1 with the unexplained room"""
    most_variance: float
    """greatest of a run's"""
    far: float
    """standard deviations of its length beyond which a run is not tried"""
    reach: float
    """greatest distance of two walls that others are passed over in between"""


def make_runs(states: States, p_seen: float, rarest: float) -> Runs:
    """Return the runs of a grammar's rooms.

    Parameters
    ----------
    p_seen : float
        Probability that a wall was seen.
    rarest : float
        Probability, given its first room, below which a run of several rooms is left out.

    Raises
    ------
    MapSenseError
        If there are more than MOST.
    """
    explained = states.explained
    with np.errstate(divide="ignore"):
        missed = np.log(1 - np.float64(p_seen))
    onward = states.log_transitions[:explained, :explained] + missed
    floor = np.log(rarest)
    levels = [np.arange(explained)[:, None]]
    log_priors = [np.zeros(explained)]
    while len(levels[-1]):
        longer = log_priors[-1][:, None] + onward[levels[-1][:, -1]]
        kept, state = np.nonzero(longer >= floor)
        levels.append(np.column_stack([levels[-1][kept], state]))
        log_priors.append(longer[kept, state])
        if sum(map(len, levels)) > MOST:
            raise MapSenseError(
                f"the grammar has more than {MOST:,} ways to fill a gap between two walls; "
                "raise decode.segmental.rarest_run or use a grammar of fewer rules"
            )
    levels.pop()
    if explained < len(states):
        levels.append(np.array([[explained]]))
        log_priors.append(np.zeros(1))
    return _laid_out(levels, np.concatenate(log_priors), states)


def _laid_out(levels: list[Ints], log_prior: Floats, states: States) -> Runs:
    counts = np.concatenate([np.full(len(level), level.shape[1]) for level in levels])
    rooms = np.full((len(counts), counts.max(initial=1)), -1, np.int64)
    at = 0
    for level in levels:
        rooms[at : at + len(level), : level.shape[1]] = level
        at += len(level)
    inside = rooms >= 0
    widths = np.where(inside, states.widths[rooms], 0.0)
    variances = np.where(inside, states.spreads[rooms] ** 2, 0.0)
    length, variance = widths.sum(axis=1), variances.sum(axis=1)
    unexplained = np.isnan(length)
    shares = np.where(unexplained[:, None], inside, widths / length[:, None])
    explained = int((~unexplained).sum())
    order = np.argsort(length, kind="stable")  # NaN comes last
    within = order[:explained]
    return Runs(
        states=rooms[order],
        shares=np.where(inside, shares, 0.0)[order],
        counts=counts[order],
        first=rooms[order, 0],
        last=rooms[order, counts[order] - 1],
        widths=length[order],
        variances=variance[order],
        log_prior=log_prior[order],
        explained=explained,
        most_variance=float(variance[within].max(initial=0.0)),
        far=FAR if unexplained.any() else np.inf,
        reach=float((length + FAR * np.sqrt(variance))[within].max(initial=0.0)),
    )
